#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <vector>

#include "base/mutex.h"
#include "base/worker.h"
#include "monitor/service/service_part.h"
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

  Mutex mutex_;
  CondVar changed_;
  bool woken_ GUARDED_BY(mutex_){true};
  bool stopping_ GUARDED_BY(mutex_){false};

  Worker worker_;
};

/// The search as a part of a running monitor, which logs each change of a
/// common cause and notifies of it. Null if there are no groups.
std::shared_ptr<monitor::ServicePart> CausePart(
    std::vector<storage::CauseGroup> groups);

}  // namespace fdi::planner
