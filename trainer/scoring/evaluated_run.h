#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "diagnosis/model/quality_count.h"
#include "trainer/evaluation.h"

namespace fdi::trainer {

/// One run and the diagnosis of it.
struct EvaluatedRun {
  RunIndices indices;
  bool has_truth{true};
  double duration_s{0.0};     ///< Gaps do not count.
  std::vector<int> last_set;  ///< Last set isolated in the whole run.
  Wording last_wording;       ///< last_set's.
  double second_t{-1.0};      ///< Last time that something came on top; −1.
  std::vector<int> second_set{};  ///< Its last name.
  /// Seconds by quality; empty where a detector gives none.
  std::optional<std::array<double, kQualityCount>> seconds{};
};

/// "f3|f6"; empty for the empty set.
std::string SetText(const std::vector<int>& set);
/// "f3|f6, f1|f10"; "none" if there is no group.
std::string GroupsText(const ModelSet& models);
/// "f8, f14"; "none".
std::string FaultsText(const std::vector<int>& faults);

/// DD at the horizon under a fault, an episode at all without one.
bool IsDetected(const EvaluatedRun& run);

/// The wording of the answer that the run ended with; nullptr if there was
/// none.
const Wording* AnswerWording(const EvaluatedRun& run);

/// The set that a run ended with: under the fault, or at all without one.
const std::vector<int>& FinalSet(const EvaluatedRun& run);

/// Answers of one certainty.
struct AnswerCount {
  int answers{0};
  int right{0};  ///< The set, or a look-alike beside it, is the fault.
};

/// Sums over the runs that have a truth.
struct EvaluationFigures {
  int faulty_runs{0};
  int detected{0};
  int contained{0};         ///< Final set contains the truth.
  int exact{0};             ///< Final set is the truth.
  int wrong_isolations{0};  ///< In all runs.
  int fault_free_runs{0};
  double fault_free_hours{0.0};
  int fault_free_episodes{0};
  int without_truth{0};
  std::array<AnswerCount, 5> by_certainty{};  ///< Indexed by Certainty.
};

EvaluationFigures FiguresOf(const std::vector<EvaluatedRun>& runs);

}  // namespace fdi::trainer
