#include "trainer/learning/labelled_episodes.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

#include "base/error.h"
#include "base/median.h"
#include "diagnosis/model/fault_catalogue.h"
#include "diagnosis/records/valve_glob.h"
#include "storage/models/models.h"
#include "storage/runs/runs.h"
#include "trainer/campaign/run_input.h"
#include "trainer/rule_text.h"
#include "trainer/scoring/rescore.h"

namespace fdi::trainer {

/// A time in ns UTC, both ends included.
struct LabelReader::TimeSpan {
  std::int64_t from_ns{std::numeric_limits<std::int64_t>::min()};
  std::int64_t to_ns{std::numeric_limits<std::int64_t>::max()};

  bool Contains(std::int64_t stamp_ns) const {
    return stamp_ns >= from_ns && stamp_ns <= to_ns;
  }
  // Drops the samples outside, and those that the engine did not accept.
  void Restrict(std::vector<storage::StoredSample>& samples) const {
    std::erase_if(samples, [this](const storage::StoredSample& stored) {
      return stored.intake != Intake::kAccepted ||
             !Contains(stored.sample.stamp_ns);
    });
  }
};

/// The samples of an episode's valve and source, and where they come from.
struct LabelReader::EpisodeSamples {
  storage::StoredRun run;  // Its info has valve, source, period and unit.
  std::string where;       // LabelledEpisode::data
};

namespace {

// A false alarm may reach back this far before its detection. The engine needs
// a part of it to settle.
constexpr std::int64_t kLeadInNs = 1'800'000'000'000;
constexpr double kSecondsPerNs = 1e-9;
// Strengths of conditions are multiples of 0.05: half a step is the same one.
constexpr double kHalfStrengthStep = 0.025;

// A label that teaches nothing; what() says why.
class Refusal : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

// Numbers of the faults isolated last.
std::vector<int> IsolatedIn(const storage::Episode& episode) {
  std::vector<int> faults;
  for (std::size_t bit = 0; bit < episode.faults.size(); ++bit) {
    if ((episode.fault_bits >> bit & 1U) != 0) {
      faults.push_back(ParseFault(episode.faults[bit]).value_or(0));
    }
  }
  return faults;
}

// The fault that the label stands for; 0 is normal operation.
int FaultMeant(const storage::Episode& episode) {
  if (*episode.label == "false") {
    return 0;
  }
  if (*episode.label != "true") {
    return RequireFault(*episode.label);
  }
  const std::vector<int> isolated = IsolatedIn(episode);
  // The name may also be a finding of the floor, which is no fault to learn
  // (0).
  if (isolated.size() != 1 || isolated.front() == 0) {
    throw Refusal(
        "label true says which fault only if exactly one was isolated, here " +
        episode.fault.value_or("none") +
        "; label it with the name of the "
        "fault");
  }
  return isolated.front();
}

// The median step in time [s]; 0 for fewer than two samples.
double PeriodOf(const std::vector<storage::StoredSample>& samples) {
  std::vector<std::int64_t> steps;
  for (std::size_t k = 1; k < samples.size(); ++k) {
    steps.push_back(samples[k].sample.stamp_ns -
                    samples[k - 1].sample.stamp_ns);
  }
  return steps.empty()
             ? 0.0
             : static_cast<double>(Median(std::move(steps))) * kSecondsPerNs;
}

// The median of the later half. In the first half the engine still searches.
double LaterMedian(const std::vector<double>& values) {
  return Median(std::vector<double>(
      values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2),
      values.end()));
}

// The largest strength of the fault in training, in the direction of `sign`.
double LargestTrained(const ModelSet& models, int fault, double sign) {
  double largest = 0.0;
  for (const Observer& observer : models.observers) {
    if (observer.fault == fault && observer.strength * sign > 0.0) {
      largest = std::max(largest, std::abs(observer.strength));
    }
  }
  return largest;
}

// The strength that the engine of `models` estimates in `run` from
// `detected_ns` on, while it detects something. It counts only if the fault
// explains the samples with a factor of T/2 at least, at a strength within
// those of the training: beyond them the observers extrapolate, and a strength
// found there would be a guess.
double EstimateStrength(const std::shared_ptr<const ModelSet>& models,
                        const storage::StoredRun& run, int fault,
                        std::int64_t detected_ns) {
  const std::string set = NameOf(*models);
  const int index = FaultIndex(*models, fault);
  if (index < 0) {
    throw Refusal(set + " does not know " + FaultName(fault));
  }
  const auto f = static_cast<std::size_t>(index);
  std::vector<double> strengths;
  std::vector<double> factors;
  // A stored episode tells the strength of what was isolated only, so the
  // engine is run again.
  Rescore(models, run, [&](const Sample& sample, const Verdict& verdict) {
    if (verdict.detected && sample.stamp_ns >= detected_ns) {
      strengths.push_back(verdict.strengths[f]);
      factors.push_back(verdict.fault_factors[f]);
    }
  });
  if (strengths.empty()) {
    throw Refusal(set + " detects nothing here");
  }
  const double strength = LaterMedian(strengths);
  const double factor = LaterMedian(factors);
  // T/2 is also where the engine stops counting a fault as a possible
  // explanation (docs/method.md).
  const double least = 0.5 * models->decision.isolation_threshold;
  if (factor < least || strength == 0.0) {
    throw Refusal(set + " gives " + FaultName(fault) + " a factor of " +
                  Digits(factor, 3) + ", needed is " + Digits(least, 3));
  }
  const double largest = LargestTrained(*models, fault, strength);
  if (std::abs(strength) > largest + kHalfStrengthStep) {
    throw Refusal(set + " estimates " + Digits(strength, 3) +
                  ", beyond what it was trained at (" + Digits(largest, 3) +
                  ")");
  }
  return strength;
}

}  // namespace

