#pragma once

#include <memory>
#include <vector>

#include "report/report.h"
#include "trainer/scoring/evaluate.h"

namespace fdi::trainer {

/// Two model sets on the same runs, which are parallel.
struct Comparison {
  std::shared_ptr<const ModelSet> a;
  std::shared_ptr<const ModelSet> b;
  std::vector<EvaluatedRun> runs_of_a;
  std::vector<EvaluatedRun> runs_of_b;
};

/// Scores every run with both sets. @throws DataError naming run and model set
/// if they do not suit each other.
Comparison Compare(const std::shared_ptr<const ModelSet>& a,
                   const std::shared_ptr<const ModelSet>& b,
                   const std::vector<storage::StoredRun>& runs,
                   bool assume_normal = false);

/// Runs with what the sets differ in ("detected", "delay", "isolation", "final
/// set", "wrong faults", "false alarms"), the figures of both sets, and figures
/// of merit run by run with a sign test over the runs that have a truth.
/// @param all Also lists runs on which both are alike.
report::Report ComparisonReport(const Comparison& comparison, bool all);

}  // namespace fdi::trainer
