#pragma once

#include <vector>

namespace fdi::trainer {

/// Pairs that differ, by the sign of the difference.
struct SignTest {
  int positive{0};
  int negative{0};
  int ties{0};  ///< Say nothing.

  int decided() const { return positive + negative; }
};

/// So many pairs must differ before the test can fall below 5 % at all:
/// 2·2⁻⁵ > 0.05 ≥ 2·2⁻⁶.
inline constexpr int kLeastDecidedPairs = 6;

/// Counts the signs of `differences`; NaN is no pair.
SignTest CountSigns(const std::vector<double>& differences);

/// The two-sided exact sign test [Dixon & Mood, 1946]: how probable signs at
/// least as uneven would be if both were equally likely,
///
///     p = min(1, 2 Σ_{i ≤ min(n₊, n₋)} C(n, i) 2⁻ⁿ),   n = n₊ + n₋,
///
/// 1 where no pair differs. Of detected or not, it is McNemar's exact test.
///
/// - [Dixon & Mood, 1946] "The statistical sign test", J. Am. Stat. Assoc.
///   41(236), pp. 557–566.
double PValue(const SignTest& test);

}  // namespace fdi::trainer
