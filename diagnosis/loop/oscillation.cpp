#include "diagnosis/loop/oscillation.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <numeric>
#include <vector>

#include <Eigen/Dense>
#include <unsupported/Eigen/FFT>

namespace fdi::loop {
namespace {

constexpr std::size_t kMaxCrossings = 11;
constexpr std::size_t kMinCrossings = 4;
constexpr double kHarmonics = 7.0;

std::vector<double> WithoutTrend(std::span<const double> signal) {
  const auto n = static_cast<double>(signal.size());
  const double mean = std::accumulate(signal.begin(), signal.end(), 0.0) / n;
  double slope = 0.0;
  for (std::size_t k = 0; k < signal.size(); ++k) {
    slope += (static_cast<double>(k) - 0.5 * (n - 1.0)) * (signal[k] - mean);
  }
  slope *= 12.0 / (n * (n * n - 1.0));
  std::vector<double> rest(signal.size());
  for (std::size_t k = 0; k < signal.size(); ++k) {
    rest[k] =
        signal[k] - mean - slope * (static_cast<double>(k) - 0.5 * (n - 1.0));
  }
  return rest;
}

// Lags at which the autocorrelation crosses zero, interpolated.
std::vector<double> Crossings(const std::vector<double>& signal) {
  const auto n = static_cast<Eigen::Index>(signal.size());
  const Eigen::Map<const Eigen::VectorXd> all(signal.data(), n);
  std::vector<double> crossings;
  double before = all.squaredNorm();
  for (Eigen::Index lag = 1; lag <= n / 2 && crossings.size() < kMaxCrossings;
       ++lag) {
    const double now = all.tail(n - lag).dot(all.head(n - lag));
    if ((before > 0.0) != (now > 0.0)) {
      crossings.push_back(static_cast<double>(lag) - now / (now - before));
    }
    before = now;
  }
  return crossings;
}

// Without its mean and without frequencies above the 7th harmonic of 1/T.
std::vector<double> LowPassed(const std::vector<double>& signal,
                              double period) {
  const std::size_t n = signal.size();
  const auto last =
      static_cast<std::size_t>(kHarmonics * static_cast<double>(n) / period);
  Eigen::FFT<double> transform;
  std::vector<std::complex<double>> spectrum;
  transform.fwd(spectrum, signal);
  spectrum[0] = 0.0;
  for (std::size_t j = 1; j < n; ++j) {
    if (std::min(j, n - j) > last) {
      spectrum[j] = 0.0;
    }
  }
  std::vector<double> smooth;
  transform.inv(smooth, spectrum);
  return smooth;
}

// The least Σ (y - A f)² over A for half a sine, and for a triangle of any
// apex; the samples are at the middles of equal parts.
struct ShapeErrors {
  double sine{0.0};
  double triangle{0.0};
};
ShapeErrors FitShapes(std::span<const double> y) {
  const std::size_t n = y.size();
  const auto at = [n](std::size_t k) {
    return (static_cast<double>(k) + 0.5) / static_cast<double>(n);
  };
  double yy = 0.0;
  double sine_y = 0.0;
  double sines = 0.0;
  // Sums for the falling side, here all of it: Σ y (1 - x), Σ (1 - x)².
  double fall_y = 0.0;
  double falls = 0.0;
  for (std::size_t k = 0; k < n; ++k) {
    const double sine = std::sin(std::numbers::pi * at(k));
    yy += y[k] * y[k];
    sine_y += y[k] * sine;
    sines += sine * sine;
    fall_y += y[k] * (1.0 - at(k));
    falls += (1.0 - at(k)) * (1.0 - at(k));
  }
  double rise_y = 0.0;  // Σ y x, Σ x².
  double rises = 0.0;
  double largest = 0.0;  // (Σ y f)² / Σ f²
  for (std::size_t k = 0; k < n; ++k) {
    const double apex = at(k);  // The first sample of the falling side.
    const double yf = rise_y / apex + fall_y / (1.0 - apex);
    const double ff =
        rises / (apex * apex) + falls / ((1.0 - apex) * (1.0 - apex));
    largest = std::max(largest, yf * yf / ff);
    rise_y += y[k] * apex;
    rises += apex * apex;
    fall_y -= y[k] * (1.0 - apex);
    falls -= (1.0 - apex) * (1.0 - apex);
  }
  return {yy - sine_y * sine_y / sines, yy - largest};
}

double ShapeOf(const std::vector<double>& signal) {
  double sine = 0.0;
  double triangle = 0.0;
  std::size_t begin = signal.size();  // The first half cycle is cut off.
  for (std::size_t k = 1; k < signal.size(); ++k) {
    if ((signal[k] > 0.0) == (signal[k - 1] > 0.0)) {
      continue;
    }
    if (begin < k && k - begin >= 3) {
      const ShapeErrors errors =
          FitShapes(std::span(signal).subspan(begin, k - begin));
      sine += errors.sine;
      triangle += errors.triangle;
    }
    begin = k;
  }
  return sine + triangle > 0.0 ? sine / (sine + triangle) : 0.5;
}

}  // namespace

std::optional<Oscillation> FindOscillation(std::span<const double> signal) {
  if (signal.size() < 8) {
    return std::nullopt;
  }
  const std::vector<double> rest = WithoutTrend(signal);
  const std::vector<double> crossings = Crossings(rest);
  if (crossings.size() < kMinCrossings) {
    return std::nullopt;
  }
  Oscillation found;
  const auto n = static_cast<double>(crossings.size() - 1);
  found.period = 2.0 * (crossings.back() - crossings.front()) / n;
  double squares = 0.0;
  for (std::size_t i = 1; i < crossings.size(); ++i) {
    const double off = 2.0 * (crossings[i] - crossings[i - 1]) - found.period;
    squares += off * off;
  }
  const double deviation = std::sqrt(squares / n);
  // A sampled period cannot be told to better than a tenth of a sample.
  found.regularity = found.period / (3.0 * std::max(deviation, 0.1));
  found.shape = ShapeOf(LowPassed(rest, found.period));
  return found;
}

}  // namespace fdi::loop
