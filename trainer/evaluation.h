#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "diagnosis/decision/certainty.h"
#include "diagnosis/decision/engine_plan.h"
#include "diagnosis/model/model_set.h"
#include "diagnosis/model/verdict.h"
#include "trainer/dataset.h"

namespace fdi::trainer {

/// The words that an operator reads beside a name.
struct Wording {
  Certainty certainty{Certainty::kNotYet};
  std::vector<int> look_alikes;  ///< Faults that the set does not know.
};

/// One instant of an evaluated run: what was the truth, what was indicated.
struct Indication {
  double time_s{0.0};  ///< From the start of the run.
  FaultTruth truth;
  bool settled{false};            ///< Diagnosis was LIVE at or before it.
  bool detected{false};           ///< DD: an episode is open.
  std::vector<int> isolated;      ///< Faults indicated.
  bool withdrawn{false};          ///< An earlier name was taken back: unknown.
  Wording wording;                ///< The wording of `isolated`.
  bool second{false};             ///< Something came on top of `isolated`.
  std::vector<int> second_set{};  ///< Its faults; empty: it has no name.
};

/// The score of one run; times in s from the start of the fault, -1 where a
/// number has no meaning (docs/evaluation.md).
struct RunIndices {
  std::string run_id;
  int fault{0};             ///< 0: a run without fault.
  double strength{0.0};     ///< The largest by amount; signed.
  bool detected{false};     ///< DD at the horizon, after an edge in the fault.
  double t_dt_first{-1.0};  ///< First rising edge of DD in the fault zone.
  double t_dt{-1.0};        ///< Last rising edge: permanent detection.
  double t_it{-1.0};        ///< The same of PID: the fault is in the set.
  double r_fd{-1.0};        ///< Share of [t_on, t_from) with DD.
  double d_acc{-1.0};       ///< 1/size of the final set if the truth is in it.
  int episodes{0};          ///< Rising edges of DD in the whole run.
  int wrong_isolations{0};  ///< Sets of one wrong fault, while one acts.
  /// Last set isolated while the fault acted, unless it was withdrawn.
  std::vector<int> final_set;
  Wording wording;  ///< final_set's when it was named.
};

/// Computes the indices over the zones of the run.
RunIndices ComputeIndices(const std::vector<Indication>& indications,
                          double horizon_s = 0.0);

/// The instants that indices look at, as positions among the indications.
struct RunZones {
  std::size_t on{0};    ///< t_on: begins the time before the fault.
  std::size_t from{0};  ///< t_from: the first with a fault; past the end: none.
  std::size_t last{0};  ///< t_hor.
};

/// t_on is the later of the first settled instant and 600 s before t_from;
/// without a fault it is the first settled instant.
///
/// @param indications not empty.
/// @param horizon_s t_hor from the start of the run [s]; 0 = the last instant.
RunZones ZonesOf(const std::vector<Indication>& indications, double horizon_s);

/// True if the engine says that no known fault explains the episode, or has
/// nothing but findings of the floor: a name that it gave before counts no
/// more. Sets without limits of a fit take none back (JudgesFit).
bool IsWithdrawn(const ModelSet& models, const Verdict& verdict);

/// The numbers of the faults in `set`, ascending. Findings of the floor are not
/// scored, but for a loss of flow that stands beside a fault as another answer.
std::vector<int> FaultsIn(const ModelSet& models, FaultSet set);

/// The indication of `verdict`, without time and truth.
/// @param before at the sample before; null: there is none.
/// @param layer what gave the name.
Indication IndicationOf(const ModelSet& models, const Verdict& verdict,
                        const Indication* before,
                        Layer layer = Layer::kObservers);

/// The wording of the name `faults` that an episode has, as the monitor's.
///
/// @param layer what gave the name.
Wording WordingOf(const ModelSet& models, const Verdict& verdict,
                  const std::vector<int>& faults, Layer layer);

/// Called for every sample with the verdict of the engine.
using VerdictSink = std::function<void(const Sample&, const Verdict&)>;

/// Runs the monitor's own engine over a stored run. The truth is kept beside
/// it for the indices and never reaches the engine. DD holds from the stamp of
/// the detection, which is the first abnormal sample.
std::vector<Indication> ScoreRun(const std::shared_ptr<const ModelSet>& models,
                                 const TrainingRun& run,
                                 const VerdictSink& sink = {});

/// The same for many runs of one set, which is prepared only once.
std::vector<Indication> ScoreRun(const std::shared_ptr<const EnginePlan>& plan,
                                 const TrainingRun& run,
                                 const VerdictSink& sink = {});

}  // namespace fdi::trainer
