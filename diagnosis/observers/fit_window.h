#pragma once

#include <cstddef>
#include <limits>
#include <span>
#include <vector>

#include "diagnosis/model/model_set.h"

namespace fdi {

/// Extrapolation excuses a residual of some deviations, not any: an observer
/// far from where it was trained cannot be said to fit. In variances.
inline constexpr double kMaxFitVariance = 10.0;

/// The set says how faults that act fit (FitBounds).
bool JudgesFit(const ModelSet& models);

/// Fit of an explanation over the last t_k samples: the mean m and the mean
/// square q of z = r/√S by channel, |z| bounded at 5. A reading of which
/// nothing is known, or that is beyond a limit of its transmitter as predicted,
/// has no z; a channel with a z in less than half of the samples says nothing.
class FitWindow {
 public:
  FitWindow(int length, std::size_t channels);

  void Restart();

  /// @param z by channel; NaN abstains.
  void Push(std::span<const double> z);

  bool full() const { return filled_ == length_; }

  /// Ratio of m or q of a channel to its limits: 1 at a limit, 0 where nothing
  /// is known. With fewer than t_k samples the limits are wider.
  double Excess(std::size_t channel, const FitBounds& limits) const;

  /// m; NaN where the channel says nothing.
  double mean(std::size_t channel) const;
  double square(std::size_t channel) const;

 private:
  struct Sums {  // over the window
    double z{0.0};
    double zz{0.0};
    int count{0};
  };

  static void Add(float z, int sign, Sums& sums);

  int length_;
  std::size_t channels_;
  int filled_{0};
  int next_{0};
  std::vector<float> ring_;  // by sample and channel
  std::vector<Sums> sums_;
};

/// Share of what normal operation does not explain in a channel that another
/// explanation accounts for. With r_0 and r their residuals in deviations of
/// the normal one, both scaled down where one of them is beyond 5,
///
///     (Σ r_0² − Σ r²)/(Σ r_0² − n).
///
/// An explanation that only tolerates what it sees has about 0, the right one
/// 1, one whose effect is off by half 3/4.
class AccountedShare {
 public:
  static constexpr double kLeast = 0.5;      ///< For one that explains, and
  static constexpr double kLeastOwn = 0.75;  ///< in the data of its own fault.

  /// Reduces the weight of all samples so far.
  void Fade(double memory);
  void Push(double normal, double residual);

  /// Normal operation is off by more than another day would make it, over
  /// `least` samples or more.
  bool tells(int least) const {
    return count_ >= 0.9 * least && seen_ > kTelling * count_;
  }
  /// Mean of r_0².
  double normal() const { return seen_ / count_; }
  double share() const { return (seen_ - left_) / (seen_ - noise_); }

 private:
  static constexpr double kTelling = 3.0;  // mean of r_0²

  double seen_{0.0};
  double left_{0.0};
  double noise_{0.0};
  double count_{0.0};
};

}  // namespace fdi
