#include "diagnosis/second_fault.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <utility>

#include "diagnosis/detection.h"
#include "diagnosis/misfit_counts.h"

namespace fdi {
namespace {

constexpr int kSteadySamples = 60;  // with one name, before it is watched
constexpr int kLearnSamples = 200;  // to see what the name leaves
constexpr int kQuietSamples = 100;  // inside the limits after that
constexpr int kFittingSamples = 150;
constexpr int kMisfitWeight = 4;
constexpr double kMargin = 1.25;           // of the largest that was left
constexpr double kStrengthMemory = 100.0;  // samples
constexpr double kMaxSpread = 0.1;         // of a strength that does not move
constexpr double kAhead = 3.0;             // supports of the evidence
constexpr double kMemory = 8.0;            // the same, of what is refuted
constexpr double kLikelyShare = 0.1;
constexpr int kMostLikely = 4;     // faults; more are no name
constexpr double kFarAhead = 6.0;  // the same, of a fault that fits
constexpr int kDoubtWindows = 10;  // of t_k samples: the longest doubt

}  // namespace

// What only an episode with a settled fault needs.
struct SecondFaultWatch::Rivals {
  Rivals(const EnginePlan& plan, InstructionSet instructions)
      : composed(plan.observers(), instructions),
        detection(plan.models()),
        pair(plan.faults()),
        singles(plan.faults()),
        misfits(plan.models().faults.size(),
                plan.models().decision.isolation_samples * 3 / 2) {}

