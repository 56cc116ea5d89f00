#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

namespace fdi {

/// The least of the last `samples` values of each of some series: a detection
/// needs that many in a row beyond a limit. Zeros at the start keep fewer from
/// counting. One array holds all series, because the cache misses of
/// a vector for each of them took a sixth of an engine's time with 1000 valves.
class Sustained {
 public:
  explicit Sustained(int samples, std::size_t series = 1)
      : last_(static_cast<std::size_t>(samples) * series), next_(series) {}

  void Restart() { std::fill(last_.begin(), last_.end(), 0.0); }
  /// Returns the least one, or `most` if that is more. The last values are only
  /// read if the newest one is above `most`, which is rare.
  double Push(double value, std::size_t series = 0,
              double most = -std::numeric_limits<double>::infinity()) {
    Keep(value, series);
    return value > most ? Least(1.0, series, most) : most;
  }
  /// The same for the absolute values, if all have the sign of the newest one.
  double PushSigned(double value, std::size_t series, double most) {
    Keep(value, series);
    return std::abs(value) > most
               ? Least(std::copysign(1.0, value), series, most)
               : most;
  }

 private:
  void Keep(double value, std::size_t series) {
    std::uint16_t& next = next_[series];
    last_[next * next_.size() + series] = value;
    next = static_cast<std::uint16_t>(
        (next + 1U) * next_.size() < last_.size() ? next + 1U : 0U);
  }
  double Least(double side, std::size_t series, double most) const {
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t k = series; k < last_.size(); k += next_.size()) {
      least = std::min(least, side * last_[k]);
    }
    return std::max(least, most);
  }

  std::vector<double> last_;  // A row for each sample.
  std::vector<std::uint16_t> next_;
};

}  // namespace fdi
