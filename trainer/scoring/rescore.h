#pragma once

#include <memory>
#include <vector>

#include "diagnosis/decision/look.h"
#include "storage/runs/runs.h"
#include "trainer/evaluation.h"

namespace fdi::trainer {

/// Runs the monitor's own decision over a stored run as the live one met it:
/// all samples in the order of arrival, those of a superseded source left out;
/// new models adopted where another set began to answer, the episode ended
/// where the observers were initialised for a reason that the samples do not
/// show. Looks are taken at once. The truth is kept beside it and never reaches
/// the decision.
///
/// @param sink is called with the verdicts of the engine itself.
/// @param simulation null: no looks are taken.
/// @throws DataError naming run and model set if sample period or flow unit
///   differ.
std::vector<Indication> Rescore(
    const std::shared_ptr<const ModelSet>& models,
    const storage::StoredRun& run, const VerdictSink& sink = {},
    const std::shared_ptr<const LookSimulation>& simulation = nullptr);

}  // namespace fdi::trainer
