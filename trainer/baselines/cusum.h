#pragma once

#include <vector>

namespace fdi::trainer {

/// Two-sided CUSUM test [Page, 1954] on a standardised residual z,
///
///     g⁺ ← max(0, g⁺ + z − ν),   g⁻ ← max(0, g⁻ − z − ν),
///
/// with drift ν = 0.5: it is the best test for a step of one deviation. Sums
/// are held at twice the limit, so that an alarm ends soon after its cause.
///
/// - [Page, 1954] "Continuous inspection schemes", Biometrika 41, pp. 100–115.
class Cusum {
 public:
  static constexpr double kDrift = 0.5;  ///< ν

  /// @param limit h > 0 of both sums.
  explicit Cusum(double limit) : limit_(limit) {}

  void Reset();

  /// Takes the next residual. @returns the sign of the change: +1 or −1 where
  /// g⁺ or g⁻ exceeds the limit (the larger one if both do), else 0.
  int Step(double residual);

 private:
  double limit_;
  double up_{0.0};
  double down_{0.0};
};

/// The limit that max(g⁺, g⁻) exceeds `rate` times per sample, by the tail fit
/// of the thresholds (trainer/tail_fit.h) over series without fault.
///
/// @param series standardised residuals, one series per stretch of time; at
///   least 100 in all.
/// @throws DataError if there are fewer.
double CusumLimit(const std::vector<std::vector<double>>& series, double rate);

}  // namespace fdi::trainer
