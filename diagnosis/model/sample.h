#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>

namespace fdi {

/// The signals a valve may deliver, in the order of every array of signals.
/// Units: positions and commands in % of closing, pressures in kPa (absolute
/// process pressures), temperature in °C, flow as the transmitter reads it.
enum class Signal : std::uint8_t {
  kCv,   ///< Command to the positioner [%].
  kP1,   ///< Pressure before the valve [kPa].
  kP2,   ///< Pressure behind the valve [kPa].
  kT1,   ///< Temperature before the valve [°C].
  kX,    ///< Rod position [%].
  kF,    ///< Flow [m³/h or t/h, see FlowUnit].
  kSp,   ///< Set point of the loop [%; with kPv in the unit of that].
  kCvi,  ///< Positioner output [-1, 1].
  kPs,   ///< Actuator chamber pressure [kPa].
  kPz,   ///< Supply pressure [kPa].
  kPv,   ///< Controlled variable of the loop, if it is no flow [its own unit].
};
inline constexpr std::size_t kSignalCount = 11;
/// The first ones, all but kPv: those of version 1 on the wire and in stored
/// runs, and those that a model set may read.
inline constexpr std::size_t kModelSignalCount = 10;

constexpr std::size_t Index(Signal signal) {
  return static_cast<std::size_t>(signal);
}

/// A set of signals as bits 1 << Index(signal).
using SignalMask = std::uint16_t;

constexpr SignalMask MaskOf(Signal signal) {
  return static_cast<SignalMask>(1U << Index(signal));
}

/// CV, P1, P2, T1, X and F: the basic measurements of the benchmark.
inline constexpr SignalMask kBasicSignals = 0x3F;

/// Plausible readings of a transmitter: others never reach an observer.
struct SignalRange {
  double minimum;
  double maximum;

  bool Contains(double value) const {
    return value >= minimum && value <= maximum;
  }
};

/// "CV", "P1", ...
std::string_view SignalName(Signal signal);
/// "%", "kPa", "degC"; empty for kF, see FlowUnitName(), and for kPv.
std::string_view SignalUnit(Signal signal);
/// Parses a signal name, ignoring case.
std::optional<Signal> ParseSignal(std::string_view name);
/// The physically possible readings of `signal`, for both flow units; for kSp,
/// those in %: see IsPlausible().
SignalRange PlausibleRange(Signal signal);

enum class SignalQuality : std::uint8_t { kGood, kUncertain, kBad };

enum class ValveMode : std::uint8_t {
  kAuto,
  kManual,
  kInhibited,
  kOutOfService,
  kCalibrating
};

/// "AUTO", "MANUAL", "INHIBITED", "OUT_OF_SERVICE" or "CALIBRATING".
std::string_view ValveModeName(ValveMode mode);
/// Parses a mode, ignoring case.
std::optional<ValveMode> ParseValveMode(std::string_view name);
/// All names, for messages and help.
inline constexpr std::string_view kValveModeNames =
    "AUTO, MANUAL, INHIBITED, OUT_OF_SERVICE, CALIBRATING";

enum class FlowUnit : std::uint8_t { kM3PerHour, kTPerHour };

/// "m3/h" or "t/h".
std::string_view FlowUnitName(FlowUnit unit);
std::optional<FlowUnit> ParseFlowUnit(std::string_view name);

/// One reading of all transmitters of one valve.
struct Sample {
  std::int64_t stamp_ns{0};    ///< UTC of sampling.
  std::uint64_t source_id{0};  ///< Random, new at each start of a publisher.
  std::uint64_t seq{0};        ///< Counts the samples of one source.
  std::array<double, kSignalCount> values{};  ///< By Index(Signal).
  SignalMask present{0};
  std::array<SignalQuality, kSignalCount> quality{};
  ValveMode mode{ValveMode::kAuto};
  FlowUnit flow_unit{FlowUnit::kM3PerHour};
  std::uint32_t epoch{0};  ///< Replacements and recalibrations; 0 unknown.

  double operator[](Signal signal) const { return values[Index(signal)]; }
  bool Has(Signal signal) const { return (present & MaskOf(signal)) != 0; }
  /// The signals of quality UNCERTAIN: estimates, such as interpolated
  /// readings, and repeats of an older reading. Observers take them into their
  /// past, and nothing else counts them.
  SignalMask uncertain() const {
    SignalMask mask = 0;
    if (quality == decltype(quality){}) {
      return mask;  // All are good, as nearly always.
    }
    for (std::size_t i = 0; i < kSignalCount; ++i) {
      if (quality[i] == SignalQuality::kUncertain) {
        mask = static_cast<SignalMask>(mask | MaskOf(static_cast<Signal>(i)));
      }
    }
    return mask;
  }
  void Set(Signal signal, double value) {
    values[Index(signal)] = value;
    present = static_cast<SignalMask>(present | MaskOf(signal));
  }
};

/// True if the reading of `signal`, which is present, is physically possible:
/// in PlausibleRange() or, for an SP beside a PV, in that of the PV.
bool IsPlausible(const Sample& sample, Signal signal);

/// A reading to be relied upon: there, plausible and not of quality BAD; else
/// NaN.
double GoodReading(const Sample& sample, Signal signal);

/// The truth of a simulated or labelled sample; never seen by an engine.
struct FaultTruth {
  int fault{0};          ///< 1..kLastFault, 0 = none acting.
  double strength{0.0};  ///< Signed; 0 while the fault is inactive.
};

/// A sample with its truth, if known.
struct LabelledSample {
  Sample sample;
  std::optional<FaultTruth> truth;
};

}  // namespace fdi
