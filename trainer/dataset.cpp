#include "trainer/dataset.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <map>
#include <string>

#include "base/error.h"
#include "diagnosis/model/fault_catalogue.h"
#include "diagnosis/model/trained_signals.h"

namespace fdi::trainer {
namespace {

constexpr double kStep = 0.02;          // change of strength in one sample
constexpr double kStrengthGrid = 0.05;  // conditions are this far apart
constexpr std::array<double, 7> kBands{0.05, 0.1, 0.2, 0.35, 0.5, 0.75, 1.0};

// Fault and strength in grid steps; samples of no condition are not usable.
struct Key {
  int fault{0};
  int steps{0};
  bool usable{false};

  bool operator==(const Key&) const = default;
};

FaultTruth TruthOf(const LabelledSample& sample) {
  FaultTruth truth = sample.truth.value_or(FaultTruth{});
  if (truth.strength == 0.0) {
    truth.fault = 0;
  }
  return truth;
}

double FullStrength(const TrainingRun& run) {
  double full = 0.0;
  for (const LabelledSample& sample : run.samples) {
    full = std::max(full, std::abs(TruthOf(sample).strength));
  }
  return full;
}

int RoundedSteps(double strength) {
  const int steps = static_cast<int>(std::lround(strength / kStrengthGrid));
  return steps != 0 ? steps : (strength > 0.0 ? 1 : -1);
}

Key ConstantKey(const FaultTruth& truth) {
  if (truth.fault == 0) {
    return {0, 0, true};
  }
  return {truth.fault, RoundedSteps(truth.strength), true};
}

Key DevelopingKey(const FaultTruth& truth, double full) {
  const double share = std::abs(truth.strength) / full;
  if (share < 0.5 * kBands[0]) {
    return {};
  }
  const auto nearest =
      std::min_element(kBands.begin(), kBands.end(), [&](double a, double b) {
        return std::abs(a - share) < std::abs(b - share);
      });
  return {truth.fault,
          RoundedSteps(std::copysign(*nearest * full, truth.strength)), true};
}

// Condition of every sample; not usable right after a start or a step.
// A sample belongs to a developing fault if the strength moved by less than a
// step since the sample before, or does so to the next one; both ends of a ramp
// are thus part of it.
std::vector<Key> KeysOf(const TrainingRun& run, const DatasetOptions& options) {
  const std::size_t count = run.samples.size();
  const double full = FullStrength(run);
  std::vector<Key> keys(count);
  int dropped = options.dropped_after_step;
  for (std::size_t k = 0; k < count; ++k) {
    const FaultTruth now = TruthOf(run.samples[k]);
    const double before =
        k > 0 ? TruthOf(run.samples[k - 1]).strength : now.strength;
    const double after =
        k + 1 < count ? TruthOf(run.samples[k + 1]).strength : now.strength;
    if (std::abs(now.strength - before) >= kStep) {
      dropped = options.dropped_after_step;
    }
    const bool developing =
        (now.strength != before && std::abs(now.strength - before) < kStep) ||
        (now.strength != after && std::abs(now.strength - after) < kStep);
    const Key key = now.fault != 0 && developing ? DevelopingKey(now, full)
                                                 : ConstantKey(now);
    keys[k] = dropped > 0 ? Key{} : key;
    dropped = std::max(0, dropped - 1);
  }
  return keys;
}

// Stamps may jitter by half a period.
bool IsNext(const Sample& before, const Sample& sample, double period_s) {
  const auto period_ns = std::llround(period_s * 1e9);
  return std::abs(sample.stamp_ns - before.stamp_ns - period_ns) <=
         period_ns / 2;
}

struct Pool {
  double strength_sum{0.0};
  std::int64_t strength_count{0};
  Condition condition;
};

// By fault and strength in grid steps. The order of the map is that of the
// conditions: normal operation first, then faults by number and strength.
using Pools = std::map<std::pair<int, int>, Pool>;

void AddStretch(const TrainingRun& run, std::size_t begin, std::size_t end,
                const Key& key, const DatasetOptions& options, Pools& pools) {
  if (static_cast<int>(end - begin) < options.shortest_stretch) {
    return;
  }
  Pool& pool = pools[{key.fault, key.steps}];
  pool.condition.fault = key.fault;
  // One block at the end, not samples at random: neighbours are correlated, and
  // validation would see copies of what was fitted.
  const auto validated = static_cast<std::size_t>(
      options.validation_share * static_cast<double>(end - begin));
  Stretch training{run.id, {}};
  Stretch validation{run.id, {}};
  for (std::size_t k = begin; k < end; ++k) {
    Stretch& target = k < end - validated ? training : validation;
    target.samples.push_back(run.samples[k].sample);
    if (key.fault != 0) {
      target.strengths.push_back(TruthOf(run.samples[k]).strength);
    }
    pool.strength_sum += TruthOf(run.samples[k]).strength;
    ++pool.strength_count;
  }
  pool.condition.training.push_back(std::move(training));
  pool.condition.validation.push_back(std::move(validation));
}

void CutRun(const TrainingRun& run, const DatasetOptions& options,
            Pools& pools) {
  const std::vector<Key> keys = KeysOf(run, options);
  std::size_t begin = 0;
  for (std::size_t k = 1; k <= keys.size(); ++k) {
    const bool continues =
        k < keys.size() && keys[k] == keys[begin] &&
        IsNext(run.samples[k - 1].sample, run.samples[k].sample, run.period_s);
    if (!continues) {
      if (keys[begin].usable) {
        AddStretch(run, begin, k, keys[begin], options, pools);
      }
      begin = k;
    }
  }
}

// The range of a signal over the samples of normal operation; empty: none.
struct Range {
  double low{std::numeric_limits<double>::infinity()};
  double high{-std::numeric_limits<double>::infinity()};

