#pragma once

#include <array>
#include <memory>
#include <optional>
#include <vector>

#include "diagnosis/model/model_set.h"
#include "storage/runs/runs.h"
#include "trainer/scoring/evaluated_run.h"

namespace fdi::trainer {

/// The indications of a diagnosis in the course of one run.
struct Answer {
  std::vector<Indication> indications;
  /// Seconds by quality, which only the monitor's engine tells.
  std::optional<std::array<double, kQualityCount>> seconds{};
};

/// Follows a run as the monitor would have: by its engine and, for a set with
/// physics, by second looks that are taken at once.
///
/// @param sink called with every verdict of the engine.
/// @throws DataError as Rescore().
Answer AnswerOf(const std::shared_ptr<const ModelSet>& models,
                const storage::StoredRun& run, const VerdictSink& sink = {});

/// Scores an answer against the truth of its run. One without truth is not
/// counted unless `assume_normal`.
EvaluatedRun ScoreAnswer(const Answer& answer, const storage::StoredRun& run,
                         bool assume_normal = false, double horizon_s = 0.0);

/// Both for one run. @throws as AnswerOf().
EvaluatedRun Evaluate(const std::shared_ptr<const ModelSet>& models,
                      const storage::StoredRun& run,
                      bool assume_normal = false);

/// The same for all of them, on all cores; in their order.
std::vector<EvaluatedRun> Evaluate(
    const std::shared_ptr<const ModelSet>& models,
    const std::vector<storage::StoredRun>& runs, bool assume_normal = false);

}  // namespace fdi::trainer
