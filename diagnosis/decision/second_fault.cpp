#include "diagnosis/decision/second_fault.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <utility>

#include "diagnosis/decision/misfit_counts.h"
#include "diagnosis/observers/detection.h"

namespace fdi {
namespace {

constexpr int kSteadySamples = 60;  // with one name, before it is watched
constexpr int kLearnSamples = 200;  // for the residuals of the name
constexpr int kQuietSamples = 100;  // inside the limits after that
constexpr int kFittingSamples = 150;
constexpr int kMisfitWeight = 4;
constexpr double kMargin = 1.25;           // of the largest that was left
constexpr double kStrengthMemory = 100.0;  // samples
constexpr double kMaxSpread = 0.1;         // of a strength that does not move
constexpr double kAhead = 3.0;             // supports of the evidence
constexpr double kMemory = 8.0;            // the same, for refuted ones
constexpr double kLikelyShare = 0.1;
constexpr int kMostLikely = 4;     // faults; more are no name
constexpr double kFarAhead = 6.0;  // the same, for a fault that fits
constexpr int kDoubtWindows = 10;  // of t_k samples: the longest doubt

}  // namespace

// A fault of the name as the standing one, and the residuals that it leaves.
struct SecondFaultWatch::Member {
  struct Left {
    Left(const EnginePlan& plan, InstructionSet instructions)
        : composed(plan.observers(), instructions), detection(plan.models()) {}

    ObserverBank composed;
    Detection detection;
  };

  explicit Member(const FaultBank::Leader& leader)
      : standing{leader.path, leader.strength} {}

  FaultSet fault() const { return FaultSet{1} << standing.path->fault_index; }
  bool pending() const { return left && left->detection.pending(); }
  void Judge(const Sample& sample, const ObserverBank& bank,
             const FaultPlan& plan);
  void LearnMargins(std::size_t channels);
  void FollowStrength(double strength);
  void Settle(bool fits);
  void Unsettle();

  StandingFault standing;
  double spread{0.0};  // mean square of what the strength strays
  int run{0};          // samples in the name
  int watched{0};      // samples as what is expected
  int quiet{0};        // samples in a row inside the limits
  int fitting{0};      // samples that it fits; a misfit undoes four
  std::array<double, kMaxChannels> margins{};  // what it leaves, at most
  bool settled{false};
  std::unique_ptr<Left> left;
};

void SecondFaultWatch::Member::Judge(const Sample& sample,
                                     const ObserverBank& bank,
                                     const FaultPlan& plan) {
  const std::size_t channels = plan.models().channels.size();
  ComposeBank(bank, plan, standing, left->composed);
  LearnMargins(channels);
  left->detection.Push(left->composed, sample, {margins.data(), channels});
}

// The model of a fault errs more than that of normal operation. Residuals from
// before the fault is settled may also occur later on.
void SecondFaultWatch::Member::LearnMargins(std::size_t channels) {
  if (watched >= kLearnSamples) {
    return;
  }
  for (std::size_t c = 0; c < channels; ++c) {
    const int channel = static_cast<int>(c);
    const double residual =
        left->composed.active(channel)
            ? std::abs(CertainResidual(left->composed, channel))
            : 0.0;
    if (residual > 0.0) {  // Not of NaN either.
      margins[c] = std::max(margins[c], kMargin * residual);
    }
  }
}

// While a second fault may be present, the strength of a settled one is kept.
void SecondFaultWatch::Member::FollowStrength(double strength) {
  ++run;
  if (settled && pending()) {
    return;
  }
  const double gain = std::max(1.0 / run, 1.0 / kStrengthMemory);
  const double off = strength - standing.strength;
  standing.strength += gain * off;
  spread += gain * (off * off - spread);
}

// A detection once the margins are known does not count as a second fault yet:
// the margins are learnt again from the residuals that the fault leaves.
void SecondFaultWatch::Member::Settle(bool fits) {
  fitting =
      std::clamp(fitting + (fits ? 1 : -kMisfitWeight), 0, 2 * kFittingSamples);
  ++watched;
  if (watched == kLearnSamples) {
    left->detection.Restart();
  }
  const bool caught =
      watched > kLearnSamples && left->detection.stamp_ns().has_value();
  quiet = watched <= kLearnSamples || caught ? 0 : quiet + 1;
  watched = caught ? 0 : watched;
  settled = quiet >= kQuietSamples && fitting >= kFittingSamples &&
            std::sqrt(spread) < kMaxSpread;
}

void SecondFaultWatch::Member::Unsettle() {
  watched = 0;
  quiet = 0;
  settled = false;
}

// Needed only by an episode with a settled fault.
struct SecondFaultWatch::Rivals {
  explicit Rivals(const EnginePlan& plan)
      : pair(plan.faults()),
        singles(plan.faults()),
        misfits(plan.models().faults.size(),
                plan.models().decision.isolation_samples * 3 / 2) {}

