#pragma once

#include <limits>
#include <string>
#include <string_view>
#include <vector>

#include "diagnosis/model/sample.h"
#include "simulator/fault_effects.h"

namespace fdi::simulator {

/// The time profile of one fault. Its strength is 0 before start_s, ramps
/// linearly from initial_strength to final_strength over development_s, stays
/// there, and is 0 again from end_s on.
struct FaultSchedule {
  int fault{0};               ///< 1..kLastFault.
  double start_s{0.0};        ///< From the first sample, >= 0.
  double development_s{0.0};  ///< >= 0; 0 = abrupt.
  double initial_strength{0.0};
  double final_strength{1.0};
  double end_s{std::numeric_limits<double>::infinity()};  ///< > start_s.
  /// From start_s on, the reading stays at the first sample's value; t1, p1, p2
  /// only. No effect on the process, no development; strength 1.
  bool flatline{false};
};

/// The accepted forms, for messages and help.
inline constexpr std::string_view kFaultForms =
    "FAULT:abrupt@START[:strength=S][:until=T] or "
    "FAULT:incipient@START+DURATION[:from=S0][:strength=S][:until=T] or "
    "t1|p1|p2:flatline@START[:until=T]";

/// Parses "f19:abrupt@50:strength=0.75",
/// "f1:incipient@500+1200:from=0.25:strength=0.6:until=3000" or
/// "t1:flatline@50"; times in s. By default strength is 1 and from is 0.
/// @throws ConfigError naming the text, the reason and kFaultForms.
FaultSchedule ParseFaultSchedule(std::string_view text);

/// The text from which ParseFaultSchedule() restores `schedule`.
std::string ToText(const FaultSchedule& schedule);

/// @throws ConfigError naming field, value and range.
void Validate(const FaultSchedule& schedule);

/// Strength at `time_s`; 0 while the fault is inactive.
double StrengthAt(const FaultSchedule& schedule, double time_s);

/// The first schedule active at `time_s`, else {0, 0}.
FaultTruth TruthAt(const std::vector<FaultSchedule>& schedules, double time_s);

/// All active at `time_s`, combined; flatlines have no such effects.
FaultEffects EffectsAt(const std::vector<FaultSchedule>& schedules,
                       double time_s);

}  // namespace fdi::simulator
