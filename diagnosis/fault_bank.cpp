#include "diagnosis/fault_bank.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace fdi {
namespace {

// What is refuted stays refuted for a while, but not for longer the more often
// it was: evidence falls behind the best by this many supports at most.
constexpr double kMemoryOfContradiction = 4.0;

std::vector<int> ObserversOf(const ModelSet& models, int fault, bool negative) {
  std::vector<int> found;
  for (std::size_t i = 1; i < models.observers.size(); ++i) {
    const Observer& observer = models.observers[i];
    if (observer.fault == fault && (observer.strength < 0.0) == negative) {
      found.push_back(static_cast<int>(i));
    }
  }
  std::sort(found.begin(), found.end(), [&](int a, int b) {
    return std::abs(models.observers[static_cast<std::size_t>(a)].strength) <
           std::abs(models.observers[static_cast<std::size_t>(b)].strength);
  });
  return found;
}

}  // namespace

FaultBank::FaultBank(const ModelSet& models)
    : models_(&models), normal_(models, {}) {
  for (const Observer& observer : models.observers) {
    fault_indices_.push_back(
        static_cast<std::size_t>(FaultIndex(models, observer.fault)));
  }
  for (std::size_t i = 0; i < models.faults.size(); ++i) {
    for (const bool negative : {false, true}) {
      const auto observers = ObserversOf(models, models.faults[i], negative);
      if (!observers.empty()) {
        families_.push_back({i, StrengthTracker(models, observers)});
      }
    }
  }
}

void FaultBank::Score(const ObserverBank& bank, Verdict& verdict) const {
  std::fill_n(verdict.fault_factors.begin(), models_->faults.size(), 0.0);
  const std::size_t observers = models_->observers.size();
  bank.Score({verdict.observer_factors.data(), observers});
  for (std::size_t i = 1; i < observers; ++i) {
    double& factor = verdict.fault_factors[fault_indices_[i]];
    factor = std::max(factor, verdict.observer_factors[i]);
  }
  verdict.normal_factor = verdict.observer_factors[0];
}

void FaultBank::Restart() {
  normal_.Restart();
  for (Family& family : families_) {
    family.tracker.Restart();
  }
}

void FaultBank::Follow(const ObserverBank& bank) {
  normal_.Step(bank);
  double best = normal_.evidence();
  for (Family& family : families_) {
    family.tracker.Step(bank);
    best = std::max(best, family.tracker.evidence());
  }
  const double least =
      best - kMemoryOfContradiction * models_->decision.evidence_support;
  normal_.RaiseEvidence(least);
  for (Family& family : families_) {
    family.tracker.RaiseEvidence(least);
  }
}

double FaultBank::EvidenceMembership(double behind) const {
  const double core = models_->decision.evidence_core;
  const double support = models_->decision.evidence_support;
  return std::clamp((support - behind) / (support - core), 0.0, 1.0);
}

void FaultBank::Compete(Verdict& verdict) const {
  double best = normal_.evidence();
  for (const Family& family : families_) {
    best = std::max(best, family.tracker.evidence());
  }
  verdict.normal_factor = std::min(
      verdict.normal_factor, EvidenceMembership(best - normal_.evidence()));
  std::array<double, kMaxFaults> instant = verdict.fault_factors;
  std::fill_n(verdict.fault_factors.begin(), models_->faults.size(), 0.0);
  std::array<double, kMaxFaults> leading{};
  leading.fill(-std::numeric_limits<double>::infinity());
  for (const Family& family : families_) {
    const std::size_t i = family.fault_index;
    const StrengthTracker& tracker = family.tracker;
    const double most =
        tracker.refutable() ? 1.0 : 0.5 * models_->decision.isolation_threshold;
    const double factor =
        std::min({std::max(instant[i], tracker.factor()), most,
                  EvidenceMembership(best - tracker.evidence())});
    verdict.fault_factors[i] = std::max(verdict.fault_factors[i], factor);
    if (tracker.evidence() > leading[i]) {
      leading[i] = tracker.evidence();
      verdict.strengths[i] = tracker.strength();
    }
  }
}

}  // namespace fdi