std::string SelectorOf(const storage::RunInfo& info, std::int64_t from_ns,
                       std::int64_t to_ns) {
  const auto seconds = [&](std::int64_t stamp_ns) {
    return static_cast<double>(stamp_ns - info.run.start_ns) * kSecondsPerNs;
  };
  storage::StoredRun part;
  part.info.id = info.id;
  part.selector.from_s =
      std::floor(seconds(std::max(from_ns, info.first_stamp_ns)));
  part.selector.to_s = std::ceil(seconds(std::min(to_ns, info.last_stamp_ns)) +
                                 info.run.period_s);
  return RunName(part);
}

std::string NameOf(const ModelSet& models) {
  return storage::ToString({models.name, models.version});
}

TrainingRun RunOf(const LabelledEpisode& episode, const ModelSet& parent) {
  TrainingRun run;
  run.id = episode.meaning.run.empty() ? "episode " + episode.meaning.episode_id
                                       : episode.meaning.run;
  run.period_s = parent.sample_period_s;
  run.flow_unit = parent.flow_unit;
  run.samples = episode.samples;
  return run;
}

LabelReader::LabelReader(storage::HistoryReader& history,
                         std::filesystem::path runs,
                         std::shared_ptr<const ModelSet> parent,
                         const DatasetOptions& dataset,
                         GivenStrengths strengths)
    : history_(history),
      runs_(std::move(runs)),
      parent_(std::move(parent)),
      dataset_(dataset),
      strengths_(std::move(strengths)) {}

LabelledEpisode LabelReader::Read(const storage::Episode& episode) {
  LabelledEpisode result;
  storage::TrainingEpisode& meaning = result.meaning;
  meaning.episode_id = episode.episode_id;
  meaning.valve_id = episode.valve_id;
  meaning.label = *episode.label;
  // Events are ordered, so the label that was given last remains.
  for (const storage::HistoryEntry& event : history_.Events(episode.id)) {
    if (event.kind == "LABEL") {
      meaning.labelled_by = event.who;
      meaning.labelled_ns = event.stamp_ns;
    }
  }
  try {
    // In this order: the strength can only be estimated from samples that suit
    // the engine of the parent.
    meaning.fault = FaultMeant(episode);
    EpisodeSamples all = LoadSamples(episode, SpanAround(episode));
    result.data = all.where;
    RequireSuited(all.run);
    meaning.strength =
        meaning.fault == 0 ? 0.0 : StrengthOf(episode, meaning.fault, all.run);
    result.samples =
        TakeSamples(all.run, episode, {meaning.fault, meaning.strength});
    meaning.samples = static_cast<std::int64_t>(result.samples.size());
    result.record = std::move(all.run);
  } catch (const Refusal& refusal) {
    result.refusal = refusal.what();
  }
  return result;
}

// From the lead-in, but not back into an earlier episode of the valve, to the
// clearing or whatever else ended the episode.
LabelReader::TimeSpan LabelReader::SpanAround(const storage::Episode& episode) {
  TimeSpan span;
  span.from_ns = episode.detected_ns - kLeadInNs;
  storage::EpisodeFilter earlier;
  earlier.valve_glob = GlobOf(episode.valve_id);
  earlier.until_ns = episode.detected_ns;
  for (const storage::Episode& other : history_.List(earlier)) {
    if (other.id != episode.id && other.detected_ns < episode.detected_ns) {
      // An earlier episode was not normal operation, unless it is labelled so
      // itself, and then it teaches its own samples. If it has no end, only
      // the detection is known.
      span.from_ns = std::max(span.from_ns,
                              other.ended_ns.value_or(other.detected_ns) + 1);
    }
  }
  span.to_ns =
      episode.cleared_ns.value_or(episode.ended_ns.value_or(span.to_ns));
  return span;
}

