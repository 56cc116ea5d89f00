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

constexpr auto kIsDetected = [](const Indication& i) { return i.detected; };

// First and last rising edge of `holds` in [first, last], as positions; -1 if
// there is none. The sample before the zone counts, too: an alarm that stood
// when the fault came is no edge, and so no detection of it.
template <typename Predicate>
std::pair<int, int> RisingEdges(const std::vector<Indication>& all,
                                std::size_t first, std::size_t last,
                                Predicate holds) {
  std::pair<int, int> edges{-1, -1};
  for (std::size_t k = first; k <= last; ++k) {
    if (holds(all[k]) && (k == 0 || !holds(all[k - 1]))) {
      edges.second = static_cast<int>(k);
      edges.first = edges.first < 0 ? edges.second : edges.first;
    }
  }
  return edges;
}

// The names that were given in [from, last] while a fault acted. The final set
// is the last of them. It outlives the end of that name, but not its
// withdrawal.
void IndexNames(const std::vector<Indication>& all, std::size_t from,
                std::size_t last, RunIndices& result) {
  for (std::size_t k = from; k <= last; ++k) {
    const std::vector<int>& set = all[k].isolated;
    // The withdrawal comes first: a set of the same instant outlives the
    // withdrawal of an earlier one.
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
    if (set.size() == 1 && set[0] != result.fault &&
        (k == 0 || all[k - 1].isolated != set)) {
      ++result.wrong_isolations;
    }
  }
  result.d_acc = Contains(result.final_set, result.fault)
                     ? 1.0 / static_cast<double>(result.final_set.size())
                     : 0.0;
}

// The indices of [from, last], in which a fault acts.
void IndexFault(const std::vector<Indication>& all, std::size_t from,
                std::size_t last, RunIndices& result) {
  result.fault = all[from].truth.fault;
  const auto since = [&](int k) {
    return k < 0 ? -1.0
                 : all[static_cast<std::size_t>(k)].time_s - all[from].time_s;
  };
  const auto [first_dt, last_dt] = RisingEdges(all, from, last, kIsDetected);
  const int last_it = RisingEdges(all, from, last, [&](const Indication& i) {
                        return Contains(i.isolated, result.fault);
                      }).second;
  result.t_dt_first = since(first_dt);
  result.t_dt = since(last_dt);
  result.t_it = since(last_it);
  result.detected = all[last].detected && last_dt >= 0;
  IndexNames(all, from, last, result);
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

RunZones ZonesOf(const std::vector<Indication>& all, double horizon_s) {
  const std::size_t count = all.size();
  RunZones zones{count, count, count - 1};
  // Backwards, so that the first instant of each kind remains.
  for (std::size_t k = count; k-- > 0;) {
    zones.from = all[k].truth.fault != 0 ? k : zones.from;
    zones.on = all[k].settled ? k : zones.on;
    zones.last = horizon_s > 0.0 && all[k].time_s >= horizon_s ? k : zones.last;
  }
  if (zones.from == count) {
    zones.last = count - 1;
    return zones;
  }
  zones.last = std::max(zones.from, zones.last);
  while (zones.on < zones.from &&
         all[zones.on].time_s < all[zones.from].time_s - kBeforeFault) {
    ++zones.on;
  }
  return zones;
}

RunIndices ComputeIndices(const std::vector<Indication>& all,
                          double horizon_s) {
  RunIndices result;
  if (all.empty()) {
    return result;
  }
  for (std::size_t k = 0; k < all.size(); ++k) {
    result.episodes += all[k].detected && (k == 0 || !all[k - 1].detected);
    if (std::abs(all[k].truth.strength) > std::abs(result.strength)) {
      result.strength = all[k].truth.strength;
    }
  }
  const RunZones zones = ZonesOf(all, horizon_s);
  if (zones.on <
      zones.from) {  // before the fault, or the whole run without one
    const auto at = [&](std::size_t k) {
      return all.begin() + static_cast<std::ptrdiff_t>(k);
    };
    result.r_fd = static_cast<double>(std::count_if(
                      at(zones.on), at(zones.from), kIsDetected)) /
                  static_cast<double>(zones.from - zones.on);
  }
  if (zones.from < all.size()) {
    IndexFault(all, zones.from, zones.last, result);
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

}  // namespace fdi::trainer
