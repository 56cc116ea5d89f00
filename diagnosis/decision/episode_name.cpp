#include "diagnosis/decision/episode_name.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "diagnosis/decision/look_answer.h"
#include "diagnosis/decision/rules.h"

namespace fdi {
namespace {

// Four looks are due up to kLastLookAge and the fifth at twice that. Where none
// has had an answer that counts by then, looks fail or say nothing, and there
// is no reason to expect better.
constexpr std::int64_t kLookPatience = 2 * kLastLookAge;

FaultSet SetOf(const std::vector<NamedFault>& faults) {
  FaultSet set = 0;
  for (const NamedFault& fault : faults) {
    set |= FaultSet{1} << fault.bit;
  }
  return set;
}

EpisodeName::Look LookOf(const LookAnswer& answer,
                         const std::vector<int>& names,
                         const ModelSet& models) {
  EpisodeName::Look look;
  look.outside = answer.outcome == LookOutcome::kNoneFits;
  for (const Explanation& e : answer.faults) {
    const int index = FaultIndex(models, e.fault);
    if (index >= 0 && std::ranges::count(names, e.fault) > 0) {
      look.faults.push_back(
          {static_cast<std::size_t>(index), {e.strength, e.lowest, e.highest}});
    }
  }
  return look;
}

}  // namespace

std::optional<EpisodeName::Look> LookThatCounts(const Verdict& engine,
                                                const ModelSet& models,
                                                const LookAnswer* answer) {
  const auto names =
      answer != nullptr ? NamesBeside(engine, models, *answer) : std::nullopt;
  return names ? std::optional(LookOf(*answer, *names, models)) : std::nullopt;
}

std::optional<EpisodeName::Look> SecondThatCounts(const Verdict& engine,
                                                  const ModelSet& models,
                                                  const LookAnswer* answer) {
  const auto names = answer != nullptr
                         ? NamesOf(*answer, engine.second.faults != 0)
                         : std::nullopt;
  return names ? std::optional(LookOf(*answer, *names, models)) : std::nullopt;
}

EpisodeName::EpisodeName(std::shared_ptr<const ModelSet> models,
                         std::shared_ptr<const SeverityCatalogue> severities)
    : models_(std::move(models)),
      severities_(std::move(severities)),
      findings_(FindingsOf(*models_)),
      look_patience_(std::llround(
          static_cast<double>(SlownessOf(models_->sample_period_s) *
                              kLookPatience) /
          (models_->sample_period_s * kNsPerSecond))) {
  Reset();
}

void EpisodeName::Inherit(const OpenEpisode* episode) {
  if (episode == nullptr) {
    inherited_.reset();
  } else {
    inherited_ = *episode;
  }
  waited_ = 0;
}

const Verdict& EpisodeName::Step(const Inputs& inputs) {
  // Usually there is no episode, and the verdict of 2.5 kB is not copied.
  if (!open_ && inputs.engine.transition_count == 0) {
    current_ = &inputs.engine;
    return *current_;
  }
  current_ = &verdict_;
  verdict_ = inputs.engine;
  verdict_.transition_count = 0;
  // In order: from a new source, one sample ends an episode and opens another.
  for (Transition transition : inputs.engine.Transitions()) {
    // Skips the isolations of the engine: Announce() reports those of the name.
    if (IsIsolation(transition.kind)) {
      continue;
    }
    detection_ns_ = transition.detection_stamp_ns;
    if (transition.kind == TransitionKind::kDetected) {
      Begin();
      transition.severity = now_.severity;
    } else if (open_) {
      WriteName(transition);
    }
    verdict_
        .transitions[static_cast<std::size_t>(verdict_.transition_count++)] =
        transition;
    if (transition.kind == TransitionKind::kClosed) {
      Reset();
    }
  }
  // A sample out of order must not date a change of the name: that comes with
  // the next one.
  if (open_ && !OutOfOrder(inputs.engine.intake)) {
    ++waited_;
    const Choice choice = Choose(inputs);
    now_.unknown = choice.unknown;
    now_.source = choice.source;
    FollowLook(inputs);
    if (choice.faults != now_.faults) {
      Rename(choice, inputs);
    }
    FollowSecond(inputs);
  }
  if (open_) {
    WriteVerdict();
  }
  return verdict_;
}

// As the last look has it; while something may be on top, none speaks.
void EpisodeName::FollowLook(const Inputs& inputs) {
  const SecondFault& second = inputs.engine.second;
  if (second.open || second.doubt) {
    return;
  }
  if (now_.source != NameSource::kLook) {
    beside_ = {};
  } else if (inputs.look && !inputs.look->faults.empty()) {
    const std::vector<NamedFault>& faults = inputs.look->faults;
    beside_ = {SetOf(faults)};
    for (std::size_t i = 0; i < faults.size() && i < NameBeside::kMost; ++i) {
      beside_.likely[i] = {faults[i].bit, faults[i].estimate.strength};
    }
  }
}

// The engine knows nothing on top of a name that is not its own.
// A look that counts is the better judge of a second fault: observers know each
// fault by itself, the physics simulates both at once.
void EpisodeName::FollowSecond(const Inputs& inputs) {
  SecondFault& second = verdict_.second;
  if ((now_.faults & second.standing) == 0) {
    second = {};
  }
  if (now_.source == NameSource::kRestart && inherited_ && !second.open) {
    second = inherited_->second;  // It stands as long as that name does.
  }
  if (second.open && inputs.on_top) {
    second.faults = SetOf(inputs.on_top->faults);
    second.strength = second.faults != 0
                          ? inputs.on_top->faults.front().estimate.strength
                          : 0.0;
  }
  if (second.open != second_.open || second.faults != second_.faults) {
    Announce(TransitionKind::kSecond);
  }
  second_ = second;
}

void EpisodeName::Begin() {
  const std::optional<OpenEpisode> inherited = std::move(inherited_);
  Reset();
  inherited_ = inherited;
  second_ = inherited_ ? inherited_->second : SecondFault{};
  open_ = true;
  named_ = inherited_ && inherited_->isolated;
}

// The first source that says something is the name.
EpisodeName::Choice EpisodeName::Choose(const Inputs& inputs) {
  for (const Rule source : kRulesOf<Stage::kSource>) {
    if (!Acts(source)) {
      continue;
    }
    if (const auto choice = SaidBy(source, inputs)) {
      return *choice;
    }
  }
  return OfObservers(inputs);
}

std::optional<EpisodeName::Choice> EpisodeName::SaidBy(Rule source,
                                                       const Inputs& inputs) {
  switch (source) {
    case Rule::kSecondStands:
      // Whatever a look at both of them says.
      if ((now_.faults & inputs.engine.second.standing) == 0) {
        return std::nullopt;
      }
      return Choice{now_.faults, Unknown::kNone, now_.source, now_.layer};
    case Rule::kLook:
      return OfLook(inputs);
    case Rule::kInherited:
      if (!InheritedStands(inputs)) {
        inherited_.reset();
        return std::nullopt;
      }
      return Choice{
          inherited_->faults,
          inherited_->faults != 0 ? Unknown::kNone : Unknown::kTooEarly,
          NameSource::kRestart, inherited_->layer};
    default:
      return std::nullopt;
  }
}

std::optional<EpisodeName::Choice> EpisodeName::OfLook(const Inputs& inputs) {
  if (!inputs.look || TakesTwoForOne(SetOf(inputs.look->faults))) {
    return std::nullopt;
  }
  inherited_.reset();
  const FaultSet faults = SetOf(inputs.look->faults);
  return Choice{faults,
                faults != 0            ? Unknown::kNone
                : inputs.look->outside ? Unknown::kOutsideKnown
                                       : Unknown::kTooEarly,
                NameSource::kLook, Layer::kPhysics};
}

EpisodeName::Choice EpisodeName::OfObservers(const Inputs& inputs) const {
  const FaultSet faults = inputs.engine.isolated;
  if (faults == 0) {
    return {0, inputs.engine.unknown, NameSource::kNone, Layer::kObservers};
  }
  const bool floor = (faults & ~findings_) == 0;
  return {faults, Unknown::kNone,
          floor ? NameSource::kFloor : NameSource::kObservers,
          Layer::kObservers};
}

bool EpisodeName::InheritedStands(const Inputs& inputs) const {
  if (!inherited_ || !inherited_->isolated) {
    return false;
  }
  if (inherited_->layer == Layer::kPhysics && inputs.can_look &&
      waited_ <= look_patience_) {
    return true;
  }
  const FaultSet observed = inputs.engine.isolated;
  const bool finding = observed != 0 && (observed & ~findings_) == 0;
  return observed == 0 || (finding && (inherited_->faults & ~findings_) != 0) ||
         TakesTwoForOne(observed);
}

// The second fault has to be found again; until then both faults together may
// look like either of them, at another strength, like a third one or none.
bool EpisodeName::TakesTwoForOne(FaultSet faults) const {
  if (!inherited_ || !inherited_->second.open) {
    return false;
  }
  return faults == 0 || (faults & ~inherited_->faults) != 0;
}

void EpisodeName::Rename(const Choice& choice, const Inputs& inputs) {
  now_.faults = choice.faults;
  now_.layer = choice.layer;
  Estimates(inputs);
  now_.severity =
      now_.estimates.empty() ? SeverityAt(BandsOf(0), 0.0) : Severity::kLow;
  for (NamedFault& named : now_.estimates) {
    named.severity = SeverityAt(BandsOf(models_->faults[named.bit]),
                                named.estimate.strength);
    now_.severity = std::max(now_.severity, named.severity);
  }
  // The session that an inherited name comes from has announced it.
  if (choice.source == NameSource::kRestart) {
    announced_ = inherited_->severity.value_or(now_.severity);
    now_.severity = announced_;
    for (NamedFault& named : now_.estimates) {
      named.severity = std::min(named.severity, announced_);
    }
    if (!now_.estimates.empty()) {
      now_.estimates.front().severity = announced_;
    }
  } else {
    Announce(named_ ? TransitionKind::kReisolated : TransitionKind::kIsolated);
  }
  named_ = true;
}

// A new name has the strengths that the look found, what the earlier session
// knew, or else what the observers estimate, likeliest first.
void EpisodeName::Estimates(const Inputs& inputs) {
  now_.estimates.clear();
  if (now_.source == NameSource::kLook) {
    now_.estimates = inputs.look->faults;
    return;
  }
  const Verdict& engine = inputs.engine;
  std::vector<double> factors = {engine.fault_factors.begin(),
                                 engine.fault_factors.end()};
  for (std::size_t bit = 0; bit < models_->faults.size(); ++bit) {
    if (!Has(now_.faults, bit)) {
      continue;
    }
    double strength = engine.strengths[bit];
    if (now_.source == NameSource::kRestart) {
      const auto& before = inherited_->candidates;
      const auto known = std::ranges::find(before, models_->faults[bit],
                                           &FaultCandidate::fault);
      // As of the last point of that session, with its likeliest fault first.
      if (known != before.end()) {
        strength = known->strength;
        factors[bit] = static_cast<double>(before.end() - known);
      }
    }
    now_.estimates.push_back({bit, {strength, strength, strength}});
  }
  std::ranges::stable_sort(now_.estimates, [&](const auto& a, const auto& b) {
    return factors[a.bit] > factors[b.bit];
  });
}

const SeverityBands& EpisodeName::BandsOf(int fault) const {
  static const SeverityBands kNone;
  const auto found = severities_->find(fault);
  return found == severities_->end() ? kNone : found->second;
}

void EpisodeName::Follow(std::span<StrengthPoint> points) {
  if (!open_) {
    return;
  }
  for (NamedFault& named : now_.estimates) {
    const int fault = models_->faults[named.bit];
    for (const StrengthPoint& point : points) {
      if (point.fault == fault) {
        named.estimate = {point.strength, point.lowest, point.highest};
        named.severity =
            SeverityNow(BandsOf(fault), named.severity, named.estimate);
      }
    }
  }
  if (now_.estimates.empty()) {
    return;
  }
  now_.severity =
      std::ranges::max(now_.estimates, {}, &NamedFault::severity).severity;
  const int first = models_->faults[now_.estimates.front().bit];
  for (StrengthPoint& point : points) {
    if (point.fault == first) {
      point.severity = now_.severity;
    }
  }
  if (now_.severity > announced_) {
    Announce(TransitionKind::kChanged);
  }
  WriteVerdict();
}

void EpisodeName::Announce(TransitionKind kind) {
  Transition transition;
  transition.kind = kind;
  transition.stamp_ns = verdict_.stamp_ns;
  transition.detection_stamp_ns = detection_ns_;
  transition.unknown = now_.unknown;
  WriteName(transition);
  announced_ = now_.severity;
  verdict_.transitions[static_cast<std::size_t>(verdict_.transition_count++)] =
      transition;
}

// The factor is the largest of the name, or else of any fault.
void EpisodeName::WriteName(Transition& transition) const {
  transition.faults = now_.faults;
  transition.unknown = now_.faults != 0 ? Unknown::kNone : transition.unknown;
  transition.layer = now_.layer;
  transition.severity = now_.severity;
  transition.second = verdict_.second;
  transition.drift = verdict_.drift;
  transition.factor = 0.0;
  for (std::size_t i = 0; i < models_->faults.size(); ++i) {
    if (now_.faults == 0 || Has(now_.faults, i)) {
      transition.factor =
          std::max(transition.factor, verdict_.fault_factors[i]);
    }
  }
  const Estimate strength = now_.strength();
  transition.strength = strength.strength;
  transition.lowest = strength.lowest;
  transition.highest = strength.highest;
}

void EpisodeName::WriteVerdict() {
  verdict_.isolated = now_.faults;
  verdict_.state = now_.faults != 0 ? State::kIsolated : State::kDetected;
  verdict_.unknown = now_.faults != 0 ? Unknown::kNone : now_.unknown;
  for (const NamedFault& named : now_.estimates) {
    verdict_.strengths[named.bit] = named.estimate.strength;
  }
}

Transition EpisodeName::End(Transition closed) {
  if (open_) {
    WriteName(closed);
  }
  Reset();
  return closed;
}

void EpisodeName::Reset() {
  inherited_.reset();
  open_ = false;
  named_ = false;
  second_ = {};
  beside_ = {};
  now_ = {};
  now_.severity = announced_ = SeverityAt(BandsOf(0), 0.0);
}

}  // namespace fdi
