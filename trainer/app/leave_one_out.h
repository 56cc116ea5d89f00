#pragma once

#include <map>
#include <vector>

#include "trainer/app/evaluated_run.h"

namespace fdi::trainer {

/// How the runs of one fault ended for a set that does not know it.
struct LeftOutFault {
  int fault{0};
  int runs{0};
  int detected{0};
  int unknown{0};        ///< Detected, and no fault named.
  int wrongly_named{0};  ///< Whatever is named is wrong.
  int as_look_alike{0};  ///< Of these, only faults of its group were named.
  std::map<std::vector<int>, int> named;  ///< Final sets and their number.
};

/// Counts runs whose truth is `fault`, scored without it.
///
/// @param group that holds the fault in the whole set.
LeftOutFault CountLeftOut(int fault, const FaultGroup& group,
                          const std::vector<EvaluatedRun>& runs);

/// Sums; `fault` and `named` stay empty.
LeftOutFault SumOf(const std::vector<LeftOutFault>& faults);

}  // namespace fdi::trainer
