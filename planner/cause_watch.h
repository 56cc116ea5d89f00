#pragma once

#include <condition_variable>
#include <filesystem>
#include <functional>
#include <mutex>
#include <vector>

#include "base/worker.h"
#include "storage/history/common_cause.h"
#include "storage/history/history_database.h"

namespace fdi::planner {

/// Finds common causes of episodes: reads the events that history.db has
/// committed, and stores what follows from them in transactions of its own. Has
/// a connection and a thread, so that neither journal nor bus waits for it.
///
/// Built idle. Thread safe except for Start() and Stop().
class CauseWatch {
 public:
  /// Runs a step and takes what it throws; the step is repeated later.
  using Guard = std::function<void(const std::function<void()>&)>;

  /// @param on_change called by the thread after each change was committed.
  /// @throws DataError, storage::SqliteError
  CauseWatch(const std::filesystem::path& history,
             std::vector<storage::CauseGroup> groups,
             std::function<void(const storage::CauseChange&)> on_change,
             Guard guard);
  ~CauseWatch() { Stop(); }
  CauseWatch(const CauseWatch&) = delete;
  CauseWatch& operator=(const CauseWatch&) = delete;

  void Start();
  /// Further events are committed. Does not wait.
  void Wake();
  /// Reads what is committed, then ends the thread.
  void Stop();

 private:
  void Run();
  void ReadAll();

  storage::Database database_;
  storage::CommonCauseBook book_;
  std::function<void(const storage::CauseChange&)> on_change_;
  Guard guard_;

  std::mutex mutex_;  // Guards what follows.
  std::condition_variable changed_;
  bool woken_{true};
  bool stopping_{false};

  Worker worker_;
};

}  // namespace fdi::planner
