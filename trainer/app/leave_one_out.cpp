#include "trainer/app/leave_one_out.h"

#include <algorithm>

namespace fdi::trainer {

LeftOutFault CountLeftOut(int fault, const FaultGroup& group,
                          const std::vector<EvaluatedRun>& runs) {
  LeftOutFault result;
  result.fault = fault;
  for (const EvaluatedRun& run : runs) {
    const std::vector<int>& set = run.indices.final_set;
    ++result.runs;
    result.detected += run.indices.detected;
    if (set.empty()) {
      result.unknown += run.indices.detected;
      continue;
    }
    ++result.wrongly_named;
    ++result.named[set];
    result.as_look_alike +=
        std::includes(group.begin(), group.end(), set.begin(), set.end());
  }
  return result;
}

LeftOutFault SumOf(const std::vector<LeftOutFault>& faults) {
  LeftOutFault sum;
  for (const LeftOutFault& left_out : faults) {
    sum.runs += left_out.runs;
    sum.detected += left_out.detected;
    sum.unknown += left_out.unknown;
    sum.wrongly_named += left_out.wrongly_named;
    sum.as_look_alike += left_out.as_look_alike;
  }
  return sum;
}

}  // namespace fdi::trainer
