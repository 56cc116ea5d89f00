#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "diagnosis/decision/second_fault.h"
#include "storage/runs/runs.h"
#include "trainer/evaluation.h"

namespace fdi::trainer {

/// The name of an episode on one sample.
struct NamedVerdict {
  const Verdict* verdict;  ///< Never null; as long as the engine's.
  Layer layer{Layer::kObservers};
  bool withdrawn{false};  ///< A name that was given before counts no more.
};

/// Knowledge about a valve that its engine does not have
/// (ValveEngine::Suspect).
struct OutsideKnowledge {
  /// Given each verdict of the engine after the sink.
  std::function<NamedVerdict(const Sample&, const Verdict&)> name{};
  std::function<bool()> suspects{};      ///< Asked behind each sample.
  std::function<NameBeside()> beside{};  ///< Likewise: ValveEngine::TakeName.
  std::function<void()> begins_anew{};   ///< The monitor forgot what it knew.
};

/// Runs the monitor's own engine over a stored run as the live one met it: all
/// samples in the order of arrival, those of a superseded source left out; the
/// models adopted anew where another set began to answer, the episode ended
/// where the observers were initialised for a reason that the samples do not
/// show. The truth is kept beside it and never reaches the engine.
///
/// @throws DataError naming run and model set if sample period or flow unit
///   differ.
std::vector<Indication> Rescore(const std::shared_ptr<const ModelSet>& models,
                                const storage::StoredRun& run,
                                const VerdictSink& sink = {},
                                const OutsideKnowledge& outside = {});

}  // namespace fdi::trainer
