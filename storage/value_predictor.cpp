#include "storage/value_predictor.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <vector>

namespace fdi::storage {
namespace {

constexpr double kMaxExact = 9007199254740992.0;  // 2⁵³

constexpr std::array<double, ValuePredictor::kMaxDecimals + 1> kPowers{
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9};

/// Shares of misfits up to 1/16 pass: a few bad readings spoil no column.
bool Fits(const ValuePredictor& predictor, std::span<const double> values,
          std::int64_t tolerance) {
  std::size_t misfits = 0;
  for (const double value : values) {
    const std::int64_t off = predictor.Correction(value);
    if (off > tolerance || off < -tolerance) {
      if (++misfits * 16 > values.size()) {
        return false;
      }
    }
  }
  return true;
}

std::uint64_t CorrectionBits(const ValuePredictor& predictor,
                             std::span<const double> values) {
  std::uint64_t bits = 0;
  for (const double value : values) {
    bits += static_cast<std::uint64_t>(
        std::bit_width(Zigzag(predictor.Correction(value))));
  }
  return bits;
}

/// As good as a search: no fewer decimals would do; a grid is met to one bit.
bool MeetsAgain(const ValuePredictor& hint, std::span<const double> values) {
  if (hint.kind == ValuePredictor::kGrid) {
    return Fits(hint, values, 64) &&
           CorrectionBits(hint, values) <= values.size();
  }
  ValuePredictor coarser = hint;
  --coarser.kind;
  return Fits(hint, values, 0) &&
         (hint.kind == ValuePredictor::kDecimal || !Fits(coarser, values, 0));
}

/// Greatest common divisor of two lengths known up to `tolerance`.
double CommonStep(double a, double b, double tolerance) {
  while (b > tolerance) {
    double rest = std::fmod(a, b);
    if (b - rest < tolerance) {
      rest = 0.0;
    }
    a = b;
    b = rest;
  }
  return a;
}

/// The step of the grid that the sorted values lie on, 0 if none shows.
double GridStep(const std::vector<double>& sorted) {
  const double largest =
      std::max(std::abs(sorted.front()), std::abs(sorted.back()));
  const double tolerance = largest * 1e-12;
  std::vector<double> gaps;
  for (std::size_t i = 1; i < sorted.size(); ++i) {
    if (sorted[i] - sorted[i - 1] > tolerance) {
      gaps.push_back(sorted[i] - sorted[i - 1]);
    }
  }
  if (gaps.empty()) {
    return 0.0;
  }
  std::sort(gaps.begin(), gaps.end());
  double step = gaps.front();
  for (std::size_t i = 1; i < std::min<std::size_t>(gaps.size(), 16); ++i) {
    step = CommonStep(gaps[i], step, tolerance);
  }
  return step > 16.0 * tolerance ? step : 0.0;
}

/// A grid through `origin`, its step such that `far` is met best.
std::optional<ValuePredictor> BestGrid(std::span<const double> values,
                                       double origin, double far, double step) {
  const double count = std::round((far - origin) / step);
  if (count == 0.0 || !(std::abs(count) < kMaxExact)) {
    return std::nullopt;
  }
  double q = (far - origin) / count;
  q = std::nextafter(std::nextafter(q, 0.0), 0.0);
  std::optional<ValuePredictor> best;
  std::uint64_t least = std::numeric_limits<std::uint64_t>::max();
  for (int i = 0; i < 5; ++i) {
    const ValuePredictor candidate{ValuePredictor::kGrid, origin, q};
    if (Fits(candidate, values, 64)) {
      const std::uint64_t bits = CorrectionBits(candidate, values);
      if (bits < least) {
        least = bits;
        best = candidate;
      }
    }
    q = std::nextafter(q, std::numeric_limits<double>::infinity());
  }
  return best;
}

std::optional<ValuePredictor> FindGrid(std::span<const double> values) {
  std::vector<double> sorted;
  sorted.reserve(values.size());
  for (const double value : values) {
    if (std::isfinite(value) && std::abs(value) < 1e150) {
      sorted.push_back(value);
    }
  }
  if (sorted.size() < 8 || sorted.size() * 16 < values.size() * 15) {
    return std::nullopt;
  }
  std::sort(sorted.begin(), sorted.end());
  const double step = GridStep(sorted);
  if (step == 0.0) {
    return std::nullopt;
  }
  const double low = sorted.front();
  const double high = sorted.back();
  const double far = std::abs(low) > std::abs(high) ? low : high;
  const auto from_zero = BestGrid(values, 0.0, far, step);
  const auto from_low = BestGrid(values, low, high, step);
  if (from_zero && from_low) {
    return CorrectionBits(*from_zero, values) <=
                   CorrectionBits(*from_low, values)
               ? from_zero
               : from_low;
  }
  return from_zero ? from_zero : from_low;
}

}  // namespace

std::int64_t Ordered(double value) {
  const auto bits = std::bit_cast<std::int64_t>(value);
  return bits < 0 ? WrapSubtract(std::numeric_limits<std::int64_t>::min(),
                                 WrapAdd(bits, 1))
                  : bits;
}

double Unordered(std::int64_t ordered) {
  return std::bit_cast<double>(
      ordered < 0
          ? WrapSubtract(
                WrapSubtract(std::numeric_limits<std::int64_t>::min(), ordered),
                1)
          : ordered);
}

double ValuePredictor::operator()(std::int64_t n) const {
  const auto x = static_cast<double>(n);
  return kind == kGrid ? origin + step * x
                       : x / kPowers[std::size_t{kind} - kDecimal];
}

std::int64_t ValuePredictor::Nearest(double value) const {
  const double x = kind == kGrid
                       ? (value - origin) / step
                       : value * kPowers[std::size_t{kind} - kDecimal];
  return std::abs(x) < kMaxExact  // NaN: 0
             ? static_cast<std::int64_t>(x < 0.0 ? x - 0.5 : x + 0.5)
             : 0;
}

std::int64_t ValuePredictor::Correction(double value, std::int64_t n) const {
  const double predicted = (*this)(n);
  return std::bit_cast<std::int64_t>(predicted) ==
                 std::bit_cast<std::int64_t>(value)
             ? 0
             : WrapSubtract(Ordered(value), Ordered(predicted));
}

std::optional<ValuePredictor> FindPredictor(
    std::span<const double> values, const std::optional<ValuePredictor>& hint) {
  if (hint && MeetsAgain(*hint, values)) {
    return hint;
  }
  for (int d = 0; d <= ValuePredictor::kMaxDecimals; ++d) {
    const ValuePredictor decimal{
        static_cast<std::uint8_t>(ValuePredictor::kDecimal + d), 0.0, 1.0};
    if (Fits(decimal, values, 0)) {
      return decimal;
    }
  }
  return FindGrid(values);
}

}  // namespace fdi::storage
