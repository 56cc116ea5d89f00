#pragma once

#include <future>
#include <memory>
#include <optional>
#include <string_view>
#include <vector>

#include "diagnosis/loop/loop_watch.h"
#include "monitor/names/audit_worker.h"

namespace fdi::monitor {

/// Judges one valve by the audit of its loop: a LoopWatch whose windows an
/// AuditWorker takes.
///
/// One thread at a time.
class LoopJudge {
 public:
  /// @param worker outlives this; null: nothing is judged.
  LoopJudge(std::string_view valve_id, AuditWorker* worker,
            std::shared_ptr<const SeverityCatalogue> severities);

  const Verdict& Step(const Sample& sample, double period_s);
  const Verdict& Supersede() { return watch_.Supersede(); }

  /// True if valves with a model set are judged, too.
  bool beside_models() const {
    return worker_ != nullptr && worker_->beside_models();
  }

  /// See LoopWatch.
  const LoopWatch& watch() const { return watch_; }
  std::optional<Transition> End(EndReason reason) { return watch_.End(reason); }

 private:
  LoopWatch watch_;
  AuditWorker* worker_;
  std::future<std::optional<loop::Audit>> answer_;
};

}  // namespace fdi::monitor
