#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "diagnosis/decision/engine_plan.h"
#include "diagnosis/model/model_set.h"
#include "diagnosis/model/verdict.h"
#include "diagnosis/records/certainty.h"
#include "trainer/dataset.h"

namespace fdi::trainer {

/// What an operator reads beside a name.
struct Wording {
  Certainty certainty{Certainty::kNotYet};
  std::vector<int> look_alikes;  ///< That the set does not know.
};

/// One instant of an evaluated run: what was the truth, what was indicated.
struct Indication {
  double time_s{0.0};  ///< From the start of the run.
  FaultTruth truth;
  bool settled{false};            ///< Diagnosis was LIVE at or before it.
  bool detected{false};           ///< DD: an episode is open.
  std::vector<int> isolated;      ///< Faults indicated.
  bool withdrawn{false};          ///< An earlier name was taken back: unknown.
  Wording wording;                ///< Of `isolated`.
  bool second{false};             ///< Something came on top of `isolated`.
  std::vector<int> second_set{};  ///< Its faults; empty: it has no name.
};

/// The indices of the DAMADICS benchmark for one run, times in s from the start
/// of the fault; −1 where an index has no meaning.
struct RunIndices {
  std::string run_id;
  int fault{0};             ///< 0: a run without fault.
  double strength{0.0};     ///< The largest by amount; signed.
  bool detected{false};     ///< DD at the horizon, after an edge in the fault.
  double t_dt_first{-1.0};  ///< First rising edge of DD in the fault zone.
  double t_dt{-1.0};        ///< Last rising edge: permanent detection.
  double t_it_first{-1.0};  ///< The same of PID: the fault is in the set.
  double t_it{-1.0};
  double t_exact{-1.0};     ///< First instant at which the set is {fault}.
  double r_fd{-1.0};        ///< Share of [t_on, t_from) with DD.
  double r_td{-1.0};        ///< Share of [t_from, t_hor] with DD.
  double r_fi{-1.0};        ///< Share of [t_on, t_from) with a set isolated.
  double r_ti{-1.0};        ///< Share of [t_from, t_hor] with PID.
  double r_mi{-1.0};        ///< Mean number of wrong faults in [t_on, t_hor].
  double fs_d{-1.0};        ///< |strength| at t_dt.
  double fs_i{-1.0};        ///< |strength| at t_it.
  double d_acc{-1.0};       ///< 1/size of the final set if the truth is in it.
  int episodes{0};          ///< Rising edges of DD in the whole run.
  int wrong_isolations{0};  ///< Sets of one wrong fault, while one acts.
  /// Last set isolated while the fault acted, unless it was withdrawn.
  std::vector<int> final_set;
  Wording wording;  ///< Of final_set when it was named.
};

/// Computes the indices. t_from is the first instant with a fault, t_on the
/// later of the first settled instant and 600 s before t_from. Without a fault
/// t_on is the first settled instant and t_from the end of the run.
///
/// @param horizon_s t_hor from the start of the run [s]; 0 = the last instant.
RunIndices ComputeIndices(const std::vector<Indication>& indications,
                          double horizon_s = 0.0);

/// Whether the engine says that no known fault explains the episode, or has
/// nothing but findings of the floor: a name that it gave before counts no
/// more. Never of older sets, which take no name back.
bool IsWithdrawn(const ModelSet& models, const Verdict& verdict);

/// The numbers of the faults in `set`, ascending. Findings of the floor are not
/// scored, but for a loss of flow that stands beside a fault as another answer.
std::vector<int> FaultsIn(const ModelSet& models, FaultSet set);

/// What `verdict` indicates; without time and truth.
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

/// Called for every sample with what the engine said about it.
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

/// Sums over runs.
struct EvaluationSummary {
  int faulty_runs{0};
  int detected{0};
  int contained{0};         ///< Final set contains the truth.
  int exact{0};             ///< Final set is the truth.
  double mean_d_acc{-1.0};  ///< Over detected runs.
  double max_r_fd{-1.0};
  int fault_free_runs{0};
  double fault_free_hours{0.0};
  int fault_free_episodes{0};
};

EvaluationSummary Summarise(const std::vector<RunIndices>& runs,
                            const std::vector<double>& durations_s);

}  // namespace fdi::trainer
