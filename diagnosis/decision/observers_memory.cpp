#include "diagnosis/decision/observers_memory.h"

#include <algorithm>
#include <bit>
#include <cstddef>
#include <utility>

#include "diagnosis/decision/look.h"

namespace fdi {

void ObserversMemory::Step(std::int64_t detection_stamp_ns,
                           std::int64_t stamp_ns, FaultSet faults) {
  if (std::exchange(detection_stamp_ns_, detection_stamp_ns) !=
      detection_stamp_ns) {
    seen_ = 0;
    set_back_ns_ = 0;
    last_stamp_ns_ = stamp_ns;
  }
  // A clock that is set back would make the episode younger, and the stamps of
  // before newer than all that follow. So the time since the detection goes on.
  set_back_ns_ += std::max<std::int64_t>(0, last_stamp_ns_ - stamp_ns);
  last_stamp_ns_ = stamp_ns;
  stamp_ns += set_back_ns_;
  seen_ |= faults;
  faults_ = faults;
  // last_ns_ still holds stamps of earlier episodes. It is read only for bits
  // of seen_, which were written in this one.
  const std::int64_t age_ns = stamp_ns - detection_stamp_ns;
  for (FaultSet left = seen_; left != 0; left &= left - 1) {
    const auto bit = static_cast<std::size_t>(std::countr_zero(left));
    const FaultSet fault = FaultSet{1} << bit;
    if ((faults & fault) != 0) {
      last_ns_[bit] = stamp_ns;
    } else if (age_ns > 2 * kLastLookAge &&
               last_ns_[bit] >= stamp_ns - age_ns / 2) {
      faults_ |= fault;
    }
  }
}

}  // namespace fdi
