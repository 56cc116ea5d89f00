#pragma once

#include <cstddef>
#include <span>

namespace fdi::loop {

/// Counts how often X stays within 0.5 % for three samples and more, away from
/// its ends and not always at one place, while OP behind the lag of X moves by
/// 4 % and more: a rod that sticks and slips.
struct Standing {
  std::size_t times{0};
  double share{0.0};  ///< Share of the samples.
  /// Quartiles of what OP moves meanwhile [%].
  double low{0.0};
  double middle{0.0};
  double high{0.0};
};

/// The lag is that of dX(k) = a (OP(k-d) - X(k-1)) + c by least squares, d = 0
/// or 1: records differ in whether OP stands with the X before it or after it.
///
/// @param op, x [%], equally long.
/// @returns none if X follows OP in no such way (r² below 0.1), or is read
///   more seldom than OP: it repeats more than half of its readings.
Standing FindStanding(std::span<const double> op, std::span<const double> x);

}  // namespace fdi::loop
