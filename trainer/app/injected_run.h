#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "storage/run_types.h"
#include "trainer/app/fault_injection.h"

namespace fdi::trainer {

/// A record with faults put onto it.
struct InjectedRun {
  storage::StoredRun run;
  std::string source;  ///< Run or file.
  std::vector<std::string> faults;
  std::vector<std::string> left_out;
  std::int64_t faulty{0};    ///< Samples with a fault.
  std::int64_t at_limit{0};  ///< Of them, with the flow at its range's end.
};

/// Stamp of the first sample of `run` [ns]: the faults' times start there.
std::int64_t StartOf(const storage::StoredRun& run);

/// Puts the faults onto all samples of a stored run or stretch.
///
/// @param range_is_given the range of the flow is of this run, in its unit.
/// @throws DataError if the run lacks a signal that the faults need, or has a
///   fault already; ConfigError if its flow is in another unit than the valve's
///   transmitter, or a fault starts after its end.
InjectedRun InjectInto(storage::StoredRun run, const FaultInjection& injection,
                       bool range_is_given);

}  // namespace fdi::trainer
