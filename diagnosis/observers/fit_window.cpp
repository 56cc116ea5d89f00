#include "diagnosis/observers/fit_window.h"

#include <algorithm>
#include <cmath>

#include "diagnosis/observers/observer_kernels.h"

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

void FitWindow::Add(float z, int sign, Sums& sums) {
  const double value = z;
  if (!std::isnan(value)) {
    sums.z += sign * value;
    sums.zz += sign * value * value;
    sums.count += sign;
  }
}

// The ring holds the values that were added, so the same bits are taken off.
void FitWindow::Push(std::span<const double> z) {
  static const double kMost = std::sqrt(kMaxSquaredDistance);
  float* row = &ring_[static_cast<std::size_t>(next_) * channels_];
  for (std::size_t c = 0; c < channels_; ++c) {
    if (full()) {
      Add(row[c], -1, sums_[c]);
    }
    row[c] = static_cast<float>(std::clamp(z[c], -kMost, kMost));
    Add(row[c], 1, sums_[c]);
  }
  next_ = (next_ + 1) % length_;
  filled_ = std::min(filled_ + 1, length_);
}

double FitWindow::mean(std::size_t channel) const {
  const Sums& sums = sums_[channel];
  return 2 * sums.count < filled_ ? std::numeric_limits<double>::quiet_NaN()
                                  : sums.z / sums.count;
}

double FitWindow::square(std::size_t channel) const {
  const Sums& sums = sums_[channel];
  return 2 * sums.count < filled_ ? std::numeric_limits<double>::quiet_NaN()
                                  : std::max(0.0, sums.zz) / sums.count;
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

void AccountedShare::Fade(double memory) {
  for (double* sum : {&seen_, &left_, &noise_, &count_}) {
    *sum *= memory;
  }
}

void AccountedShare::Push(double normal, double residual) {
  const double most = std::max(normal * normal, residual * residual);
  const double weight = std::min(1.0, kMaxSquaredDistance / most);
  seen_ += weight * normal * normal;
  left_ += weight * residual * residual;
  noise_ += weight;
  count_ += 1.0;
}

}  // namespace fdi
