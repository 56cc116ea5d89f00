#include "diagnosis/decision/fault_bank.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "diagnosis/decision/rules.h"
#include "diagnosis/observers/observer_kernels.h"

namespace fdi {
namespace {

// A refuted fault stays refuted for a while, but for no longer the more often
// it was refuted: evidence lags behind the best by at most this many supports.
constexpr double kMemoryOfContradiction = 4.0;
// With an allowance for interpolation, so many supports beyond it suffice.
constexpr double kBeyondAllowance = 2.0;
constexpr std::array kInputs{Signal::kP1, Signal::kP2, Signal::kT1};

}  // namespace

FaultBank::FaultBank(std::shared_ptr<const FaultPlan> plan)
    : plan_(std::move(plan)),
      trained_(plan_),
      inputs_(plan_->models().decision.isolation_samples, kInputs.size()) {
  for (const StrengthPath& path : plan_->paths()) {
    trackers_.emplace_back(*plan_, path);
  }
}

FaultBank::FaultBank(const ModelSet& models)
    : FaultBank(std::make_shared<const FaultPlan>(
          std::make_shared<const ObserverPlan>(models))) {}

void FaultBank::Score(const ObserverBank& bank, Verdict& verdict) const {
  const ModelSet& models = plan_->models();
  std::fill_n(verdict.fault_factors.begin(), models.faults.size(), 0.0);
  const std::size_t observers = models.observers.size();
  bank.Score({verdict.observer_factors.data(), observers});
  for (std::size_t i = 1; i < observers; ++i) {
    double& factor = verdict.fault_factors[plan_->fault_index(i)];
    factor = std::max(factor, verdict.observer_factors[i]);
  }
  verdict.normal_factor = verdict.observer_factors[0];
}

void FaultBank::Restart() {
  trained_.Clear();
  effects_.fill(0.0);
  allowance_ = 0.0;
  misfits_ = 0;
  inputs_.Restart();
  odd_ = 0;
  usual_ = 0;
  for (StrengthTracker& tracker : trackers_) {
    tracker.Restart();
  }
}

double FaultBank::BestEvidence() const {
  double best = trained_.total(0);
  for (const StrengthTracker& tracker : trackers_) {
    best = std::max(best, tracker.evidence(trained_));
  }
  return best;
}

FaultBank::Leader FaultBank::LeaderOf(FaultSet faults) const {
  Leader leader;
  for (const StrengthTracker& tracker : trackers_) {
    const double evidence = tracker.evidence(trained_);
    if (Has(faults, tracker.path().fault_index) && evidence > leader.evidence) {
      leader = {&tracker.path(), std::abs(tracker.strength(trained_)),
                evidence};
    }
  }
  return leader;
}

void FaultBank::UpdateEffect(const ObserverBank& bank) {
  const std::vector<ChannelObserver>& normal =
      plan_->models().observers.front().channels;
  for (std::size_t c = 0; c < normal.size(); ++c) {
    const int channel = static_cast<int>(c);
    const double residual = bank.residual(0, channel);
    if (!bank.active(channel) || bank.saturated(channel) ||
        std::isnan(residual)) {
      continue;
    }
    const double distance = residual / normal[c].residual_sd;
    effects_[c] = (bank.fades(channel) ? plan_->memory() : 1.0) * effects_[c] +
                  0.5 * std::min(distance * distance, kMaxSquaredDistance) /
                      plan_->channel_time(c);
  }
}

double FaultBank::Allowance() const {
  double best = trained_.total(0);
  double interpolation = 0.0;
  for (const StrengthTracker& tracker : trackers_) {
    if (tracker.evidence(trained_) > best) {
      best = tracker.evidence(trained_);
      interpolation = tracker.Interpolation(trained_);
    }
  }
  return AllowanceOf(interpolation);
}

double FaultBank::AllowanceOf(double interpolation) const {
  if (!Acts(Rule::kAllowance)) {
    return 0.0;
  }
  return plan_->models().decision.interpolation_allowance * interpolation *
         std::accumulate(effects_.begin(), effects_.end(), 0.0);
}

void FaultBank::Update(const ObserverBank& bank) {
  UpdateEffect(bank);
  trained_.Gather(bank);
  for (StrengthTracker& tracker : trackers_) {
    tracker.Step(bank);
    tracker.JudgeAccount(bank, trained_);
    if (plan_->judges_fit()) {
      tracker.PushFit(bank, trained_, (odd_ & tracker.path().moved) != 0);
    }
  }
  misfits_ = 0;
  FaultSet fitting = 0;
  for (const StrengthTracker& tracker : trackers_) {
    (Fits(tracker) ? fitting : misfits_) |= FaultSet{1}
                                            << tracker.path().fault_index;
  }
  misfits_ &= ~fitting;
  allowance_ = Allowance();
  const double support = plan_->models().decision.evidence_support;
  const double least =
      BestEvidence() - std::max(kMemoryOfContradiction * support,
                                allowance_ + kBeyondAllowance * support);
  if (Acts(Rule::kShortMemory)) {
    RaiseTo(least);
  }
}

void FaultBank::RaiseTo(double least) {
  trained_.RaiseTo(least);
  for (StrengthTracker& tracker : trackers_) {
    tracker.RaiseEvidence(least);
  }
}

void FaultBank::PushInputs(const Sample& sample) {
  if (!plan_->judges_fit()) {
    return;
  }
  constexpr double kOdd = 5.0;
  const ValidityRegion& region = plan_->models().validity;
  const std::array ranges{region.p1, region.p2, region.t1};
  std::array<double, kInputs.size()> z{};
  for (std::size_t i = 0; i < z.size(); ++i) {
    z[i] = !sample.Has(kInputs[i]) ? std::numeric_limits<double>::quiet_NaN()
           : ranges[i].Contains(sample[kInputs[i]]) ? 0.0
                                                    : kOdd;
  }
  inputs_.Push(z);
  odd_ = 0;
  usual_ = 0;
  for (std::size_t i = 0; i < z.size(); ++i) {
    const SignalMask input = MaskOf(kInputs[i]);
    odd_ |= inputs_.mean(i) > 0.5 * kOdd ? input : SignalMask{0};
    usual_ |= inputs_.mean(i) <= 0.5 * kOdd ? input : SignalMask{0};
  }
}

// Where one of P1, P2 and T1 is not as in normal operation, it is a fault that
// acts on it, and a fault that always moved one has moved it.
bool FaultBank::SuitsInputs(const StrengthTracker& tracker) const {
  const StrengthPath& path = tracker.path();
  const bool odd =
      Acts(Rule::kInputsOdd) && (odd_ & ~(path.inputs | excused_)) != 0;
  const bool usual = Acts(Rule::kInputsMoved) && (usual_ & path.moved) != 0;
  return !plan_->judges_fit() || (!odd && !usual);
}

bool FaultBank::Fits(const StrengthTracker& tracker) const {
  return !plan_->judges_fit() || (tracker.fits() && SuitsInputs(tracker));
}

double FaultBank::EvidenceMembership(double behind) const {
  const double core = plan_->models().decision.evidence_core;
  const double support = plan_->models().decision.evidence_support;
  return std::clamp((support - behind) / (support - core), 0.0, 1.0);
}

// The most that d_f may be by one rule. `instant` is the factor of the fault's
// observers in this sample.
double FaultBank::Cap(Rule rule, const StrengthTracker& tracker, double instant,
                      double behind) const {
  const double isolation = plan_->models().decision.isolation_threshold;
  switch (rule) {
    case Rule::kMemberships:
      return std::max(instant, tracker.factor());
    case Rule::kTolerates:
      return tracker.tolerates() ? 0.5 * (1.0 + isolation) : 1.0;
    default:  // Rule::kEvidence
      return EvidenceMembership(behind);
  }
}

void FaultBank::ApplyEvidence(Verdict& verdict) const {
  const double best = BestEvidence();
  verdict.normal_factor = std::min(
      verdict.normal_factor, EvidenceMembership(best - trained_.total(0)));
  const std::array<double, kMaxFaults> instant = verdict.fault_factors;
  std::fill_n(verdict.fault_factors.begin(), plan_->models().faults.size(),
              0.0);
  std::array<double, kMaxFaults> leading{};
  leading.fill(-std::numeric_limits<double>::infinity());
  for (const StrengthTracker& tracker : trackers_) {
    const std::size_t i = tracker.path().fault_index;
    const double evidence = tracker.evidence(trained_);
    double factor = 1.0;
    for (const Rule rule : kRulesOf<Stage::kFactors>) {
      if (Acts(rule)) {
        factor = std::min(factor, Cap(rule, tracker, instant[i],
                                      best - evidence - allowance_));
      }
    }
    verdict.fault_factors[i] = std::max(verdict.fault_factors[i], factor);
    if (evidence > leading[i]) {
      leading[i] = evidence;
      verdict.strengths[i] = tracker.strength(trained_);
    }
  }
}

FaultSet FaultBank::Unrefuted(double margin) const {
  const StrengthTracker* best = nullptr;
  double most = -std::numeric_limits<double>::infinity();
  for (const StrengthTracker& tracker : trackers_) {
    const double evidence = tracker.evidence(trained_);
    if (SuitsInputs(tracker) && evidence > most) {
      best = &tracker;
      most = evidence;
    }
  }
  if (best == nullptr || most - trained_.total(0) < margin ||
      !best->accounts() || !best->fits_so_far()) {
    return 0;
  }
  FaultSet unrefuted = 0;
  for (const StrengthTracker& tracker : trackers_) {
    if (SuitsInputs(tracker) &&
        most - tracker.evidence(trained_) - allowance_ < margin) {
      unrefuted |= FaultSet{1} << tracker.path().fault_index;
    }
  }
  return unrefuted;
}

bool FaultBank::ShownByInputs(FaultSet faults) const {
  return std::ranges::all_of(trackers_, [&](const StrengthTracker& tracker) {
    const StrengthPath& path = tracker.path();
    return !Has(faults, path.fault_index) || (odd_ & path.moved) != 0;
  });
}

FaultSet FaultBank::Contradicted() const {
  const DecisionParameters& decision = plan_->models().decision;
  if (decision.interpolation_allowance <= 0.0) {
    return 0;
  }
  const double best = BestEvidence();
  FaultSet contradicted = 0;
  FaultSet standing = 0;
  for (const StrengthTracker& tracker : trackers_) {
    const double allowance =
        std::max(allowance_, AllowanceOf(tracker.TrackedInterpolation()));
    const bool behind = best - tracker.evidence(trained_) - allowance >=
                        decision.evidence_support;
    (behind ? contradicted : standing) |= FaultSet{1}
                                          << tracker.path().fault_index;
  }
  return contradicted & ~standing;
}

FaultSet FaultBank::Recognised(double margin, bool fitting) const {
  FaultSet recognised = 0;
  const double best = BestEvidence();
  if (EvidenceMembership(best - trained_.total(0)) == 1.0) {
    return 0;
  }
  for (const StrengthTracker& tracker : trackers_) {
    const StrengthPath& path = tracker.path();
    if (path.taught && best - tracker.evidence(trained_) <= margin &&
        (!fitting || Fits(tracker))) {
      recognised |= FaultSet{1} << path.fault_index;
    }
  }
  return recognised;
}

}  // namespace fdi
