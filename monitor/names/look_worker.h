#pragma once

#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <future>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <string_view>
#include <utility>

#include "base/mutex.h"
#include "base/worker.h"
#include "diagnosis/decision/look.h"
#include "diagnosis/model/model_set.h"

namespace fdi::monitor {

/// The fate of a look.
enum class LookFate : std::uint8_t { kTaken, kDropped, kFailed };

/// Is told of each look; called by any thread. @param whose "valve=V1" or
/// "model_set=NAME@1". @param reason of a failure.
using LookReport = std::function<void(LookFate, const std::string& whose,
                                      std::string_view reason)>;

/// Takes second looks at episodes on a thread of its own, in the order in which
/// they were asked for. A look costs up to some seconds of processor time: the
/// thread runs at low priority, and whoever asks never waits for it. A few
/// looks may wait, one of each valve, behind them the routine ones, and behind
/// all the ones for growth; what does not fit is dropped and counted.
///
/// Built idle. Thread safe, but for Start() and Stop().
class LookWorker {
 public:
  using Physics = std::shared_ptr<const LookSimulation>;
  /// Nothing: the look was dropped, replaced or failed.
  using Answer = std::optional<LookAnswer>;

  explicit LookWorker(LookReport report, std::size_t capacity = 64)
      : report_(std::move(report)), capacity_(capacity) {}
  ~LookWorker();
  LookWorker(const LookWorker&) = delete;
  LookWorker& operator=(const LookWorker&) = delete;

  /// The physics of `models`. Null if there are none, or if they cannot be
  /// used, which is counted and logged.
  Physics PhysicsOf(const ModelSet& models) const;

  /// Asks for a look. Unless it is for growth, it replaces one at the same
  /// valve that still waits.
  std::future<Answer> Submit(std::string valve_id, Physics physics,
                             LookTask task);

  void Start();
  /// Ends the thread, at once between two hypotheses; gives up waiting looks.
  void Stop();
  /// Looks at episodes that wait for the thread. Any thread.
  std::size_t waiting() const;
  /// The thread ended with an exception, which Stop() throws. Any thread.
  bool failed() const { return thread_.failed(); }

 private:
  enum class Rank : std::uint8_t { kNaming, kRoutine, kGrowth };
  struct Look {
    Rank rank;
    std::string valve_id;
    Physics physics;
    LookTask task;
    std::promise<Answer> answer{};
  };

  void TakeLooks();
  Answer Take(const Look& look) const;

  const LookReport report_;
  // 27 kB each: what 2000 valves that start at once ask for.
  static constexpr std::size_t kMaxRoutineLooks = 2000;
  const std::size_t capacity_;
  std::stop_source stop_;
  mutable Mutex mutex_;
  std::condition_variable_any arrival_;
  std::deque<Look> waiting_ GUARDED_BY(mutex_);  // By rank, then as asked for.
  Worker thread_;
};

}  // namespace fdi::monitor
