#include "trainer/evaluation.h"

#include <algorithm>
#include <cmath>

#include "base/text.h"
#include "diagnosis/decision/valve_engine.h"
#include "diagnosis/model/fault_catalogue.h"
#include "diagnosis/observers/fit_window.h"

namespace fdi::trainer {
namespace {

constexpr double kBeforeFault = 600.0;  // s of r_fd before the fault

int WrongFaults(const Indication& indication) {
  const int count = static_cast<int>(indication.isolated.size());
  const bool right = indication.truth.fault != 0 &&
                     Contains(indication.isolated, indication.truth.fault);
  return count - (right ? 1 : 0);
}

// The instants [first, last] that an index looks at.
struct Zone {
  std::size_t first{0};
  std::size_t last{0};
};

template <typename Predicate>
double Share(const std::vector<Indication>& all, Zone zone, Predicate holds) {
  double count = 0.0;
  for (std::size_t k = zone.first; k <= zone.last; ++k) {
    count += holds(all[k]) ? 1.0 : 0.0;
  }
  return count / static_cast<double>(zone.last - zone.first + 1);
}

// First and last rising edge of `holds` in `zone`, as indices; −1 if none.
// The sample before the zone counts, too: an alarm that stood when the fault
// came is no edge, and so no detection of it.
template <typename Predicate>
std::pair<int, int> RisingEdges(const std::vector<Indication>& all, Zone zone,
                                Predicate holds) {
  std::pair<int, int> edges{-1, -1};
  for (std::size_t k = zone.first; k <= zone.last; ++k) {
    if (holds(all[k]) && (k == 0 || !holds(all[k - 1]))) {
      edges.second = static_cast<int>(k);
      edges.first = edges.first < 0 ? edges.second : edges.first;
    }
  }
  return edges;
}

// The indices of the time in which a fault acts: `zone` is [t_from, t_hor]. The
// final set is the last one that was named in it. It outlives the end of that
// name, but not its withdrawal.
void IndexFault(const std::vector<Indication>& all, Zone zone,
                RunIndices& result) {
  const double start_s = all[zone.first].time_s;
  const auto is_detected = [](const Indication& i) { return i.detected; };
  const auto is_isolated = [&](const Indication& i) {
    return Contains(i.isolated, result.fault);
  };
  const auto since = [&](int k) {
    return k < 0 ? -1.0 : all[static_cast<std::size_t>(k)].time_s - start_s;
  };
  const auto strength = [&](int k) {
    return k < 0 ? -1.0
                 : std::abs(all[static_cast<std::size_t>(k)].truth.strength);
  };
  const auto [first_dt, last_dt] = RisingEdges(all, zone, is_detected);
  const auto [first_it, last_it] = RisingEdges(all, zone, is_isolated);
  result.t_dt_first = since(first_dt);
  result.t_dt = since(last_dt);
  result.t_it_first = since(first_it);
  result.t_it = since(last_it);
  result.fs_d = strength(last_dt);
  result.fs_i = strength(last_it);
  result.r_td = Share(all, zone, is_detected);
  result.r_ti = Share(all, zone, is_isolated);
  result.detected = all[zone.last].detected && last_dt >= 0;
  for (std::size_t k = zone.first; k <= zone.last; ++k) {
    const std::vector<int>& set = all[k].isolated;
    // In this order, a set of the same instant outlives the withdrawal of an
    // earlier one.
    if (all[k].withdrawn) {
      result.final_set.clear();
    }
    if (set.empty()) {
      if (result.final_set.empty() && all[k].detected) {
        result.wording = all[k].wording;
      }
      continue;
    }
    if (set != result.final_set) {
      result.final_set = set;
      result.wording = all[k].wording;
    }
    if (result.t_exact < 0.0 && set.size() == 1 && set[0] == result.fault) {
      result.t_exact = all[k].time_s - start_s;
    }
    if (set.size() == 1 && set[0] != result.fault &&
        (k == 0 || all[k - 1].isolated != set)) {
      ++result.wrong_isolations;
    }
  }
  result.d_acc = Contains(result.final_set, result.fault)
                     ? 1.0 / static_cast<double>(result.final_set.size())
                     : 0.0;
}

}  // namespace

std::vector<int> FaultsIn(const ModelSet& models, FaultSet set) {
  const bool named = (set & ~FindingsOf(models)) != 0;
  std::vector<int> faults;
  for (std::size_t i = 0; i < models.faults.size(); ++i) {
    const int fault = models.faults[i];
    if ((set >> i & 1U) != 0 &&
        (IsFault(fault) || (named && fault == kLowFlow))) {
      faults.push_back(fault);
    }
  }
  return faults;
}

bool IsWithdrawn(const ModelSet& models, const Verdict& verdict) {
  if (!verdict.detected || !FaultsIn(models, verdict.isolated).empty()) {
    return false;
  }
  const bool by_floor = verdict.isolated != 0;
  return (by_floor || verdict.unknown == Unknown::kOutsideKnown) &&
         JudgesFit(models);
}

Wording WordingOf(const ModelSet& models, const Verdict& verdict,
                  const std::vector<int>& faults, Layer layer) {
  if (faults.empty()) {
    const bool outside = verdict.unknown == Unknown::kOutsideKnown ||
                         IsWithdrawn(models, verdict);
    return {outside ? Certainty::kNotKnown : Certainty::kNotYet, {}};
  }
  double factor = 0.0;
  double strength = 0.0;
  for (const int fault : faults) {
    const int found = FaultIndex(models, fault);
    if (found >= 0) {
      const auto bit = static_cast<std::size_t>(found);
      factor = std::max(factor, verdict.fault_factors[bit]);
      strength = verdict.strengths[bit];
    }
  }
  const std::string name = JoinText(faults, "|", FaultName);
  const auto beside = LookAlikesBeside(
      name, layer, strength, KnownFaults(models.faults, models.observers));
  Wording wording{WithLookAlikes(CertaintyOf(name, layer, factor), beside), {}};
  for (const std::string& fault : beside) {
    wording.look_alikes.push_back(RequireFault(fault));
  }
  return wording;
}

Indication IndicationOf(const ModelSet& models, const Verdict& verdict,
                        const Indication* before, Layer layer) {
  Indication now;
  now.settled = (before != nullptr && before->settled) ||
                verdict.quality == Quality::kLive;
  now.detected = verdict.detected;
  now.isolated = FaultsIn(models, verdict.isolated);
  now.withdrawn = IsWithdrawn(models, verdict);
  now.second = verdict.second.open;
  now.second_set = FaultsIn(models, verdict.second.faults);
  // A name keeps the wording that it was given with.
  const bool stays = before != nullptr && !now.isolated.empty() &&
                     now.isolated == before->isolated;
  now.wording =
      stays ? before->wording : WordingOf(models, verdict, now.isolated, layer);
  return now;
}

RunIndices ComputeIndices(const std::vector<Indication>& all,
                          double horizon_s) {
  RunIndices result;
  if (all.empty()) {
    return result;
  }
  const std::size_t count = all.size();
  std::size_t from = count;
  std::size_t settled = count;
  std::size_t horizon = count - 1;
  // Backwards, so that the first instant of each kind remains.
  for (std::size_t k = count; k-- > 0;) {
    from = all[k].truth.fault != 0 ? k : from;
    settled = all[k].settled ? k : settled;
    horizon = horizon_s > 0.0 && all[k].time_s >= horizon_s ? k : horizon;
  }
  result.episodes = 0;
  for (std::size_t k = 0; k < count; ++k) {
    result.episodes += all[k].detected && (k == 0 || !all[k - 1].detected);
    if (std::abs(all[k].truth.strength) > std::abs(result.strength)) {
      result.strength = all[k].truth.strength;
    }
  }
  const auto is_detected = [](const Indication& i) { return i.detected; };
  const auto any_set = [](const Indication& i) { return !i.isolated.empty(); };
  const double t_on =
      from < count ? all[from].time_s - kBeforeFault : all.front().time_s;
  std::size_t on = settled;
  while (on < from && all[on].time_s < t_on) {
    ++on;
  }
  if (on < from) {  // before the fault, or the whole run without one
    const Zone before{on, from - 1};
    result.r_fd = Share(all, before, is_detected);
    result.r_fi = Share(all, before, any_set);
  }
  if (from < count) {
    result.fault = all[from].truth.fault;
    IndexFault(all, {from, std::max(from, horizon)}, result);
  }
  const std::size_t last = from < count ? std::max(from, horizon) : count - 1;
  if (on < count && on <= last) {
    double wrong = 0.0;
    for (std::size_t k = on; k <= last; ++k) {
      wrong += WrongFaults(all[k]);
    }
    result.r_mi = wrong / static_cast<double>(last - on + 1);
  }
  return result;
}

std::vector<Indication> ScoreRun(const std::shared_ptr<const ModelSet>& models,
                                 const TrainingRun& run,
                                 const VerdictSink& sink) {
  return ScoreRun(std::make_shared<const EnginePlan>(models), run, sink);
}

std::vector<Indication> ScoreRun(const std::shared_ptr<const EnginePlan>& plan,
                                 const TrainingRun& run,
                                 const VerdictSink& sink) {
  const ModelSet& models = plan->models();
  ValveEngine engine(
      EngineParts(plan, std::make_shared<ObserverOutputs>(*plan->observers())));
  std::vector<Indication> all;
  all.reserve(run.samples.size());
  for (const LabelledSample& labelled : run.samples) {
    const Verdict& verdict = engine.Step(labelled.sample);
    if (sink) {
      sink(labelled.sample, verdict);
    }
    Indication indication =
        IndicationOf(models, verdict, all.empty() ? nullptr : &all.back());
    indication.time_s =
        static_cast<double>(labelled.sample.stamp_ns -
                            run.samples.front().sample.stamp_ns) *
        1e-9;
    indication.truth = labelled.truth.value_or(FaultTruth{});
    // A ramp begins at strength 0, where the valve is still healthy.
    if (indication.truth.strength == 0.0) {
      indication.truth.fault = 0;
    }
    all.push_back(std::move(indication));
    // A detection takes several abnormal samples and carries the stamp of the
    // first. The samples since then are already stored, hence the way back.
    for (const Transition& transition : verdict.Transitions()) {
      if (transition.kind != TransitionKind::kDetected) {
        continue;
      }
      for (std::size_t k = all.size();
           k-- > 0 && run.samples[k].sample.stamp_ns >= transition.stamp_ns;) {
        all[k].detected = true;
      }
    }
  }
  return all;
}

EvaluationSummary Summarise(const std::vector<RunIndices>& runs,
                            const std::vector<double>& durations_s) {
  EvaluationSummary summary;
  double accuracy = 0.0;
  for (std::size_t i = 0; i < runs.size(); ++i) {
    const RunIndices& run = runs[i];
    if (run.fault == 0) {
      ++summary.fault_free_runs;
      summary.fault_free_hours += durations_s[i] / 3600.0;
      summary.fault_free_episodes += run.episodes;
      continue;
    }
    ++summary.faulty_runs;
    summary.max_r_fd = std::max(summary.max_r_fd, run.r_fd);
    summary.contained += run.d_acc > 0.0;
    summary.exact += run.d_acc == 1.0;
    if (run.detected) {
      ++summary.detected;
      accuracy += run.d_acc;
    }
  }
  if (summary.detected > 0) {
    summary.mean_d_acc = accuracy / summary.detected;
  }
  return summary;
}

}  // namespace fdi::trainer
