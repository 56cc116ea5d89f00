#include "diagnosis/loop/oscillation.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <numeric>
#include <vector>

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
  std::vector<double> crossings;
  double before =
      std::inner_product(signal.begin(), signal.end(), signal.begin(), 0.0);
  for (std::size_t lag = 1;
       lag <= signal.size() / 2 && crossings.size() < kMaxCrossings; ++lag) {
    const double now =
        std::inner_product(signal.begin() + static_cast<std::ptrdiff_t>(lag),
                           signal.end(), signal.begin(), 0.0);
    if ((before > 0.0) != (now > 0.0)) {
      crossings.push_back(static_cast<double>(lag) - now / (now - before));
    }
    before = now;
  }
  return crossings;
}

// Σ c_j e^(iωjk) over the frequencies ωj = 2πj/N up to the 7th harmonic of 1/T.
std::vector<double> LowPassed(const std::vector<double>& signal,
                              double period) {
  const std::size_t n = signal.size();
  const auto last = std::min(
      n / 2,
      static_cast<std::size_t>(kHarmonics * static_cast<double>(n) / period));
  std::vector<double> smooth(n, 0.0);
  for (std::size_t j = 1; j <= last; ++j) {
    const double step = 2.0 * std::numbers::pi * static_cast<double>(j) /
                        static_cast<double>(n);
    // e^(iωjk) by rotation: sines and cosines would be most of an audit's time.
    const std::complex<double> turn = std::polar(1.0, step);
    std::complex<double> sum;
    std::complex<double> e{1.0, 0.0};
    for (std::size_t k = 0; k < n; ++k, e *= turn) {
      sum += signal[k] * std::conj(e);
    }
    sum *= (2 * j == n ? 1.0 : 2.0) / static_cast<double>(n);
    e = {1.0, 0.0};
    for (std::size_t k = 0; k < n; ++k, e *= turn) {
      smooth[k] += (sum * e).real();
    }
  }
  return smooth;
}

// The least Σ (y - A f)² over A for a form f.
template <typename Form>
double SquaredError(std::span<const double> y, Form form) {
  double yy = 0.0;
  double yf = 0.0;
  double ff = 0.0;
  for (std::size_t k = 0; k < y.size(); ++k) {
    const double f =
        form((static_cast<double>(k) + 0.5) / static_cast<double>(y.size()));
    yy += y[k] * y[k];
    yf += y[k] * f;
    ff += f * f;
  }
  return yy - yf * yf / ff;
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
      const std::span y = std::span(signal).subspan(begin, k - begin);
      sine += SquaredError(
          y, [](double x) { return std::sin(std::numbers::pi * x); });
      double best = INFINITY;
      for (std::size_t i = 0; i < y.size(); ++i) {
        const double apex =
            (static_cast<double>(i) + 0.5) / static_cast<double>(y.size());
        best = std::min(best, SquaredError(y, [apex](double x) {
                          return x < apex ? x / apex : (1.0 - x) / (1.0 - apex);
                        }));
      }
      triangle += best;
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
