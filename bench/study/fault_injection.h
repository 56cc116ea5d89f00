#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "diagnosis/model/sample.h"
#include "simulator/fault_schedule.h"
#include "simulator/valve_parameters.h"
#include "storage/runs/runs.h"

namespace fdi::trainer::study {

/// Faults to put onto a record, and the valve that it comes from.
struct FaultInjection {
  std::vector<simulator::FaultSchedule> faults;  ///< Times from its start.
  simulator::ValveParameters valve;  ///< Trim, and ranges of transmitters.
};

/// The signals that the faults change or are computed from.
/// @throws ConfigError naming a fault that cannot be put onto a record, and
///   those that can: the readings alone do not tell the effect of the others.
SignalMask SignalsFor(const FaultInjection& injection);

/// The signals that the faults change. @throws as SignalsFor()
SignalMask ChangedSignals(const FaultInjection& injection);

/// Makes of a healthy record what the transmitters would have read with the
/// faults acting; clamped to their ranges. With the sizes of
/// simulator/fault_effects.h:
///
///     f5, f19      F · (1 − loss) · reading factor
///     f6, f18      F + g (q_fault − q),  g = F/q within [1/2, 2]
///     f7           T1 + rise, at most 300 °C
///     t1, p1, p2   reading + step · span, or held (flatline)
///
/// q is the flow of equation (12) at the recorded P1, P2 and X (at 20 °C where
/// T1 is not recorded); where g is not at a bound this is F · q_fault/q.
class FaultInjector {
 public:
  /// @throws ConfigError as SignalsFor().
  explicit FaultInjector(FaultInjection injection);

  /// The next sample of the record, with the truth. A sample without fault, or
  /// with a needed reading that is missing or not finite, keeps its readings.
  LabelledSample Step(const Sample& healthy, double time_s);

 private:
  void ChangeReadings(const simulator::FaultEffects& effects, Sample& sample);
  void HoldFlatlines(double time_s, Sample& sample);

  FaultInjection injection_;
  SignalMask needed_;
  std::vector<std::optional<double>> held_;  // Per fault: its flatline.
};

/// A record with faults put onto it.
struct InjectedRun {
  storage::StoredRun run;
  std::string source;  ///< Run or file.
  std::vector<std::string> faults;
  std::vector<std::string> left_out;  ///< Effects that are missing, in words.
  std::int64_t faulty{0};             ///< Samples with a fault.
  std::int64_t at_limit{0};  ///< Those with the flow at its range's end.
};

/// Puts the faults onto all samples of a stored run or stretch, which is not
/// empty.
///
/// @param range_is_given the range of the flow is of this run, in its unit.
/// @throws DataError if the run lacks a signal that the faults need, or has a
///   fault already; ConfigError if its flow is in another unit than the valve's
///   transmitter, or a fault starts after its end.
InjectedRun InjectInto(storage::StoredRun run, const FaultInjection& injection,
                       bool range_is_given);

}  // namespace fdi::trainer::study
