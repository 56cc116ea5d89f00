#pragma once

#include <vector>

#include "diagnosis/model_set.h"
#include "diagnosis/observer_bank.h"

namespace fdi {

/// The evidence for one explanation, L = Σ_c L_c, gathered by channel so that
/// each forgets for itself: a channel at its transmitter's limit, or without
/// its signals, says next to nothing, and what it said before is held until it
/// speaks again,
///
///     L_c ← λ L_c + gain,   λ = 1 meanwhile.
class ChannelEvidence {
 public:
  explicit ChannelEvidence(std::size_t channels) : parts_(channels, 0.0) {}

  void Clear();
  void Fade(const ObserverBank& bank, double memory);
  void Add(int channel, double gain) {
    parts_[static_cast<std::size_t>(channel)] += gain;
  }

  /// Lifts the sum to `least` if it is below, where most speaks against.
  void RaiseTo(double least);

  double total() const;

 private:
  std::vector<double> parts_;
};

/// τ_c: the median correlation time of the residuals of a channel over the
/// observers, times the channels of the same output: they share its noise, and
/// what one of them says the others repeat [samples].
std::vector<double> ChannelTimes(const ModelSet& models);

}  // namespace fdi