  Episode pair;
  Verdict verdict{};  // of the pair
  FaultBank singles;
  MisfitCounts misfits;  // of single faults
  FaultSet likely{0};    // where no pair fits; as of the end of the doubt
  int quiet{0};          // samples in a row inside the limits
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
  standing_ = nullptr;
  members_.clear();
  rivals_.reset();
}

void SecondFaultWatch::Interrupt() {
  for (const auto& member : members_) {
    if (member->left) {
      member->left->detection.Interrupt();
    }
  }
}

Episode::NameHold SecondFaultWatch::hold() const {
  return phase_ == Phase::kOpen    ? Episode::NameHold::kExplained
         : phase_ == Phase::kDoubt ? Episode::NameHold::kName
                                   : Episode::NameHold::kNone;
}

void SecondFaultWatch::Begin() {
  Restart();
  phase_ = Phase::kWatching;
}

void SecondFaultWatch::Judge(const Sample& sample, const ObserverBank& bank) {
  outlived_ = false;
  const bool held = phase_ == Phase::kDoubt || phase_ == Phase::kOpen;
  for (const auto& member : members_) {
    if (member->left && (!held || member.get() == standing_)) {
      member->Judge(sample, bank, *plan_->faults());
    }
  }
  const auto stamp = !held && standing_ != nullptr && standing_->settled
                         ? standing_->left->detection.stamp_ns()
                         : std::nullopt;
  if (stamp) {
    phase_ = Phase::kDoubt;
    stamp_ns_ = *stamp;
    age_ = 0;
    decided_ = 0;
    paired_ = 0;
    rivals_->quiet = 0;
    rivals_->verdict = {};
    rivals_->pair.Excuse(standing_->standing.path->inputs);
    rivals_->singles.Restart();
    rivals_->misfits.Restart();
  }
  if (held || stamp) {
    Compete(sample, bank);
    Decide();
  }
}

void SecondFaultWatch::Compete(const Sample& sample, const ObserverBank& bank) {
  const ObserverBank& composed = standing_->left->composed;
  Verdict& verdict = rivals_->verdict;
  verdict.stamp_ns = sample.stamp_ns;
  verdict.transition_count = 0;
  for (std::size_t c = 0; c < plan_->models().channels.size(); ++c) {
    const int channel = static_cast<int>(c);
    verdict.residuals[c] =
        composed.active(channel)
            ? CertainResidual(composed, channel, standing_->margins[c])
            : std::numeric_limits<double>::quiet_NaN();
  }
  Findings findings;
  findings.abnormal = standing_->pending();
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

// A pair or a single fault that was refuted long ago may be true by now, so
// neither falls further behind the other than a decision requires.
void SecondFaultWatch::Balance() {
  const double most = kMemory * plan_->models().decision.evidence_support;
  const double pair = rivals_->pair.LeaderOf(known_ & ~name_).evidence;
  const double single = rivals_->singles.LeaderOf(known_).evidence;
  rivals_->singles.RaiseTo(pair - most);
  rivals_->pair.RaiseTo(single - most);
}

void SecondFaultWatch::Decide() {
  const int quiet = 3 * plan_->models().decision.clearing_samples;
  rivals_->quiet = standing_->pending() ? 0 : rivals_->quiet + 1;
  if (rivals_->verdict.state == State::kNormal || rivals_->quiet >= quiet) {
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

// The lead over a pair that a single fault needs, in supports. A second fault
// that was reported is over once the standing one explains as much by itself.
double SecondFaultWatch::Handicap(bool own) const {
  return !own ? 1.0 : phase_ == Phase::kOpen ? -1.0 : 0.0;
}

// The pair has a name and, on the evidence of this doubt, is far ahead of the
// standing fault at any strength. It is also ahead of every other single fault,
// though not necessarily of the one in the pair: that a fault has gone as
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

// Keeps what was learnt about the standing fault; its limits may trip again.
void SecondFaultWatch::WatchOn() {
  phase_ = Phase::kWatching;
  for (const auto& member : members_) {
    if (member->left) {
      member->left->detection.Restart();
    }
  }
}

// One fault explains all. It has to settle, with wider margins.
void SecondFaultWatch::GiveUp() {
  phase_ = Phase::kWatching;
  for (const auto& member : members_) {
    member->Unsettle();
  }
}

// The faults to settle: those of the name that counts, if it has no finding.
FaultSet SecondFaultWatch::NameOf(const NameBeside& beside,
                                  const Verdict& verdict) const {
  const FaultSet name = beside.faults != 0                  ? beside.faults
                        : verdict.state == State::kIsolated ? verdict.isolated
                                                            : FaultSet{0};
  return (name & FindingsOf(plan_->models())) == 0 ? name & known_
                                                   : FaultSet{0};
}

FaultSet SecondFaultWatch::members() const {
  FaultSet faults = 0;
  for (const auto& member : members_) {
    faults |= member->fault();
  }
  return faults;
}

SecondFaultWatch::Member& SecondFaultWatch::MemberAt(
    const FaultBank::Leader& leader) {
  const auto found = std::ranges::find_if(members_, [&](const auto& member) {
    return member->standing.path->fault_index == leader.path->fault_index;
  });
  if (found == members_.end()) {
    return *members_.emplace_back(std::make_unique<Member>(leader));
  }
  if ((*found)->standing.path != leader.path) {
    standing_ = standing_ == found->get() ? nullptr : standing_;
    *found = std::make_unique<Member>(leader);
  }
  return **found;
}

// The faults of the name with a strength each, likeliest first. Where only the
// observers name it, the one that stands already stays as long as it is in it.
SecondFaultWatch::Likeliest SecondFaultWatch::Present(
    const Episode& episode, const NameBeside& beside) {
  Likeliest present{};
  std::size_t count = 0;
  const auto add = [&](const FaultBank::Leader& leader) {
    present[count] = &MemberAt(leader);
    present[count++]->FollowStrength(leader.strength);
  };
  if (beside.faults == 0) {
    const auto leader =
        episode.LeaderOf(standing_ != nullptr ? standing_->fault() : name_);
    if (leader.path != nullptr) {
      add(leader);
    }
    return present;
  }
  const auto& paths = plan_->faults()->paths();
  for (const NameBeside::Fault& fault : beside.likely) {
    const auto path = std::ranges::find_if(paths, [&](const StrengthPath& p) {
      return p.fault_index == fault.bit && !p.taught &&
             p.sign * fault.strength > 0.0;
    });
    if (path != paths.end()) {
      add({&*path, std::abs(fault.strength), 0.0});
    }
  }
  return present;
}

// A fault that leaves a residual and is not the standing one must settle again.
void SecondFaultWatch::Watch(Member& member, bool fits) {
  if (member.settled && &member != standing_ &&
      member.left->detection.stamp_ns()) {
    member.Unsettle();
  }
  if (!member.left && member.run >= kSteadySamples) {
    member.left = std::make_unique<Member::Left>(*plan_, instructions_);
    if (!rivals_) {
      rivals_ = std::make_unique<Rivals>(*plan_);
    }
  } else if (member.left && !member.settled) {
    member.Settle(fits);
  }
}

void SecondFaultWatch::Follow(const Episode& episode, const NameBeside& beside,
                              Verdict& verdict) {
  verdict.second = {};
  const bool held = phase_ == Phase::kDoubt || phase_ == Phase::kOpen;
  if (held) {
    Write(verdict);
    return;
  }
  const FaultSet name = NameOf(beside, verdict);
  if (!plan_->faults()->judges_fit() || name == 0) {
    Restart();
    return;
  }
  const FaultSet known = members();
  const bool goes_on =
      (name & known) != 0 &&
      ((name & ~known) == 0 || (name & ~name_) == 0 || (name_ & ~name) == 0);
  if (!goes_on) {
    Begin();
  }
  name_ = name;
  if (standing_ != nullptr && (standing_->fault() & name) == 0) {
    standing_ = nullptr;
  }
  if (members_.size() > NameBeside::kMost) {
    std::erase_if(members_, [name](const auto& member) {
      return (member->fault() & name) == 0;
    });
  }
  const Likeliest present = Present(episode, beside);
  if (present[0] == nullptr) {
    Restart();
    return;
  }
  for (const auto& member : members_) {
    Watch(*member, beside.faults != 0 || (name_ & ~episode.misfits()) != 0);
  }
  const auto settled = std::ranges::find_if(present, [](const Member* member) {
    return member != nullptr && member->settled;
  });
  standing_ = settled != present.end() ? *settled : present[0];
  Write(verdict);
}

// If no pair fits either: the faults of the best pairs, within a share of the
// lead of the best one, because models err by a share of an effect.
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
  // No pair fits, so a single fault is not named.
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
  const StandingFault& standing = standing_->standing;
  if (!standing.path->taught) {
    second.standing_bit = standing.path->fault_index;
    second.standing_strength = standing.path->sign * standing.strength;
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
  verdict.strengths[standing.path->fault_index] =
      standing.path->sign * standing.strength;
}

}  // namespace fdi
