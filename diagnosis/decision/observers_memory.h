#pragma once

#include <array>
#include <cstdint>

#include "diagnosis/model/model_set.h"

namespace fdi {

/// Remembers what the observers name. Near the limits of what they can see,
/// their answer changes with the noise. From ten minutes after the detection
/// on, it is therefore every fault that they isolated in the second half of the
/// episode.
class ObserversMemory {
 public:
  /// The observers isolate `faults` at `stamp_ns`.
  void Step(std::int64_t detection_stamp_ns, std::int64_t stamp_ns,
            FaultSet faults);

  FaultSet faults() const { return faults_; }

 private:
  std::int64_t detection_stamp_ns_{0};
  std::int64_t last_stamp_ns_{0};                   // Stamp of the last sample.
  std::int64_t set_back_ns_{0};                     // As of LookTask.
  std::array<std::int64_t, kMaxFaults> last_ns_{};  // When each was isolated.
  FaultSet seen_{0};                                // Those that ever were.
  FaultSet faults_{0};
};

}  // namespace fdi
