#include "diagnosis/decision/observer_evidence.h"

#include <algorithm>

namespace fdi {

ObserverEvidence::ObserverEvidence(std::shared_ptr<const FaultPlan> plan)
    : plan_(std::move(plan)),
      parts_(plan_->observers().blocks().size()),
      totals_(plan_->models().observers.size(), 0.0) {}

void ObserverEvidence::Clear() {
  std::fill(parts_.begin(), parts_.end(), Quad{});
  std::fill(totals_.begin(), totals_.end(), 0.0);
}

void ObserverEvidence::Gather(const ObserverBank& bank) {
  const std::size_t channels = plan_->models().channels.size();
  for (std::size_t c = 0; c < channels; ++c) {
    const int channel = static_cast<int>(c);
    if (bank.active(channel)) {
      const bool saturated = bank.saturated(channel);
      const GainTerms terms{bank.fades(channel) ? plan_->memory() : 1.0,
                            plan_->channel_time(c), !saturated};
      bank.kernels().gather(plan_->observers(), bank.state(), c, terms,
                            parts_.data());
    }
  }
  for (std::size_t o = 0; o < totals_.size(); ++o) {
    Sum(o);
  }
}

void ObserverEvidence::RaiseTo(double least) {
  const ObserverPlan& observers = plan_->observers();
  const std::size_t channels = plan_->models().channels.size();
  for (std::size_t o = 0; o < totals_.size(); ++o) {
    const double lacking = least - totals_[o];
    if (lacking > 0.0) {
      double* lowest = &Part(observers.slot(o, 0));
      for (std::size_t c = 1; c < channels; ++c) {
        double& part = Part(observers.slot(o, c));
        lowest = part < *lowest ? &part : lowest;
      }
      *lowest += lacking;
      Sum(o);
    }
  }
}

void ObserverEvidence::Sum(std::size_t observer) {
  const std::size_t channels = plan_->models().channels.size();
  double total = 0.0;
  for (std::size_t c = 0; c < channels; ++c) {
    total += Part(plan_->observers().slot(observer, c));
  }
  totals_[observer] = total;
}

}  // namespace fdi
