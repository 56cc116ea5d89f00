#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "storage/database/bytes.h"

namespace fdi::storage {

/// Maps integers to the readings of a column: p(n) = n / 10^d for decimals,
/// p(n) = a + q·n for the grid of a converter. Part of the file format: the
/// result of operator() must never change by a single bit.
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
  /// The nearest n, off by at most one; 0 if none is exactly representable.
  std::int64_t Nearest(double value) const;
  /// By how many units in the last place `value` exceeds p(n).
  std::int64_t Correction(double value, std::int64_t n) const;
  std::int64_t Correction(double value) const {
    return Correction(value, Nearest(value));
  }
};

/// The predictor that fits nearly all values (15 of 16, so that a few bad
/// readings do not spoil a column), if there is one.
/// @param hint predictor of the preceding column, if any: returned at once if
///   it fits these values, too, which saves the search.
std::optional<ValuePredictor> FindPredictor(
    std::span<const double> values,
    const std::optional<ValuePredictor>& hint = std::nullopt);

/// Writes integers x_i as residuals of the order k ∈ {0, 1, 2} that takes the
/// fewest bits: x_i − median, x_i − x_{i−1}, or second differences (all modulo
/// 2⁶⁴), zigzag coded and split into byte planes, so that the subsequent
/// deflate finds similar bytes side by side. A constant costs 9 bytes.
void WriteIntegers(ByteWriter& writer, std::span<const std::int64_t> values);
std::vector<std::int64_t> ReadIntegers(ByteReader& reader, std::size_t count);

/// Writes doubles, bit for bit, as integers n_i and corrections c_i,
///
///     v_i = p(n_i) moved by c_i units in the last place,
///
/// where p(n) = n / 10^d for decimals, a + q·n for the grid of a converter;
/// without a predictor, the ordered bits themselves.
/// A column of equal bits costs 10 bytes.
/// @param hint p of the preceding column, if any; updated to that of this one.
void WriteDoubles(ByteWriter& writer, std::span<const double> values,
                  std::optional<ValuePredictor>* hint = nullptr);
std::vector<double> ReadDoubles(ByteReader& reader, std::size_t count);

/// CRC-32 as in zlib.
std::uint32_t Crc32(std::span<const std::byte> bytes);
std::vector<std::byte> Deflate(std::span<const std::byte> raw);
/// @param where the bytes come from, for error messages.
/// @throws DataError unless `packed` inflates to `size` bytes.
std::vector<std::byte> Inflate(std::span<const std::byte> packed,
                               std::size_t size, std::string_view where);

}  // namespace fdi::storage
