#pragma once

#include <array>
#include <cstdint>
#include <iterator>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "diagnosis/model/sample.h"

namespace fdi {

/// Where a fault acts first.
enum class ActsOn : std::uint8_t {
  kRod,          ///< Actuator, positioner or a stop: X, and F with it.
  kFlow,         ///< The flow at the same X.
  kFlowReading,  ///< Only the reading of F.
  kInputs,       ///< P1, P2 or T1, or the readings of them.
};

/// Growth of the effect with the strength.
enum class Onset : std::uint8_t {
  kGradual,
  kStop,       ///< None until the rod meets a stop.
  kThreshold,  ///< None until the force lacks, and little more beyond.
};

/// When one fault is taken for another.
enum class Alike : std::uint8_t {
  kWithinItsSize,  ///< Their effects have one shape; only the size tells.
  kWhileWeak,      ///< As long as both effects are within the model's error.
  kUnfit,     ///< Where no fault explains the record as a healthy valve is.
  kUntaught,  ///< By observers that were not taught that sign of the other one.
};

/// A fault that another one is taken for.
struct LookAlike {
  int fault{0};  ///< Its number; 0: none.
  Alike when{Alike::kWithinItsSize};
  int sign{0};  ///< Sign of its strength; 0: either.
};

inline constexpr SignalMask kRodSignals =
    static_cast<SignalMask>(MaskOf(Signal::kX) | MaskOf(Signal::kF));

struct FaultFacts {
  std::string_view name;  ///< "f1"; "t1", "p1", "p2", "x1" for transmitters.
  std::string_view description;   ///< "valve clogging".
  std::string_view paper_name{};  ///< "F1".."F5", or empty.
  bool is_signed{false};          ///< Strength in [-1, 1], else in [0, 1].
  /// The signal of the faulty transmitter.
  std::optional<Signal> transmitter{};
  ActsOn acts_on{ActsOn::kRod};
  /// Basic signals of which one has to be measured to see the fault.
  SignalMask visible_in{kRodSignals};
  /// Signals that have to be measured, too, to tell it from other faults.
  SignalMask told_by{0};
  /// Named by the simulation of an episode alone: no observer is taught it.
  bool simulation_only{false};
  Onset onset{Onset::kGradual};
  /// Weaker than a simulation of X and F errs.
  bool weak{false};
  /// A negative strength has no effect that can be seen: a valve has little
  /// play to lose.
  bool negative_hidden{false};
  /// Acts on a part that only a pneumatic actuator has: air, spring,
  /// transducer.
  bool of_air{false};
  /// Needs water: of no other medium is it known when it evaporates.
  bool of_water{false};
  /// The signal whose reading is not what acts on the valve.
  std::optional<Signal> hides{};
  std::array<LookAlike, 3> look_alikes{};
};

/// All faults, numbered by position from 1 on. Models, databases and messages
/// contain these numbers, so new faults are appended.
inline constexpr FaultFacts kFaultCatalogue[] = {
    {.name = "f1",
     .description = "valve clogging",
     .paper_name = "F1",
     .onset = Onset::kStop,
     .look_alikes = {{{10, Alike::kUnfit}, {16, Alike::kUnfit}}}},
    {.name = "f2",
     .description = "plug or seat sedimentation",
     .look_alikes = {{{5, Alike::kWhileWeak}, {19, Alike::kUntaught, 1}}}},
    {.name = "f3", .description = "plug or seat erosion", .paper_name = "F2"},
    {.name = "f4",
     .description = "increased friction of valve or bushing",
     .is_signed = true,
     .negative_hidden = true},
    {.name = "f5",
     .description = "external leakage",
     .acts_on = ActsOn::kFlow,
     .visible_in = MaskOf(Signal::kF),
     .look_alikes = {{{2, Alike::kWhileWeak}}}},
    {.name = "f6",
     .description = "internal leakage",
     .paper_name = "F3",
     .acts_on = ActsOn::kFlow,
     .visible_in = MaskOf(Signal::kF),
     .look_alikes = {{{18, Alike::kWithinItsSize}}}},
    {.name = "f7",
     .description = "medium evaporation or critical flow",
     .paper_name = "F4",
     .acts_on = ActsOn::kInputs,
     .of_water = true,
     .hides = Signal::kT1},
    {.name = "f8", .description = "twisted piston rod", .weak = true},
    {.name = "f9",
     .description = "housing or terminals leak air",
     .of_air = true},
    {.name = "f10",
     .description = "diaphragm perforation",
     .onset = Onset::kThreshold,
     .of_air = true,
     .look_alikes = {{{1, Alike::kUnfit},
                      {16, Alike::kUnfit},
                      {12, Alike::kUntaught, 1}}}},
    {.name = "f11",
     .description = "spring fault",
     .of_air = true,
     .look_alikes = {{{12, Alike::kUntaught, 1}}}},
    {.name = "f12",
     .description = "electro-pneumatic transducer fault",
     .is_signed = true,
     .of_air = true},
    {.name = "f13",
     .description = "rod displacement sensor fault",
     .is_signed = true},
    {.name = "f14",
     .description = "positioner pressure sensor fault",
     .is_signed = true,
     .visible_in = 0,
     .of_air = true},
    {.name = "f15", .description = "positioner feedback fault"},
    {.name = "f16",
     .description = "supply pressure drop",
     .onset = Onset::kThreshold,
     .of_air = true,
     .look_alikes = {{{1, Alike::kUnfit}, {10, Alike::kUnfit}}}},
    {.name = "f17",
     .description = "unexpected pressure change across the valve",
     .is_signed = true,
     .acts_on = ActsOn::kInputs},
    {.name = "f18",
     .description = "bypass valve open",
     .acts_on = ActsOn::kFlow,
     .visible_in = MaskOf(Signal::kF),
     .look_alikes = {{{6, Alike::kWithinItsSize}}}},
    {.name = "f19",
     .description = "flow sensor fault",
     .paper_name = "F5",
     .is_signed = true,
     .acts_on = ActsOn::kFlowReading,
     .visible_in = MaskOf(Signal::kF)},
    {.name = "t1",
     .description = "temperature transmitter fault",
     .is_signed = true,
     .transmitter = Signal::kT1,
     .acts_on = ActsOn::kInputs,
     .visible_in = MaskOf(Signal::kT1),
     .hides = Signal::kT1},
    {.name = "p1",
     .description = "inlet pressure transmitter fault",
     .is_signed = true,
     .transmitter = Signal::kP1,
     .acts_on = ActsOn::kInputs,
     .visible_in = MaskOf(Signal::kP1),
     .hides = Signal::kP1},
    {.name = "p2",
     .description = "outlet pressure transmitter fault",
     .is_signed = true,
     .transmitter = Signal::kP2,
     .acts_on = ActsOn::kInputs,
     .visible_in = MaskOf(Signal::kP2),
     .hides = Signal::kP2},
    {.name = "x1",
     .description = "position transmitter beside the positioner",
     .is_signed = true,
     .visible_in = MaskOf(Signal::kX),
     .told_by = MaskOf(Signal::kF),
     .simulation_only = true},
};

/// Findings of the floor (diagnosis/decision/floor.h), which are implausible
/// readings, whatever the cause, then those of the audit of a loop
/// (diagnosis/loop/loop_watch.h), then a drift
/// (diagnosis/observers/drift_watch.h), and what the audit finds since. Their
/// numbers begin at kFirstFinding, to leave room for more faults.
inline constexpr FaultFacts kFindingCatalogue[] = {
    {"travel_deviation", "rod does not follow the command", "", true},
    {"shut_flow", "flow with the valve shut", "", false},
    {"excess_flow", "more flow than the opening can pass", "", false},
    {"x_stuck", "position reading stuck", "", false},
    {"f_stuck", "flow reading stuck", "", false},
    {.name = "low_flow",
     .description = "less flow than the opening passes",
     .acts_on = ActsOn::kFlow,
     .visible_in = MaskOf(Signal::kF)},
    {"stiction", "the valve sticks", "", false},
    {"no_response", "flow or rod does not answer the command", "", false},
    {"reading_frozen", "the loop's reading repeats", "", false},
    {"output_saturated", "command at an end of its range", "", false},
    {"oscillation_tuning", "the controller makes an oscillation", "", false},
    {"oscillation_external", "an oscillation from outside the loop", "", false},
    {.name = "x_drift",
     .description = "position drifts slowly",
     .is_signed = true,
     .visible_in = MaskOf(Signal::kX)},
    {"positioner_hunts", "position oscillates while the command rests", "",
     false},
};

/// The actuator faults of the DAMADICS benchmark are 1..kFaultCount.
inline constexpr int kFaultCount = 19;
/// All faults, also known to the simulator, are 1..kLastFault.
inline constexpr int kLastFault = static_cast<int>(std::size(kFaultCatalogue));
/// All findings are kFirstFinding..kLastFinding.
inline constexpr int kFirstFinding = 201;
inline constexpr int kLastFinding =
    kFirstFinding + static_cast<int>(std::size(kFindingCatalogue)) - 1;

inline constexpr int kTravelStop = 1;
inline constexpr int kStemFriction = 4;
inline constexpr int kDiaphragmPerforation = 10;
inline constexpr int kSupplyDrop = 16;
inline constexpr int kTemperatureTransmitterFault = 20;
inline constexpr int kInletPressureTransmitterFault = 21;
inline constexpr int kOutletPressureTransmitterFault = 22;
/// Beside the positioner, whose own is f13.
inline constexpr int kPositionTransmitterFault = 23;
inline constexpr int kTravelDeviation = kFirstFinding;
inline constexpr int kShutFlow = 202;
inline constexpr int kExcessFlow = 203;
inline constexpr int kPositionStuck = 204;
inline constexpr int kFlowStuck = 205;
inline constexpr int kLowFlow = 206;
/// The last finding of the floor; those of the audit follow.
inline constexpr int kLastFloorFinding = kLowFlow;
inline constexpr int kFirstLoopFinding = 207;
inline constexpr int kStiction = kFirstLoopFinding;
inline constexpr int kNoResponse = 208;
inline constexpr int kReadingFrozen = 209;
inline constexpr int kOutputSaturated = 210;
inline constexpr int kOscillationTuning = 211;
inline constexpr int kOscillationExternal = 212;
inline constexpr int kLastLoopFinding = kOscillationExternal;
inline constexpr int kPositionDrift = 213;
inline constexpr int kPositionerHunts = 214;
static_assert(kFaultCatalogue[kDiaphragmPerforation - 1].name == "f10" &&
              kFaultCatalogue[kSupplyDrop - 1].name == "f16" &&
              kFaultCatalogue[kTemperatureTransmitterFault - 1].name == "t1" &&
              kFaultCatalogue[kOutletPressureTransmitterFault - 1].name ==
                  "p2" &&
              kFaultCatalogue[kPositionTransmitterFault - 1].name == "x1" &&
              kFindingCatalogue[kLowFlow - kFirstFinding].name == "low_flow" &&
              kFindingCatalogue[kStiction - kFirstFinding].name == "stiction" &&
              kPositionerHunts == kLastFinding);

constexpr bool IsFault(int number) {
  return number >= 1 && number <= kLastFault;
}
constexpr bool IsFinding(int number) {
  return number >= kFirstFinding && number <= kLastFinding;
}

/// True if `number` is a finding of a loop audit.
constexpr bool IsLoopFinding(int number) {
  return (number >= kFirstLoopFinding && number <= kLastLoopFinding) ||
         number == kPositionerHunts;
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

/// True if `fault` is one of `faults`.
bool Contains(const std::vector<int>& faults, int fault);

/// The names of all faults, for messages and help: "f1..f19, t1, p1, p2, x1".
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

/// A negative strength of `fault` exists and can be seen.
bool HasNegative(int fault);

/// `fault` can be seen in one of `signals`, and told by those that it takes.
bool IsVisibleIn(int fault, SignalMask signals);

/// For messages: " (did you mean 'f19'?)", or "" if `name` is not close to the
/// name of a fault or to one of `others`.
std::string DidYouMeanFault(std::string_view name,
                            std::vector<std::string> others = {});

/// As ParseFault(). @throws ConfigError naming the accepted names.
int RequireFault(std::string_view name);

/// As ParseFinding(). @throws ConfigError as RequireFault().
int RequireFinding(std::string_view name);

}  // namespace fdi
