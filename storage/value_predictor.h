#pragma once

#include <cstdint>
#include <optional>
#include <span>

namespace fdi::storage {

// Differences of the file format wrap around, modulo 2⁶⁴.
inline std::int64_t WrapSubtract(std::int64_t a, std::int64_t b) {
  return static_cast<std::int64_t>(static_cast<std::uint64_t>(a) -
                                   static_cast<std::uint64_t>(b));
}
inline std::int64_t WrapAdd(std::int64_t a, std::int64_t b) {
  return static_cast<std::int64_t>(static_cast<std::uint64_t>(a) +
                                   static_cast<std::uint64_t>(b));
}

/// 0, −1, 1, −2, ... as 0, 1, 2, 3, ...
inline std::uint64_t Zigzag(std::int64_t value) {
  return (static_cast<std::uint64_t>(value) << 1U) ^
         static_cast<std::uint64_t>(value >> 63);
}
inline std::int64_t Unzigzag(std::uint64_t value) {
  return static_cast<std::int64_t>((value >> 1U) ^ (~(value & 1U) + 1U));
}

/// All doubles as integers in their order; −0 is one below +0.
std::int64_t Ordered(double value);
double Unordered(std::int64_t ordered);

/// How a column of readings follows from integers: p(n) = n / 10^d for
/// decimals, p(n) = a + q·n for the grid of a converter. Stored in chunks: what
/// operator() returns must never change by a bit.
struct ValuePredictor {
  static constexpr std::uint8_t kGrid = 1;
  static constexpr std::uint8_t kDecimal = 16;  ///< + d
  static constexpr int kMaxDecimals = 9;
  static bool IsKind(std::uint8_t kind) {
    return kind == kGrid ||
           (kind >= kDecimal && kind <= kDecimal + kMaxDecimals);
  }

  std::uint8_t kind{kGrid};
  double origin{0.0};  ///< a
  double step{1.0};    ///< q

  double operator()(std::int64_t n) const;
  /// The nearest n, at most one beside it; 0 where there is none that is exact.
  std::int64_t Nearest(double value) const;
  /// How many units in the last place `value` is above p(n).
  std::int64_t Correction(double value, std::int64_t n) const;
  std::int64_t Correction(double value) const {
    return Correction(value, Nearest(value));
  }
};

/// The predictor that meets nearly all values (15 of 16: a few bad readings
/// spoil no column), if there is one.
/// @param hint of the column before it, if there is one: taken at once if it
///   meets these values too, which spares the search.
std::optional<ValuePredictor> FindPredictor(
    std::span<const double> values,
    const std::optional<ValuePredictor>& hint = std::nullopt);

}  // namespace fdi::storage
