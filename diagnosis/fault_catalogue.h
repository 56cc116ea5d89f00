#pragma once

#include <array>
#include <iterator>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "diagnosis/sample.h"

namespace fdi {

struct FaultFacts {
  std::string_view name;         ///< "f1"; "t1", "p1", "p2" for transmitters.
  std::string_view description;  ///< "valve clogging".
  std::string_view paper_name;   ///< "F1".."F5", or empty.
  bool is_signed;                ///< Strength in [-1, 1], else in [0, 1].
  /// The signal of the faulty transmitter.
  std::optional<Signal> transmitter{};
};

/// All faults, numbered by position from 1 on. Models, databases and messages
/// contain these numbers, so new faults are appended.
inline constexpr FaultFacts kFaultCatalogue[] = {
    {"f1", "valve clogging", "F1", false},
    {"f2", "plug or seat sedimentation", "", false},
    {"f3", "plug or seat erosion", "F2", false},
    {"f4", "increased friction of valve or bushing", "", true},
    {"f5", "external leakage", "", false},
    {"f6", "internal leakage", "F3", false},
    {"f7", "medium evaporation or critical flow", "F4", false},
    {"f8", "twisted piston rod", "", false},
    {"f9", "housing or terminals leak air", "", false},
    {"f10", "diaphragm perforation", "", false},
    {"f11", "spring fault", "", false},
    {"f12", "electro-pneumatic transducer fault", "", true},
    {"f13", "rod displacement sensor fault", "", true},
    {"f14", "positioner pressure sensor fault", "", true},
    {"f15", "positioner feedback fault", "", false},
    {"f16", "supply pressure drop", "", false},
    {"f17", "unexpected pressure change across the valve", "", true},
    {"f18", "bypass valve open", "", false},
    {"f19", "flow sensor fault", "F5", true},
    {"t1", "temperature transmitter fault", "", true, Signal::kT1},
    {"p1", "inlet pressure transmitter fault", "", true, Signal::kP1},
    {"p2", "outlet pressure transmitter fault", "", true, Signal::kP2},
};

/// Findings of the floor (diagnosis/floor.h): implausible readings, whatever
/// the cause. Their numbers begin at kFirstFinding, to leave room for more
/// faults.
inline constexpr FaultFacts kFindingCatalogue[] = {
    {"travel_deviation", "rod does not follow the command", "", true},
    {"shut_flow", "flow with the valve shut", "", false},
    {"excess_flow", "more flow than the opening can pass", "", false},
    {"x_stuck", "position reading stuck", "", false},
    {"f_stuck", "flow reading stuck", "", false},
};

/// The actuator faults of the DAMADICS benchmark are 1..kFaultCount.
inline constexpr int kFaultCount = 19;
/// All faults, also known to the simulator, are 1..kLastFault.
inline constexpr int kLastFault = static_cast<int>(std::size(kFaultCatalogue));
/// The findings of the floor are kFirstFinding..kLastFinding.
inline constexpr int kFirstFinding = 201;
inline constexpr int kLastFinding =
    kFirstFinding + static_cast<int>(std::size(kFindingCatalogue)) - 1;

inline constexpr int kTemperatureTransmitterFault = 20;
inline constexpr int kInletPressureTransmitterFault = 21;
inline constexpr int kOutletPressureTransmitterFault = 22;
inline constexpr int kTravelDeviation = kFirstFinding;
inline constexpr int kShutFlow = 202;
inline constexpr int kExcessFlow = 203;
inline constexpr int kPositionStuck = 204;
inline constexpr int kFlowStuck = 205;
static_assert(kFaultCatalogue[kTemperatureTransmitterFault - 1].name == "t1" &&
              kFaultCatalogue[kOutletPressureTransmitterFault - 1].name ==
                  "p2" &&
              kFlowStuck == kLastFinding);

constexpr bool IsFault(int number) {
  return number >= 1 && number <= kLastFault;
}
constexpr bool IsFinding(int number) {
  return number >= kFirstFinding && number <= kLastFinding;
}

/// The numbers of all faults, then of all findings.
inline constexpr auto kFaultsAndFindings = [] {
  std::array<int, std::size(kFaultCatalogue) + std::size(kFindingCatalogue)>
      numbers{};
  for (int i = 0; i < static_cast<int>(numbers.size()); ++i) {
    numbers[static_cast<std::size_t>(i)] =
        i < kLastFault ? i + 1 : kFirstFinding + i - kLastFault;
  }
  return numbers;
}();

/// Whether `fault` is one of `faults`.
bool Contains(const std::vector<int>& faults, int fault);

/// The names of all faults, for messages and help: "f1..f19, t1, p1, p2".
extern const std::string kFaultNames;

/// @throws std::invalid_argument if `fault` is neither a fault nor a finding.
const FaultFacts& FaultFactsOf(int fault);

/// "f19", "t1"; "normal" for 0; "unknown" for anything else.
std::string FaultName(int fault);

/// Parses a fault name, ignoring case: one of kFaultNames, or paper1..paper5
/// for the five faults of [Mendonça et al., 2009] (f1 f3 f6 f7 f19).
std::optional<int> ParseFault(std::string_view name);

/// As ParseFault(), also accepting findings of the floor.
std::optional<int> ParseFinding(std::string_view name);

/// The signal of the faulty transmitter, for transmitter faults.
std::optional<Signal> TransmitterOf(int fault);

/// For messages: " (did you mean 'f19'?)", or "" if `name` is not close to the
/// name of a fault or to one of `others`.
std::string DidYouMeanFault(std::string_view name,
                            std::vector<std::string> others = {});

/// As ParseFault(). @throws ConfigError naming the accepted names.
int RequireFault(std::string_view name);

/// As ParseFinding(). @throws ConfigError as RequireFault().
int RequireFinding(std::string_view name);

}  // namespace fdi
