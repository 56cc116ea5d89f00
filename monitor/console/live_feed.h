#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "diagnosis/log.h"
#include "monitor/console/alarm_book.h"
#include "monitor/console/live_board.h"
#include "monitor/console/stream_hub.h"

namespace fdi::console {

/// What LiveFeed reads and where it writes; all outlive it.
struct FeedParts {
  LiveBoard& board;
  StreamHub& hub;
  AlarmBook& alarms;
  const cli::FaultTexts& texts;
  std::function<std::int64_t()> utc_now_ns;
  LogSink log;
};

/// Tells those who listen what changes, by a thread of its own: tiles each
/// second, samples of the valves they look at four times a second, alarms at
/// once. Nothing but alarms is looked at while nobody listens.
class LiveFeed {
 public:
  explicit LiveFeed(FeedParts parts);
  ~LiveFeed();
  LiveFeed(const LiveFeed&) = delete;
  LiveFeed& operator=(const LiveFeed&) = delete;

  /// What happens from now on is told.
  /// @throws storage::SqliteError, DataError
  void Start();
  void Stop();

  /// The history changed: told at once. Any thread.
  void Wake();
  /// An event that is not in the history. Any thread.
  void TellUnstored(const monitor::EpisodeEvent& event);

 private:
  void Run();
  void Step(std::chrono::steady_clock::time_point now);
  void TellAlarms();
  void TellSamples();
  void TellTiles();
  void TellGaps();

  FeedParts parts_;
  std::map<std::string, std::pair<std::uint64_t, ValveAlarm>> told_;
  std::chrono::steady_clock::time_point next_tiles_;
  std::chrono::steady_clock::time_point next_alarms_;

  std::mutex mutex_;
  std::condition_variable changed_;
  bool woken_{false};
  bool stopping_{false};
  std::vector<monitor::EpisodeEvent> unstored_;
  std::thread thread_;
};

}  // namespace fdi::console