  ObserverBank composed;
  Detection detection;  // on what the standing fault leaves
  Episode pair;
  Verdict verdict{};  // of the pair
  FaultBank singles;
  MisfitCounts misfits;  // of single faults
  FaultSet likely{0};    // where no pair fits; as of the end of the doubt
};

SecondFaultWatch::SecondFaultWatch(std::shared_ptr<const EnginePlan> plan,
                                   InstructionSet instructions)
    : plan_(std::move(plan)), instructions_(instructions) {
  for (const StrengthPath& path : plan_->faults()->paths()) {
    known_ |= FaultSet{1} << path.fault_index;
  }
}

SecondFaultWatch::~SecondFaultWatch() = default;
SecondFaultWatch::SecondFaultWatch(SecondFaultWatch&&) noexcept = default;
SecondFaultWatch& SecondFaultWatch::operator=(SecondFaultWatch&&) noexcept =
    default;

void SecondFaultWatch::Restart() {
  phase_ = Phase::kNone;
  outlived_ = false;
  name_ = 0;
  rivals_.reset();
}

void SecondFaultWatch::Interrupt() {
  if (rivals_) {
    rivals_->detection.Interrupt();
  }
}

Episode::NameHold SecondFaultWatch::hold() const {
  return phase_ == Phase::kOpen    ? Episode::NameHold::kExplained
         : phase_ == Phase::kDoubt ? Episode::NameHold::kName
                                   : Episode::NameHold::kNone;
}

void SecondFaultWatch::Begin(FaultSet name) {
  Restart();
  name_ = name;
  phase_ = Phase::kFollowing;
  standing_ = {};
  spread_ = 0.0;
  run_ = 0;
  watched_ = 0;
  quiet_ = 0;
  fitting_ = 0;
  margins_.fill(0.0);
  settled_ = false;
}

// A model of a fault errs more than one of normal operation. What it leaves
// before the fault is settled, it may leave later on.
void SecondFaultWatch::LearnMargins(const ObserverBank& composed) {
  if (phase_ != Phase::kWatching || watched_ >= kLearnSamples) {
    return;
  }
  for (std::size_t c = 0; c < plan_->models().channels.size(); ++c) {
    const int channel = static_cast<int>(c);
    const double left = composed.active(channel)
                            ? std::abs(CertainResidual(composed, channel))
                            : 0.0;
    if (left > 0.0) {  // Not of NaN either.
      margins_[c] = std::max(margins_[c], kMargin * left);
    }
  }
}

void SecondFaultWatch::Judge(const Sample& sample, const ObserverBank& bank) {
  outlived_ = false;
  if (!rivals_) {
    return;
  }
  ComposeBank(bank, *plan_->faults(), standing_, rivals_->composed);
  LearnMargins(rivals_->composed);
  rivals_->detection.Push(rivals_->composed, sample,
                          {margins_.data(), plan_->models().channels.size()});
  const auto stamp = rivals_->detection.stamp_ns();
  if (phase_ == Phase::kWatching && settled_ && stamp) {
    phase_ = Phase::kDoubt;
    stamp_ns_ = *stamp;
    age_ = 0;
    decided_ = 0;
    paired_ = 0;
    quiet_ = 0;
    rivals_->verdict = {};
    rivals_->pair.Excuse(standing_.path->inputs);
    rivals_->singles.Restart();
    rivals_->misfits.Restart();
  }
  if (phase_ == Phase::kDoubt || phase_ == Phase::kOpen) {
    Compete(sample, bank);
    Decide();
  }
}

void SecondFaultWatch::Compete(const Sample& sample, const ObserverBank& bank) {
  const ObserverBank& composed = rivals_->composed;
  Verdict& verdict = rivals_->verdict;
  verdict.stamp_ns = sample.stamp_ns;
  verdict.transition_count = 0;
  for (std::size_t c = 0; c < plan_->models().channels.size(); ++c) {
    const int channel = static_cast<int>(c);
    verdict.residuals[c] = composed.active(channel)
                               ? CertainResidual(composed, channel, margins_[c])
                               : std::numeric_limits<double>::quiet_NaN();
  }
  Findings findings;
  findings.abnormal = rivals_->detection.pending();
  findings.detected = stamp_ns_;
  rivals_->pair.Score(composed, verdict);
  rivals_->pair.Step(sample, composed, findings, verdict);
  rivals_->singles.PushInputs(sample);
  rivals_->singles.Update(bank);
  if (phase_ == Phase::kOpen) {
    Balance();
  }
  rivals_->misfits.Push(rivals_->singles.misfits());
  ++age_;
}

// What was refuted long ago may be true by now, of pairs and of single faults:
// neither falls further behind the other than it has to for a decision.
void SecondFaultWatch::Balance() {
  const double most = kMemory * plan_->models().decision.evidence_support;
  const double pair = rivals_->pair.LeaderOf(known_ & ~name_).evidence;
  const double single = rivals_->singles.LeaderOf(known_).evidence;
  rivals_->singles.RaiseTo(pair - most);
  rivals_->pair.RaiseTo(single - most);
}

void SecondFaultWatch::Decide() {
  const int quiet = 3 * plan_->models().decision.clearing_samples;
  quiet_ = rivals_->detection.pending() ? 0 : quiet_ + 1;
  if (rivals_->verdict.state == State::kNormal || quiet_ >= quiet) {
    WatchOn();  // It is over.
    return;
  }
  const DecisionParameters& decision = plan_->models().decision;
  const FaultBank& singles = rivals_->singles;
  const FaultSet fitting =
      known_ & ~rivals_->misfits.refuted() & ~singles.misfits();
  const FaultBank::Leader single = singles.LeaderOf(fitting);
  const FaultBank::Leader pair = rivals_->pair.LeaderOf(known_ & ~name_);
  const bool own =
      single.path != nullptr && Has(name_, single.path->fault_index);
  const bool by_one =
      single.path != nullptr && age_ > 2 * decision.isolation_samples &&
      single.evidence >
          pair.evidence + Handicap(own) * decision.evidence_support;
  decided_ = by_one ? decided_ + 1 : 0;
  if (decided_ >= decision.isolation_samples) {
    outlived_ = phase_ == Phase::kOpen && !own;
    GiveUp();
    return;
  }
  paired_ = IsPair(pair) ? paired_ + 1 : 0;
  const bool by_none = (known_ & ~rivals_->misfits.refuted()) == 0;
  if (phase_ == Phase::kDoubt &&
      (by_none || paired_ >= decision.isolation_samples)) {
    phase_ = Phase::kOpen;
    rivals_->likely = Likely();
  } else if (phase_ == Phase::kDoubt &&
             age_ > kDoubtWindows * decision.isolation_samples) {
    GiveUp();
  }
}

// What one fault has to be ahead of a pair by, in supports. One that is said to
// be second is over where the standing one explains as much by itself.
double SecondFaultWatch::Handicap(bool own) const {
  return !own ? 1.0 : phase_ == Phase::kOpen ? -1.0 : 0.0;
}

// The pair has a name and is far ahead of the standing fault at any strength,
// of what this doubt has shown. It is also ahead of every other single fault;
// but of the one that is in the pair, it need not be: that a fault has gone as
// the other one came is less likely than both of them.
bool SecondFaultWatch::IsPair(const FaultBank::Leader& pair) const {
  const double support = plan_->models().decision.evidence_support;
  const FaultBank& singles = rivals_->singles;
  if (pair.path == nullptr || (rivals_->verdict.isolated & ~name_) == 0) {
    return false;
  }
  const bool misfit = (name_ & ~rivals_->misfits.refuted()) == 0;
  const double ahead =
      pair.evidence -
      std::max(singles.LeaderOf(name_).evidence, singles.normal_evidence());
  const FaultBank::Leader other = singles.LeaderOf(known_ & ~name_);
  const bool same = other.path == pair.path;
  return ahead > (misfit ? kAhead : kFarAhead) * support &&
         pair.evidence - other.evidence > (same ? -1.0 : kAhead) * support;
}

// What is known of the standing fault stays so, and may be exceeded again.
void SecondFaultWatch::WatchOn() {
  phase_ = Phase::kWatching;
  rivals_->detection.Restart();
}

// One fault explains all. It has to settle, with wider margins.
void SecondFaultWatch::GiveUp() {
  phase_ = Phase::kWatching;
  watched_ = 0;
  quiet_ = 0;
  settled_ = false;
}

// What is settled is the name that counts, and one without findings.
FaultSet SecondFaultWatch::NameOf(const NameBeside& beside,
                                  const Verdict& verdict) const {
  const FaultSet name = beside.faults != 0                  ? beside.faults
                        : verdict.state == State::kIsolated ? verdict.isolated
                                                            : FaultSet{0};
  return (name & FindingsOf(plan_->models())) == 0 ? name & known_
                                                   : FaultSet{0};
}

FaultBank::Leader SecondFaultWatch::LeaderOf(const Episode& episode,
                                             const NameBeside& beside) const {
  if (beside.faults == 0) {
    // One that stands already stays it as long as it is in the name.
    return episode.LeaderOf(standing_.path != nullptr
                                ? FaultSet{1} << standing_.path->fault_index
                                : name_);
  }
  for (const StrengthPath& path : plan_->faults()->paths()) {
    if (path.fault_index == beside.bit && !path.taught &&
        path.sign * beside.strength > 0.0) {
      return {&path, std::abs(beside.strength), 0.0};
    }
  }
  return {};
}

void SecondFaultWatch::Follow(const Episode& episode, const NameBeside& beside,
                              Verdict& verdict) {
  verdict.second = {};
  const bool held = phase_ == Phase::kDoubt || phase_ == Phase::kOpen;
  const FaultSet name = held ? name_ : NameOf(beside, verdict);
  if (!plan_->faults()->judges_fit() || name == 0) {
    Restart();
    return;
  }
  const bool goes_on = standing_.path != nullptr &&
                       Has(name, standing_.path->fault_index) &&
                       ((name & ~name_) == 0 || (name_ & ~name) == 0);
  if (name_ == 0 || (name != name_ && !goes_on)) {
    Begin(name);
  }
  name_ = name;
  ++run_;
  if (!held) {
    const FaultBank::Leader leader = LeaderOf(episode, beside);
    if (leader.path == nullptr) {
      Restart();
      return;
    }
    FollowStrength(leader);
  }
  if (phase_ == Phase::kFollowing && run_ >= kSteadySamples) {
    rivals_ = std::make_unique<Rivals>(*plan_, instructions_);
    phase_ = Phase::kWatching;
  } else if (phase_ == Phase::kWatching) {
    settled_ = settled_ || Settles(episode, beside.faults != 0);
  }
  Write(verdict);
}

// Of a settled fault, what may be a second one does not move the strength.
void SecondFaultWatch::FollowStrength(const FaultBank::Leader& leader) {
  if (leader.path != standing_.path) {
    Begin(name_);
    standing_.path = leader.path;
    standing_.strength = leader.strength;
    run_ = 1;
  }
  if (settled_ && rivals_->detection.pending()) {
    return;
  }
  const double gain = std::max(1.0 / run_, 1.0 / kStrengthMemory);
  const double off = leader.strength - standing_.strength;
  standing_.strength += gain * off;
  spread_ += gain * (off * off - spread_);
}

// What the limits, with their margins, have caught since these are known does
// not count: another look is taken at what the name leaves.
bool SecondFaultWatch::Settles(const Episode& episode, bool by_physics) {
  const bool fits = by_physics || (name_ & ~episode.misfits()) != 0;
  fitting_ = std::clamp(fitting_ + (fits ? 1 : -kMisfitWeight), 0,
                        2 * kFittingSamples);
  ++watched_;
  if (watched_ == kLearnSamples) {
    rivals_->detection.Restart();
  }
  quiet_ = watched_ <= kLearnSamples || rivals_->detection.stamp_ns()
               ? 0
               : quiet_ + 1;
  if (watched_ > kLearnSamples && rivals_->detection.stamp_ns()) {
    watched_ = 0;
  }
  return quiet_ >= kQuietSamples && fitting_ >= kFittingSamples &&
         std::sqrt(spread_) < kMaxSpread;
}

// Where no pair fits either, those that stand out of all pairs: by a share of
// what the best is ahead, because models err by a share of an effect.
FaultSet SecondFaultWatch::Likely() const {
  const double support = plan_->models().decision.evidence_support;
  const double best = rivals_->pair.LeaderOf(known_ & ~name_).evidence;
  const double lead = best - rivals_->singles.LeaderOf(known_).evidence;
  const double margin = std::max(support, kLikelyShare * lead);
  FaultSet likely = 0;
  for (std::size_t i = 0; i < plan_->models().faults.size(); ++i) {
    const FaultSet fault = FaultSet{1} << i & known_ & ~name_;
    if (fault != 0 && best - rivals_->pair.LeaderOf(fault).evidence < margin) {
      likely |= fault;
    }
  }
  // What does not fit is no name of its own.
  const int count = std::popcount(likely);
  return lead > kFarAhead * support && count > 1 && count <= kMostLikely
             ? likely
             : 0;
}

void SecondFaultWatch::Write(Verdict& verdict) const {
  SecondFault& second = verdict.second;
  second.doubt = phase_ == Phase::kDoubt;
  second.open = phase_ == Phase::kOpen;
  second.standing = second.doubt || second.open ? name_ : FaultSet{0};
  if (standing_.path != nullptr && !standing_.path->taught) {
    second.standing_bit = standing_.path->fault_index;
    second.standing_strength = standing_.path->sign * standing_.strength;
  }
  if (!second.open) {
    return;
  }
  const ModelSet& models = plan_->models();
  second.detection_stamp_ns = stamp_ns_;
  second.faults = rivals_->verdict.isolated & ~name_;
  second.faults = second.faults != 0 ? second.faults : rivals_->likely;
  for (std::size_t i = 0; i < models.faults.size(); ++i) {
    const double factor = rivals_->verdict.fault_factors[i];
    if (Has(second.faults, i) && factor >= second.factor) {
      second.factor = factor;
      second.strength = rivals_->verdict.strengths[i];
    }
    if (Has(name_, i)) {
      verdict.fault_factors[i] = std::max(verdict.fault_factors[i],
                                          models.decision.isolation_threshold);
    }
  }
  verdict.strengths[standing_.path->fault_index] =
      standing_.path->sign * standing_.strength;
}

}  // namespace fdi