  void Add(const TrainingRun& run, Signal signal) {
    for (const LabelledSample& sample : run.samples) {
      if (TruthOf(sample).fault == 0) {
        low = std::min(low, sample.sample[signal]);
        high = std::max(high, sample.sample[signal]);
      }
    }
  }
};

// A command, position or flow that is the same in all normal operation teaches
// nothing; pressures and temperatures may be steady, but not zero.
void CheckSignals(const std::vector<TrainingRun>& runs) {
  for (const Signal signal : {Signal::kCv, Signal::kP1, Signal::kP2,
                              Signal::kT1, Signal::kX, Signal::kF}) {
    if (!runs.front().samples.front().sample.Has(signal)) {
      continue;
    }
    const std::string name(SignalName(signal));
    const bool must_vary =
        signal == Signal::kCv || signal == Signal::kX || signal == Signal::kF;
    Range all;
    std::string ids;
    for (const TrainingRun& run : runs) {
      Range range;
      range.Add(run, signal);
      all.Add(run, signal);
      ids += (ids.empty() ? "" : ", ") + run.id;
      if (!must_vary && range.low == 0.0 && range.high == 0.0) {
        throw DataError("run " + run.id + ": signal " + name +
                        " is 0 in every sample; is it not measured? Leave "
                        "the column out");
      }
    }
    if (must_vary && all.low == all.high) {
      throw DataError("run " + ids + ": signal " + name + " is " +
                      std::to_string(all.low) +
                      " in every sample of normal operation; a model needs it "
                      "to vary");
    }
  }
}

// A fault that is named and leaves no condition would be missing silently.
void CheckFaults(const std::vector<TrainingRun>& runs, const Pools& pools,
                 const DatasetOptions& options) {
  for (const TrainingRun& run : runs) {
    for (const LabelledSample& sample : run.samples) {
      const int fault = TruthOf(sample).fault;
      // -1000 is below every strength in grid steps, so that this is the first
      // condition of the fault.
      const auto pool = pools.lower_bound({fault, -1000});
      if (pool == pools.end() || pool->first.first != fault) {
        throw DataError("run " + run.id + ": no stretch of " +
                        (fault == 0 ? "normal operation" : FaultName(fault)) +
                        " has " + std::to_string(options.shortest_stretch) +
                        " samples in a row, the first " +
                        std::to_string(options.dropped_after_step) +
                        " after a start or a step not counted");
      }
    }
  }
}

void CheckRuns(const std::vector<TrainingRun>& runs,
               const DatasetOptions& options) {
  Require(!runs.empty(), "no run was given");
  for (const TrainingRun& run : runs) {
    if (run.samples.empty()) {
      throw DataError("run " + run.id + " has no sample");
    }
    if (!run.samples.front().truth && !options.assume_normal) {
      throw DataError("run " + run.id +
                      " carries no truth: label it, or say --assume-normal");
    }
  }
  RequireAlike(runs);
  CheckSignals(runs);
}

// " CV P1"
std::string NamesOf(SignalMask signals) {
  std::string names;
  for (std::size_t i = 0; i < kSignalCount; ++i) {
    const auto signal = static_cast<Signal>(i);
    if ((signals & MaskOf(signal)) != 0) {
      names.append(" ").append(SignalName(signal));
    }
  }
  return names;
}

}  // namespace

void RequireAlike(const std::vector<TrainingRun>& runs) {
  const TrainingRun& first = runs.front();
  const SignalMask signals = first.samples.front().sample.present;
  for (const TrainingRun& run : runs) {
    // The period of a recording is measured, if its stream keeps it to 1e-6.
    if (std::abs(run.period_s - first.period_s) > 1e-6 * first.period_s) {
      throw DataError("run " + run.id + " has a sample period of " +
                      std::to_string(run.period_s) + " s, run " + first.id +
                      " of " + std::to_string(first.period_s) + " s");
    }
    if (run.flow_unit != first.flow_unit) {
      throw DataError("run " + run.id + " has its flow in " +
                      std::string(FlowUnitName(run.flow_unit)) + ", run " +
                      first.id + " in " +
                      std::string(FlowUnitName(first.flow_unit)));
    }
    const SignalMask own = run.samples.front().sample.present;
    if (own != signals) {
      throw DataError("run " + run.id + " has other signals than run " +
                      first.id + ":" + NamesOf(own) + " instead of" +
                      NamesOf(signals));
    }
  }
}

std::vector<Condition> BuildConditions(const std::vector<TrainingRun>& runs,
                                       const DatasetOptions& options) {
  CheckRuns(runs, options);
  Pools pools;
  for (const TrainingRun& run : runs) {
    CutRun(run, options, pools);
  }
  CheckFaults(runs, pools, options);
  std::vector<Condition> conditions;
  for (auto& [key, pool] : pools) {
    pool.condition.strength =
        pool.condition.fault == 0
            ? 0.0
            : pool.strength_sum / static_cast<double>(pool.strength_count);
    conditions.push_back(std::move(pool.condition));
  }
  if (conditions.empty() || conditions.front().fault != 0) {
    throw DataError("no run has at least " +
                    std::to_string(options.shortest_stretch) +
                    " samples of normal operation in a row");
  }
  return conditions;
}

TrainingRun AtPosition(TrainingRun run) {
  for (LabelledSample& labelled : run.samples) {
    labelled.sample = PositionAsCommand(labelled.sample);
  }
  return run;
}

std::vector<Stretch> SplitAtGaps(const TrainingRun& run) {
  std::vector<Stretch> stretches;
  for (const LabelledSample& labelled : run.samples) {
    if (stretches.empty() || !IsNext(stretches.back().samples.back(),
                                     labelled.sample, run.period_s)) {
      stretches.push_back({run.id, {}});
    }
    stretches.back().samples.push_back(labelled.sample);
  }
  return stretches;
}

Stretch WholeStretch(const Condition& condition, std::size_t i) {
  Stretch whole = condition.training[i];
  const Stretch& tail = condition.validation[i];
  whole.samples.insert(whole.samples.end(), tail.samples.begin(),
                       tail.samples.end());
  whole.strengths.insert(whole.strengths.end(), tail.strengths.begin(),
                         tail.strengths.end());
  return whole;
}

std::vector<Stretch> WholeStretches(const Condition& condition) {
  std::vector<Stretch> whole;
  for (std::size_t i = 0; i < condition.training.size(); ++i) {
    whole.push_back(WholeStretch(condition, i));
  }
  return whole;
}

std::int64_t CountSamples(const std::vector<Stretch>& stretches) {
  std::int64_t count = 0;
  for (const Stretch& stretch : stretches) {
    count += static_cast<std::int64_t>(stretch.samples.size());
  }
  return count;
}

}  // namespace fdi::trainer
