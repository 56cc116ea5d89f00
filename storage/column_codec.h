#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "storage/bytes.h"
#include "storage/value_predictor.h"

namespace fdi::storage {

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

}  // namespace fdi::storage