// The recorded run that has most samples in the span, or the trace of the
// episode if no run has as many.
LabelReader::EpisodeSamples LabelReader::LoadSamples(
    const storage::Episode& episode, const TimeSpan& span) {
  EpisodeSamples best;
  best.where = "trace";
  for (const TracePoint& instant : history_.Trace(episode.id)) {
    storage::StoredSample& stored = best.run.samples.emplace_back();
    stored.sample = instant.sample;
    stored.intake = instant.intake;
    stored.initialised = instant.initialised;
  }
  span.Restrict(best.run.samples);
  storage::NewRun& row = best.run.info.run;
  row.valve_id = episode.valve_id;
  row.source_id = episode.source_id;
  row.flow_unit = episode.flow_unit;
  // A trace does not say its period. The median step is not disturbed by gaps.
  row.period_s = PeriodOf(best.run.samples);
  if (!std::filesystem::exists(runs_)) {
    return best;
  }
  storage::RunStore store(runs_);
  storage::RunFilter filter;
  filter.valve_glob = GlobOf(episode.valve_id);
  for (const storage::RunInfo& info : store.List(filter)) {
    // Imported runs are evidence of earlier trainings, not recordings.
    if (info.run.source_id != episode.source_id ||
        info.run.origin == storage::RunOrigin::kImported || info.samples == 0 ||
        info.last_stamp_ns < span.from_ns || info.first_stamp_ns > span.to_ns) {
      continue;
    }
    const std::string selector = SelectorOf(info, span.from_ns, span.to_ns);
    try {
      storage::StoredRun run = store.Load(selector);
      span.Restrict(run.samples);
      // `>=`: at equal numbers the recorded run is preferred to the trace.
      if (!run.samples.empty() &&
          run.samples.size() >= best.run.samples.size()) {
        best = {std::move(run), selector};
      }
    } catch (const NotFoundError&) {
      // The run has a pause there.
    }
  }
  return best;
}

void LabelReader::RequireSuited(const storage::StoredRun& run) const {
  const storage::NewRun& row = run.info.run;
  const std::string set = NameOf(*parent_);
  if (run.samples.empty()) {
    throw Refusal("neither a run nor its trace holds a sample of it");
  }
  if (std::abs(row.period_s - parent_->sample_period_s) >
      1e-3 * parent_->sample_period_s) {
    throw Refusal("its sample period is " + Digits(row.period_s, 6) + " s, " +
                  set + " is for " + Digits(parent_->sample_period_s, 6) +
                  " s");
  }
  if (row.flow_unit != parent_->flow_unit) {
    throw Refusal("its flow is in " + std::string(FlowUnitName(row.flow_unit)) +
                  ", " + set + " is for " +
                  std::string(FlowUnitName(parent_->flow_unit)));
  }
  const SignalMask missing =
      RequiredSignals(*parent_) & static_cast<SignalMask>(~UsualSignals(run));
  for (std::size_t i = 0; i < kSignalCount; ++i) {
    const auto signal = static_cast<Signal>(i);
    if ((missing & MaskOf(signal)) != 0) {
      throw Refusal("it has no signal " + std::string(SignalName(signal)) +
                    ", which " + set + " reads");
    }
  }
}

double LabelReader::StrengthOf(const storage::Episode& episode, int fault,
                               const storage::StoredRun& run) const {
  // A strength from the user comes first, then one estimated live for this very
  // fault, and only then an estimate of the engine.
  for (const auto& [id, strength] : strengths_) {
    if (episode.episode_id.starts_with(id)) {
      return strength;
    }
  }
  if (IsolatedIn(episode) == std::vector<int>{fault} &&
      episode.strength != 0.0) {
    return episode.strength;
  }
  try {
    return EstimateStrength(parent_, run, fault, episode.detected_ns);
  } catch (const Refusal& problem) {
    throw Refusal(std::string("the strength is unknown: ") + problem.what() +
                  "; give it with --strength " + episode.episode_id +
                  "=S, S in [-1, 1] without 0, 1 being the full fault");
  }
}

std::vector<LabelledSample> LabelReader::TakeSamples(
    const storage::StoredRun& run, const storage::Episode& episode,
    const FaultTruth& truth) const {
  // A false alarm teaches all samples, with those before it. A fault teaches
  // those from the detection on only: since when it acted is not known.
  TimeSpan span;
  if (truth.fault != 0) {
    span.from_ns = episode.detected_ns;
    if (episode.cleared_ns) {
      // The valve was normal again for t_c when the episode was cleared.
      const int back =
          parent_->decision.clearing_samples + dataset_.dropped_after_step;
      span.to_ns = *episode.cleared_ns -
                   std::llround(back * parent_->sample_period_s * 1e9);
    }
  }
  storage::StoredRun part;
  part.info = run.info;
  for (storage::StoredSample stored : run.samples) {
    if (span.Contains(stored.sample.stamp_ns)) {
      stored.truth = truth;
      part.samples.push_back(stored);
    }
  }
  TrainingRun usable = ToTrainingRun(part, false);
  // One piece has to be long enough. Training cuts at gaps and drops the
  // settling after each, so many short pieces add up to nothing.
  std::size_t longest = 0;
  for (const Stretch& piece : SplitAtGaps(usable)) {
    longest = std::max(longest, piece.samples.size());
  }
  const int needed = dataset_.dropped_after_step + dataset_.shortest_stretch;
  if (longest < static_cast<std::size_t>(needed)) {
    throw Refusal("too short: " + std::to_string(longest) +
                  " usable samples in a row, needed are " +
                  std::to_string(needed));
  }
  return std::move(usable.samples);
}

}  // namespace fdi::trainer
