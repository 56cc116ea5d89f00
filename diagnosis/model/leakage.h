#pragma once

#include "diagnosis/model/fault_catalogue.h"

namespace fdi {

/// Where a fault loses flow.
enum class Leak {
  kNone,
  kOutside,  ///< Out of the line, all the time.
  kThrough,  ///< Past the plug: a loss only while the valve is shut.
};

/// Share of the flow that external leakage (f5) of full strength loses [-].
inline constexpr double kExternalLeakShare = 0.05;

inline constexpr int kExternalLeakage = 5;
inline constexpr int kInternalLeakage = 6;
inline constexpr int kBypassOpen = 18;
static_assert(kFaultCatalogue[kExternalLeakage - 1].name == "f5" &&
              kFaultCatalogue[kInternalLeakage - 1].name == "f6" &&
              kFaultCatalogue[kBypassOpen - 1].name == "f18");

/// @param fault or finding of the catalogue.
constexpr Leak LeakOf(int fault) {
  return fault == kExternalLeakage ? Leak::kOutside
         : fault == kInternalLeakage || fault == kBypassOpen ||
                 fault == kShutFlow
             ? Leak::kThrough
             : Leak::kNone;
}

}  // namespace fdi
