#include "diagnosis/fit_window.h"

#include <algorithm>
#include <cmath>

#include "diagnosis/observer_kernels.h"

namespace fdi {

bool JudgesFit(const ModelSet& models) {
  return std::ranges::any_of(models.observers, [](const Observer& observer) {
    return std::ranges::any_of(observer.channels,
                               [](const ChannelObserver& channel) {
                                 return channel.fit != FitBounds{};
                               });
  });
}

FitWindow::FitWindow(int length, std::size_t channels)
    : length_(length),
      channels_(channels),
      ring_(static_cast<std::size_t>(length) * channels),
      sums_(channels) {}

// The ring needs no clearing: a row is taken off only once it is full again.
void FitWindow::Restart() {
  filled_ = 0;
  next_ = 0;
  std::ranges::fill(sums_, Sums{});
}

// What is taken off has the bits that were added: the ring holds what counts.
void FitWindow::Push(std::span<const double> z) {
  static const float kMost = static_cast<float>(std::sqrt(kMaxSquaredDistance));
  float* row = &ring_[static_cast<std::size_t>(next_) * channels_];
  for (std::size_t c = 0; c < channels_; ++c) {
    Sums& sums = sums_[c];
    const auto add = [&sums](double value, int sign) {
      if (!std::isnan(value)) {
        sums.mean += sign * value;
        sums.square += sign * value * value;
        sums.count += sign;
      }
    };
    if (full()) {
      add(row[c], -1);
    }
    row[c] = std::clamp(static_cast<float>(z[c]), -kMost, kMost);
    add(row[c], 1);
  }
  next_ = (next_ + 1) % length_;
  filled_ = std::min(filled_ + 1, length_);
}

double FitWindow::mean(std::size_t channel) const {
  const Sums& sums = sums_[channel];
  return 2 * sums.count < filled_ ? std::numeric_limits<double>::quiet_NaN()
                                  : sums.mean / sums.count;
}

double FitWindow::square(std::size_t channel) const {
  const Sums& sums = sums_[channel];
  return 2 * sums.count < filled_ ? std::numeric_limits<double>::quiet_NaN()
                                  : sums.square / sums.count;
}

double FitWindow::Excess(std::size_t channel, const FitBounds& limits) const {
  const double m = mean(channel);
  if (std::isnan(m) || limits == FitBounds{}) {
    return 0.0;
  }
  // Both scatter with the root of the number of samples.
  return std::sqrt(static_cast<double>(filled_) / length_) *
         std::max(m / (m < 0.0 ? limits.lower_mean : limits.upper_mean),
                  square(channel) / limits.upper_square);
}

}  // namespace fdi
