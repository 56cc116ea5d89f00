#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "diagnosis/sample.h"

namespace fdi {

/// The nineteen actuator faults of the DAMADICS benchmark, numbered 1..19.
inline constexpr int kFaultCount = 19;

/// Faults outside the benchmark follow: of the transmitters of T1, P1 and P2.
inline constexpr int kTemperatureTransmitterFault = 20;
inline constexpr int kInletPressureTransmitterFault = 21;
inline constexpr int kOutletPressureTransmitterFault = 22;
/// All faults are 1..kLastFault.
inline constexpr int kLastFault = kOutletPressureTransmitterFault;

/// The names of all faults, for messages and help.
inline constexpr std::string_view kFaultNames = "f1..f19, t1, p1, p2";

struct FaultFacts {
  std::string_view name;         ///< "f1" or, beyond 19, "t1", "p1", "p2".
  std::string_view description;  ///< "valve clogging".
  std::string_view paper_name;   ///< "F1".."F5", or empty.
  bool is_signed;                ///< Strength in [-1, 1], else in [0, 1].
};

/// @throws std::invalid_argument if `fault` is not in 1..22.
const FaultFacts& FaultFactsOf(int fault);

/// "f19", "t1"; "normal" for 0; "unknown" for anything else.
std::string FaultName(int fault);

/// The fault called `name`, in any case: one of kFaultNames, or paper1..paper5
/// for the five faults of [Mendonça et al., 2009] (f1 f3 f6 f7 f19).
std::optional<int> ParseFault(std::string_view name);

/// The signal whose transmitter is at fault: T1, P1 or P2 for 20, 21, 22.
std::optional<Signal> TransmitterOf(int fault);

/// For messages: " (did you mean 'f19'?)", or "" if `name` is not nearly the
/// name of a fault or one of `others`.
std::string DidYouMeanFault(std::string_view name,
                            std::vector<std::string> others = {});

/// As ParseFault(). @throws ConfigError naming the accepted names.
int RequireFault(std::string_view name);

}  // namespace fdi
