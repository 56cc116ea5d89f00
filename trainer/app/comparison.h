#pragma once

#include <memory>
#include <string>
#include <vector>

#include "diagnosis/model_set.h"
#include "trainer/app/evaluated_run.h"
#include "trainer/app/scored_runs.h"
#include "trainer/sign_test.h"

namespace fdi::trainer {

/// One run as two model sets see it.
struct ComparedRun {
  EvaluatedRun a;
  EvaluatedRun b;
};

/// Scores every run with both sets by the monitor's engine, on all cores, with
/// seconds by quality. @throws DataError naming run and model set if they do
/// not suit each other.
std::vector<ComparedRun> CompareRuns(const std::shared_ptr<const ModelSet>& a,
                                     const std::shared_ptr<const ModelSet>& b,
                                     const std::vector<ScoredRun>& runs,
                                     bool assume_normal);

/// In what the sets differ on a run: "detected", "delay", "isolation", "final
/// set", "wrong faults", "false alarms".
std::vector<std::string> DifferencesOf(const ComparedRun& run);

/// A figure of merit over the runs that have it for both sets.
struct ComparedMeasure {
  std::string name;
  SignTest better;  ///< Positive: runs on which b is better.

  bool enough() const { return better.decided() >= kLeastDecidedPairs; }
};

/// Of runs with truth: detected, delays, final set, wrong faults, false alarms.
std::vector<ComparedMeasure> MeasuresOf(const std::vector<ComparedRun>& runs);

/// "b is better (p = 0.0312)", "no difference shown (p = 0.29)", "too few runs
/// differ (3, needed are 6)", with the names of the sets.
std::string JudgementOf(const ComparedMeasure& measure, const std::string& a,
                        const std::string& b);

}  // namespace fdi::trainer
