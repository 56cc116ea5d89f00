#include "trainer/scoring/rescore.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <string>
#include <utility>

#include "base/error.h"
#include "base/usual_period.h"
#include "diagnosis/decision/decision.h"
#include "diagnosis/decision/look_answer.h"
#include "trainer/campaign/run_input.h"

namespace fdi::trainer {
namespace {

constexpr double kSecondsPerNs = 1e-9;

void RequireSuited(const ModelSet& models, const storage::StoredRun& run) {
  const std::string what = "run " + RunName(run);
  const std::string set =
      "model set " + models.name + "@" + std::to_string(models.version);
  const double period_s = run.info.run.period_s;
  // Recordings of earlier versions have the first step, with its jitter.
  if (std::min(std::abs(period_s - models.sample_period_s),
               std::abs(UsualPeriod(period_s) - models.sample_period_s)) >
      1e-6 * models.sample_period_s) {
    throw DataError(what + " has a sample period of " +
                    std::to_string(period_s) + " s, " + set + " was trained " +
                    "for " + std::to_string(models.sample_period_s) + " s");
  }
  if (run.info.run.flow_unit != models.flow_unit &&
      (RequiredSignals(models) & run.info.signals & MaskOf(Signal::kF)) != 0) {
    throw DataError(what + " has its flow in " +
                    std::string(FlowUnitName(run.info.run.flow_unit)) + ", " +
                    set + " was trained in " +
                    std::string(FlowUnitName(models.flow_unit)));
  }
}

// Tells whether the samples by themselves made the live engine initialise. The
// recorder stores for each sample whether the engine did; a restart of the
// monitor or an operator's command is a cause that only this mark shows.
class InitialisationWatch {
 public:
  explicit InitialisationWatch(double period_s)
      : period_ns_(std::llround(period_s * 1e9)) {}

  // True if the mark of `stored` has a cause that the samples do not show.
  bool CameFromOutside(const storage::StoredSample& stored) {
    if (OutOfOrder(stored.intake)) {
      return false;
    }
    const std::int64_t interval = stored.sample.stamp_ns - last_stamp_ns_;
    const bool explained = rejected_ || stored.model_swapped ||
                           stored.sample.present != present_ ||
                           std::abs(interval - period_ns_) > period_ns_ / 2;
    rejected_ = stored.intake != Intake::kAccepted;
    last_stamp_ns_ = stored.sample.stamp_ns;
    if (stored.initialised || first_) {
      present_ = stored.sample.present;
      first_ = false;
    }
    return stored.initialised && !explained;
  }

 private:
  std::int64_t period_ns_;
  std::int64_t last_stamp_ns_{0};
  SignalMask present_{0};
  bool first_{true};
  bool rejected_{true};  // Whatever initialises at the first is explained.
};

// A detection counts from its first abnormal sample: the engine confirms an
// episode some samples after it began and stamps it with its beginning. The
// indications since then are corrected.
void BackdateDetections(const Verdict& verdict, std::int64_t start_ns,
                        std::vector<Indication>& all) {
  for (const Transition& transition : verdict.Transitions()) {
    if (transition.kind != TransitionKind::kDetected) {
      continue;
    }
    const double since_s =
        static_cast<double>(transition.stamp_ns - start_ns) * kSecondsPerNs;
    for (std::size_t k = all.size(); k-- > 0 && all[k].time_s >= since_s;) {
      all[k].detected = true;
    }
  }
}

// Leaves out those for growth: they change no name.
void TakeLooks(Decision& decision) {
  for (const LookTask& task : decision.TakeDue()) {
    if (task.occasion == LookOccasion::kGrowth) {
      continue;
    }
    if (auto answer = TakeLook(*decision.simulation(), task)) {
      decision.Answer(task, std::move(*answer));
    }
  }
}

}  // namespace

std::vector<Indication> Rescore(
    const std::shared_ptr<const ModelSet>& models,
    const storage::StoredRun& run, const VerdictSink& sink,
    const std::shared_ptr<const LookSimulation>& simulation) {
  RequireSuited(*models, run);
  Decision decision(EngineParts(models), simulation);
  InitialisationWatch watch(run.info.run.period_s);
  std::vector<Indication> all;
  all.reserve(run.samples.size());
  std::int64_t start_ns = 0;
  for (const storage::StoredSample& stored : run.samples) {
    // Samples of a source that had been superseded never reached the live
    // engine; late ones before the first sample had nothing to be late for.
    if (stored.intake == Intake::kSuperseded ||
        (all.empty() && OutOfOrder(stored.intake))) {
      continue;
    }
    const bool came_from_outside = watch.CameFromOutside(stored);
    if (came_from_outside) {
      decision.End(EndReason::kUnknown);
      decision.ForgetNames();
    }
    if (stored.model_swapped) {
      decision.Adopt(EngineParts(models), simulation);
    }
    const Verdict& verdict = decision.Step(stored.sample);
    if (sink) {
      sink(stored.sample, decision.engine());
    }
    TakeLooks(decision);
    if (OutOfOrder(verdict.intake)) {
      continue;
    }
    start_ns = all.empty() ? stored.sample.stamp_ns : start_ns;
    Indication indication =
        IndicationOf(*models, verdict, all.empty() ? nullptr : &all.back(),
                     decision.names().now().layer);
    indication.withdrawn |=
        decision.names().overruled() && verdict.isolated == 0;
    indication.time_s =
        static_cast<double>(stored.sample.stamp_ns - start_ns) * kSecondsPerNs;
    indication.truth = TruthOf(stored);
    all.push_back(std::move(indication));
    BackdateDetections(verdict, start_ns, all);
  }
  return all;
}

}  // namespace fdi::trainer
