#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "base/log.h"
#include "base/mutex.h"
#include "console/alarm_book.h"
#include "console/live_board.h"

namespace fdi::console {

/// A server-sent event: "event: NAME\ndata: DATA\n\n". `data` has no line
/// breaks; compact JSON has none.
using Message = std::shared_ptr<const std::string>;
Message StreamEvent(const std::string& name, const std::string& data);

/// Settings of LiveStream.
struct StreamOptions {
  std::size_t max_clients{16};
  std::size_t max_bytes{4 << 20};  ///< Bound of the queue of one client.
};

/// Clients since the start, by outcome.
struct StreamCounts {
  std::uint64_t clients{0};  ///< At present.
  std::uint64_t admitted{0};
  std::uint64_t refused{0};  ///< max_clients was reached.
  std::uint64_t dropped{0};  ///< Too slow.
};

/// The sources of the stream; everything outlives its threads.
struct FeedParts {
  LiveBoard& board;
  AlarmBook& alarms;
  const report::FaultTexts& texts;
  std::function<std::int64_t()> utc_now_ns;
  LogSink log;
  /// For a plant, whose history may be away: PlantJson(), sent every second.
  std::function<Json()> plant{};
};

/// The pages that are connected, and two threads that push changes to them:
/// tiles every second and samples of the valves on display four times a second;
/// alarms immediately, from a thread of their own because the history may be
/// slow or unavailable. A bounded queue separates these from the HTTP thread
/// that writes to a page's socket; a client whose queue is full is dropped, so
/// nothing ever waits for a client. Without clients only the alarms are
/// followed. Thread safe.
class LiveStream {
 public:
  enum class Outcome : std::uint8_t { kMessage, kTimeout, kEnded };
  struct Client;

  explicit LiveStream(StreamOptions options = {}) : options_(options) {}
  ~LiveStream() { Stop(); }
  LiveStream(const LiveStream&) = delete;
  LiveStream& operator=(const LiveStream&) = delete;

  /// Starts the threads, which push changes from now on. Call once.
  /// @throws storage::SqliteError, DataError; never for a plant.
  void Start(FeedParts parts);
  /// Ends all clients and admits no more. Does not block.
  void Close();
  /// Closes, and waits for the threads.
  void Stop();

  /// @param valve whose samples are pushed, starting at `next_sample` of
  ///   LiveBoard::Since(); empty: none.
  /// @param hello first message. @returns null if max_clients is reached or the
  ///   stream is closed.
  std::shared_ptr<Client> Admit(const std::string& valve,
                                std::uint64_t next_sample,
                                const Message& hello);
  /// The next message of `client`. Queued messages are dropped when the client
  /// is ended.
  Outcome Next(Client& client, std::chrono::milliseconds timeout,
               Message& message);
  void Release(const std::shared_ptr<Client>& client);
  void Broadcast(const Message& message);
  StreamCounts counts() const;

  /// Reports a change of the history: its alarms are pushed immediately.
  void Wake();
  /// Adds an event that is not in the history.
  void AddUnstored(const FaultEvent& event);

 private:
  void Run();
  void FollowAlarms();
  void Step(std::chrono::steady_clock::time_point now);
  void SendUnstored();
  void SendSamples();
  void SendTiles();
  void Push(Client& client, const Message& message) REQUIRES(mutex_);

  const StreamOptions options_;
  std::unique_ptr<FeedParts> parts_;
  // Version and alarm of each valve as of the last tile that was sent.
  std::map<std::string, std::pair<std::uint64_t, ValveAlarm>> sent_;
  std::chrono::steady_clock::time_point next_tiles_;

  mutable Mutex mutex_;  // Also of all Client fields.
  CondVar changed_;
  std::vector<std::shared_ptr<Client>> clients_ GUARDED_BY(mutex_);
  StreamCounts counts_ GUARDED_BY(mutex_);
  std::vector<FaultEvent> unstored_ GUARDED_BY(mutex_);
  bool woken_ GUARDED_BY(mutex_){false};
  bool closed_ GUARDED_BY(mutex_){false};
  std::thread thread_;
  std::thread alarms_thread_;
};

}  // namespace fdi::console
