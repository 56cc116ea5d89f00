#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace fdi {

/// The least of the last `samples` values: a detection needs that many in a row
/// beyond a limit. Zeros at the start keep fewer from counting.
class Sustained {
 public:
  explicit Sustained(int samples)
      : last_(static_cast<std::size_t>(samples), 0.0) {}

  void Restart() { std::fill(last_.begin(), last_.end(), 0.0); }
  double Push(double value) {
    last_[next_] = value;
    next_ = (next_ + 1) % last_.size();
    return *std::min_element(last_.begin(), last_.end());
  }

 private:
  std::vector<double> last_;
  std::size_t next_{0};
};

}  // namespace fdi
