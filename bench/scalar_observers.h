#pragma once

#include <array>
#include <vector>

#include "diagnosis/model/model_set.h"
#include "diagnosis/model/sample.h"

namespace fdi::bench {

/// The equations of ObserverBank, one model after the other in scalar code;
/// models that share antecedents have their rules weighed once.
class ScalarObservers {
 public:
  /// `models` must outlive it.
  explicit ScalarObservers(const ModelSet& models);

  /// @returns the sum of the factors of all observers.
  double Step(const Sample& sample);

 private:
  struct Slot {
    const ChannelObserver* channel;
    bool weighs;                          // else as the slot before
    std::array<double, kMaxLag + 1> own;  // past predictions, a ring
  };
  struct Weighed {
    std::array<double, kMaxRegressors> x;
    std::array<double, kMaxRegressors> inside;
    bool beyond;
    FiringRules firing;
    FiringRules firing_inside;
  };

  std::size_t Row(int lag) const {
    return static_cast<std::size_t>((head_ + kMaxLag + 1 - lag) %
                                    (kMaxLag + 1));
  }
  void WeighSlot(const Slot& slot);
  double StepSlot(Slot& slot, double reading);

  std::size_t observers_;
  int head_{0};
  std::array<std::array<double, kSignalCount>, kMaxLag + 1> measured_{};
  std::vector<std::vector<Slot>> channels_;
  std::vector<double> factors_;
  Weighed weighed_{};
};

}  // namespace fdi::bench
