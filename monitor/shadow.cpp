#include "monitor/shadow.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/printable.h"
#include "base/time_units.h"
#include "diagnosis/model/fault_catalogue.h"
#include "diagnosis/records/valve_glob.h"

namespace fdi::monitor {
namespace {

constexpr std::array<std::string_view, kShadowFitCount> kFitNames = {
    "compared", "unassigned", "same_set", "signals", "unit", "period"};

// Bit n stands for the n-th of kFaultsAndFindings, whatever its place in the
// set.
std::uint64_t NumbersOf(const ModelSet& models, FaultSet faults) {
  static_assert(kFaultsAndFindings.size() <= 64);
  std::uint64_t numbers = 0;
  for (std::size_t bit = 0; faults != 0; ++bit, faults >>= 1U) {
    if ((faults & 1U) != 0) {
      numbers |= std::uint64_t{1}
                 << (std::ranges::find(kFaultsAndFindings, models.faults[bit]) -
                     kFaultsAndFindings.begin());
    }
  }
  return numbers;
}

bool Judged(const Verdict& verdict) {
  return verdict.intake == Intake::kAccepted &&
         verdict.quality == Quality::kLive;
}

ShadowAnswer AnswerOf(const Verdict& verdict, const ModelSet& models) {
  return {verdict.state, verdict.isolated != 0
                             ? FaultSetName(models, verdict.isolated)
                             : std::string()};
}

}  // namespace

std::string_view ShadowFitName(ShadowFit fit) {
  return kFitNames[static_cast<std::size_t>(fit)];
}

ShadowValve::ShadowValve(std::string valve_id, const EngineParts& parts,
                         const ShadowLimits& limits, ShadowCounts& counts)
    : valve_id_(std::move(valve_id)),
      parts_(parts),
      candidate_(&parts_.plan->models()),
      limits_(limits),
      counts_(counts) {
  ++counts_.valves[static_cast<std::size_t>(fit_)];
}

ShadowFit ShadowValve::FitOf(const Sample& sample,
                             const ModelSet* active) const {
  if (active == nullptr) {
    return ShadowFit::kNoActive;
  }
  if (active->content_hash == candidate_->content_hash) {
    return ShadowFit::kSameSet;
  }
  const SignalMask required = parts_.plan->required();
  if ((required & static_cast<SignalMask>(~sample.present)) != 0) {
    return ShadowFit::kSignals;
  }
  if ((required & MaskOf(Signal::kF)) != 0 &&
      sample.flow_unit != candidate_->flow_unit) {
    return ShadowFit::kUnit;
  }
  if (std::abs(active->sample_period_s - candidate_->sample_period_s) >
      1e-6 * candidate_->sample_period_s) {
    return ShadowFit::kPeriod;
  }
  return ShadowFit::kCompared;
}

void ShadowValve::SetFit(ShadowFit fit) {
  if (fit == fit_) {
    return;
  }
  --counts_.valves[static_cast<std::size_t>(fit_)];
  fit_ = fit;
  ++counts_.valves[static_cast<std::size_t>(fit_)];
}

std::optional<ShadowOutcome> ShadowValve::Step(const Sample& sample,
                                               const ValveOutcome& active) {
  // What the active engine ignored, the candidate does not get either, so that
  // no difference comes from the input.
  if (OutOfOrder(active.observed().intake)) {
    return std::nullopt;
  }
  SetFit(FitOf(sample, active.models));
  if (fit_ != ShadowFit::kCompared) {
    Close();
    return std::nullopt;
  }
  // Only now, because an engine is the cost of a comparison: a valve that the
  // candidate does not fit has none.
  if (!engine_) {
    engine_.emplace(parts_);
  }
  // As for the active engine, accumulators belong to one source. Those of
  // another one are dropped for good.
  if (saved_ && saved_->source_id == sample.source_id) {
    engine_->Restore(saved_->bytes);
  }
  saved_.reset();
  // A stretch names the active set, so a new set begins a new stretch.
  if (active.model_swapped) {
    Close();
  }
  // The active engine's episode is ended by the clock of the monitor. The
  // candidate has no clock and measures the silence afterwards, by stamps.
  if (seen_ && sample.stamp_ns - stamp_ns_ > limits_.silence_ns) {
    engine_->EndEpisode(EndReason::kStaleTimeout);
  }
  seen_ = true;
  stamp_ns_ = sample.stamp_ns;
  source_id_ = sample.source_id;
  engine_->HoldIsolation(active.isolation_held);
  const Verdict& candidate = engine_->Step(sample);
  if (!Judged(active.observed()) || !Judged(candidate)) {
    Close();
    ++counts_.samples[static_cast<std::size_t>(ShadowOutcome::kNotJudged)];
    return ShadowOutcome::kNotJudged;
  }
  Compare(active.observed(), *active.models);
  const auto outcome =
      open_ ? ShadowOutcome::kDiffered : ShadowOutcome::kAgreed;
  ++counts_.samples[static_cast<std::size_t>(outcome)];
  return outcome;
}

void ShadowValve::Compare(const Verdict& active, const ModelSet& models) {
  const Verdict& candidate = engine_->verdict();
  const std::uint64_t a = NumbersOf(models, active.isolated);
  const std::uint64_t c = NumbersOf(*candidate_, candidate.isolated);
  if (active.state == candidate.state && a == c) {
    Close();
    return;
  }
  if (open_ && (open_->active_faults != a || open_->candidate_faults != c ||
                open_->difference.active.state != active.state ||
                open_->difference.candidate.state != candidate.state)) {
    Close();
  }
  if (!open_) {
    Begin(active, models);
    open_->active_faults = a;
    open_->candidate_faults = c;
  }
  Extend(active);
}

void ShadowValve::Begin(const Verdict& active, const ModelSet& models) {
  open_ = Stretch{};
  ShadowDifference& difference = open_->difference;
  difference.valve_id = valve_id_;
  difference.source_id = active.source_id;
  difference.from_ns = active.stamp_ns;
  difference.active_set = NameOf(models);
  difference.active_hash = models.content_hash;
  difference.active = AnswerOf(active, models);
  difference.candidate_set = NameOf(*candidate_);
  difference.candidate_hash = candidate_->content_hash;
  difference.candidate = AnswerOf(engine_->verdict(), *candidate_);
}

void ShadowValve::Extend(const Verdict& active) {
  open_->difference.to_ns = active.stamp_ns;
  ++open_->difference.samples;
  open_->changed = true;
  // A stretch is counted once, when it is long enough, by the hour in which it
  // began. The limit per hour keeps a candidate that flickers on one valve from
  // filling the history.
  if (open_->counted || open_->difference.samples < limits_.min_samples) {
    return;
  }
  open_->counted = true;
  const std::int64_t hour = open_->difference.from_ns / kNsPerHour;
  in_hour_ = hour == hour_ ? in_hour_ + 1 : 1;
  hour_ = hour;
  open_->recorded = in_hour_ <= limits_.max_per_hour;
  ++(open_->recorded ? counts_.recorded : counts_.left_out);
}

void ShadowValve::Close() {
  // The last checkpoint has stored an unchanged stretch in full.
  if (open_ && open_->recorded && open_->changed) {
    closed_.push_back(std::move(open_->difference));
  }
  open_.reset();
}

void ShadowValve::EndStream() {
  Close();
  if (engine_) {
    engine_->EndEpisode(EndReason::kStreamEnded);
  }
}

void ShadowValve::TakeCheckpoint(Checkpoint& checkpoint) {
  for (ShadowDifference& difference : std::exchange(closed_, {})) {
    checkpoint.shadow.push_back(std::move(difference));
  }
  // An open stretch is stored now and stored again as it grows: the later
  // record replaces the earlier one, which has the same valve, source and first
  // stamp.
  if (open_ && open_->recorded && std::exchange(open_->changed, false)) {
    checkpoint.shadow.push_back(open_->difference);
  }
  if (engine_ && fit_ == ShadowFit::kCompared) {
    checkpoint.shadow_accumulators.push_back({valve_id_, source_id_,
                                              candidate_->content_hash,
                                              stamp_ns_, engine_->Save()});
  }
}

ShadowBank::ShadowBank(ShadowOptions options, ThrottledLog& log)
    : options_(std::move(options)), log_(log), parts_(options_.candidate) {}

void ShadowBank::Restore(std::vector<Accumulator> accumulators) {
  for (Accumulator& accumulator : accumulators) {
    if (accumulator.model_hash == options_.candidate->content_hash) {
      saved_[accumulator.valve_id] = std::move(accumulator);
    }
  }
}

ShadowValve* ShadowBank::At(const std::string& valve_id) {
  const auto [place, added] = valves_.try_emplace(valve_id);
  if (added && GlobMatches(options_.valve_glob, valve_id)) {
    place->second = std::make_unique<ShadowValve>(valve_id, parts_,
                                                  options_.limits, counts_);
    if (auto saved = saved_.extract(valve_id)) {
      place->second->Resume(std::move(saved.mapped()));
    }
  }
  return place->second.get();
}

void ShadowBank::OnVerdict(const std::string& valve_id, const Sample& sample,
                           const ValveOutcome& active) {
  ShadowValve* const valve = At(valve_id);
  if (valve == nullptr) {
    return;
  }
  const ShadowFit before = valve->fit();
  valve->Step(sample, active);
  if (valve->fit() != before && valve->fit() != ShadowFit::kCompared) {
    log_.Report(LogId::kShadow, "shadow_not_compared", [&] {
      return "valve=" + LogValue(valve_id) +
             " reason=" + std::string(ShadowFitName(valve->fit())) +
             " candidate=" + NameOf(*options_.candidate);
    });
  }
}

void ShadowBank::OnSilence(const std::string& valve_id, Silence silence) {
  ShadowValve* const valve = At(valve_id);
  if (valve != nullptr && silence == Silence::kEnded) {
    valve->EndStream();
  }
}

void ShadowBank::OnRemoved(const std::string& valve_id, Checkpoint& last) {
  if (ShadowValve* const valve = At(valve_id)) {
    valve->TakeCheckpoint(last);
    --counts_.valves[static_cast<std::size_t>(valve->fit())];
  }
  valves_.erase(valve_id);
}

// Stretches are bounded per hour and valve, so that none is urgent.
void ShadowBank::TakeCheckpoint(Checkpoint& checkpoint, bool urgent) {
  for (const auto& [valve_id, valve] : valves_) {
    if (valve && !urgent) {
      valve->TakeCheckpoint(checkpoint);
    }
  }
}

}  // namespace fdi::monitor
