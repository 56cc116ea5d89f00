#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "storage/database/bytes.h"

namespace fdi::storage {

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

/// Writes integers x_i as residuals of the order k ∈ {0, 1, 2} that takes the
/// fewest bits: x_i − median, x_i − x_{i−1}, or second differences (all modulo
/// 2⁶⁴), zigzag coded and cut into planes of bytes, so that the deflation that
/// follows meets like beside like. A constant costs 9 bytes.
void WriteIntegers(ByteWriter& writer, std::span<const std::int64_t> values);
std::vector<std::int64_t> ReadIntegers(ByteReader& reader, std::size_t count);

/// Writes doubles, bit for bit, as integers n_i and corrections c_i,
///
///     v_i = p(n_i) moved by c_i units in the last place,
///
/// where p(n) = n / 10^d for decimals, a + q·n for the grid of a converter, or
/// none of them: the ordered bits themselves.
/// A column of equal bits costs 10 bytes.
/// @param hint p of the column before it, if any; is given that of this one.
void WriteDoubles(ByteWriter& writer, std::span<const double> values,
                  std::optional<ValuePredictor>* hint = nullptr);
std::vector<double> ReadDoubles(ByteReader& reader, std::size_t count);

/// CRC-32 as in zlib.
std::uint32_t Crc32(std::span<const std::byte> bytes);
std::vector<std::byte> Deflate(std::span<const std::byte> raw);
/// @param where the bytes come from, for the message.
/// @throws DataError unless `packed` inflates to `size` bytes.
std::vector<std::byte> Inflate(std::span<const std::byte> packed,
                               std::size_t size, std::string_view where);

}  // namespace fdi::storage
