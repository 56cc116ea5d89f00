#pragma once

#include <deque>
#include <future>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "diagnosis/decision/look.h"
#include "monitor/names/look_worker.h"

namespace fdi::monitor {

/// The looks at one valve that a LookWorker was asked for and has not answered.
/// No sample waits for a simulation.
class PendingLooks {
 public:
  /// @param worker outlives this; null: no look is ever due.
  PendingLooks(std::string valve_id, LookWorker* worker)
      : valve_id_(std::move(valve_id)), worker_(worker) {}

  void Request(std::vector<LookTask> due, const LookWorker::Physics& physics);

  /// The answers that have arrived since the last call, in the order in which
  /// they were asked for, each with its task, which has lost its rows.
  std::vector<std::pair<LookTask, LookAnswer>> Collect();

  /// Their episode is over.
  void Clear() { pending_.clear(); }

 private:
  struct Pending {
    LookTask task;  // Without its rows.
    std::future<LookWorker::Answer> answer;
  };

  std::string valve_id_;
  LookWorker* worker_;
  std::deque<Pending> pending_;
};

}  // namespace fdi::monitor
