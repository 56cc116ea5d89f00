#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "diagnosis/model/model_set.h"

namespace fdi {

/// Refutes faults by how long they have not fitted.
///
/// A fault that fits only some of the time, at another strength each time, is
/// not the one that acts: the command swings, a strength does not. So a misfit
/// counts twice as much as a fit, and a refuted fault stays so until it has
/// fitted for long.
class MisfitCounts {
 public:
  /// @param most misfits in a row that refute one of `faults` faults.
  MisfitCounts(std::size_t faults, int most)
      : refuting_(kWeight * most), counts_(faults) {}

  void Restart() {
    std::ranges::fill(counts_, 0);
    refuted_ = 0;
  }

  /// @param misfits the faults that do not fit this sample; the others do.
  void Push(FaultSet misfits) {
    for (std::size_t i = 0; i < counts_.size(); ++i) {
      int& count = counts_[i];
      count = std::clamp(count + (Has(misfits, i) ? kWeight : -1), 0,
                         2 * refuting_);
      const FaultSet fault = FaultSet{1} << i;
      refuted_ |= count >= refuting_ ? fault : 0;
      refuted_ &= count == 0 ? ~fault : ~FaultSet{0};
    }
  }

  FaultSet refuted() const { return refuted_; }

 private:
  static constexpr int kWeight = 2;  // of a misfit

  int refuting_;
  std::vector<int> counts_;
  FaultSet refuted_{0};
};

}  // namespace fdi
