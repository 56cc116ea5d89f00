#pragma once

namespace fdi::trainer::study {

struct Interval {
  double low{0.0};
  double high{1.0};
};

/// 95 % interval of a probability from k successes in n independent trials
/// [Wilson, 1927], with z = 1.96:
///
///     (p + z²/2n ± z √(p (1 − p)/n + z²/4n²)) / (1 + z²/n),   p = k/n;
///
/// [0, 1] for n = 0. Unlike p ± z √(p (1 − p)/n) it stays within [0, 1] and has
/// a width at p = 0 and p = 1.
///
/// @throws std::invalid_argument unless 0 ≤ k ≤ n.
///
/// - [Wilson, 1927] "Probable inference, the law of succession, and statistical
///   inference", J. Am. Stat. Assoc. 22(158), pp. 209–212.
Interval WilsonInterval(int successes, int trials);

}  // namespace fdi::trainer::study
