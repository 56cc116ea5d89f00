#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "diagnosis/model/model_set.h"
#include "diagnosis/model/severity.h"

namespace fdi {

/// Outcome of a received sample. Only readings of accepted ones reach the
/// observers; where a few in a row cannot be used, the last usable ones stand
/// in for them (Bridge), and the sample is judged.
enum class Intake : std::uint8_t {
  kAccepted,
  kRepeat,      ///< seq seen before from this source.
  kLate,        ///< seq before the newest one of this source.
  kSuperseded,  ///< A newer source has replaced this one.
  kBadQuality,  ///< A required signal has quality BAD.
  kNotFinite,   ///< A required signal is NaN or infinite.
  kRange,       ///< A required signal is implausible.
  kUnit,        ///< In another unit than the model set's: F, or by its size
                ///< P1, P2 or T1.
  kPeriod,      ///< Interval is not the model set's period.
};
inline constexpr int kIntakeCount = 9;

/// True if the sample did not affect the engine: repeated, late, or from a
/// superseded source.
constexpr bool OutOfOrder(Intake intake) {
  return intake == Intake::kRepeat || intake == Intake::kLate ||
         intake == Intake::kSuperseded;
}

/// A valve that has sent nothing for more sample periods than these has a gap
/// in its samples, and is stale.
inline constexpr double kGapPeriods = 3.0;

/// Tells how far the diagnosis can be relied upon, independent of the state.
enum class Quality : std::uint8_t {
  kLive,
  kStale,  ///< No sample for kGapPeriods; set by the monitor's clock.
  kBadInput,
  kSettling,
  kInhibited,
  kUncovered,
  kModelUnsuited,
  kUnassigned,
};

/// Why a sample was not judged; see Coverage.
enum class CoverageReason : std::uint8_t {
  kMode,     ///< Another mode than AUTO.
  kCv,       ///< CV beyond the trained range.
  kCvStep,   ///< CV stepped as never in training.
  kParked,   ///< At an end of travel, without flow.
  kDp,       ///< P1 − P2 outside normal operation.
  kT1,       ///< T1 outside normal operation.
  kP1,       ///< P1 outside normal operation.
  kP2,       ///< P2 outside normal operation.
  kWaiting,  ///< Inside, but not for long enough yet.
};
inline constexpr int kCoverageReasonCount = 9;

/// A set of reasons as bits.
using CoverageReasons = std::uint16_t;

constexpr CoverageReasons BitOf(CoverageReason reason) {
  return static_cast<CoverageReasons>(1U << static_cast<unsigned>(reason));
}

/// State of knowledge about an episode without an isolated fault.
enum class Unknown : std::uint8_t {
  kNone,          ///< No episode, or a fault is isolated.
  kTooEarly,      ///< Known faults may still explain it.
  kOutsideKnown,  ///< None: no factor reached T/2 in the last t_k samples.
};

enum class State : std::uint8_t { kNormal, kDetected, kIsolated };

enum class TransitionKind : std::uint8_t {
  kDetected,
  kIsolated,
  kReisolated,
  kCleared,
  kClosed,
  kChanged,  ///< The priority rose. On the bus: kReisolated, the same faults.
  kSecond,   ///< What is on top of the name has changed. On the bus likewise.
  kRaised,   ///< A notice has become an alarm. On the bus: see OnTheBus().
};

/// Gives an episode a name.
constexpr bool IsIsolation(TransitionKind kind) {
  return kind == TransitionKind::kIsolated ||
         kind == TransitionKind::kReisolated;
}

enum class EndReason : std::uint8_t {
  kNone,
  kCleared,
  kStreamEnded,
  kStaleTimeout,
  kModelChanged,
  kSuperseded,
  kUnknown,
};

/// The source of an episode's name.
enum class Layer : std::uint8_t {
  kObservers,  ///< The engine: observers and limits.
  kPhysics,    ///< A simulation of the valve (second look).
  kAudit,      ///< The audit of the loop, without a model.
};

/// A fault on top of the one that an episode is named after
/// (SecondFaultWatch).
struct SecondFault {
  bool open{false};      ///< There is something.
  bool doubt{false};     ///< There may be: the name is to stay meanwhile.
  FaultSet standing{0};  ///< The faults below it.
  std::size_t standing_bit{0};    ///< The likeliest of that,
  double standing_strength{0.0};  ///< and its strength, signed.
  std::int64_t detection_stamp_ns{0};
  FaultSet faults{0};    ///< Its name; empty: what it is cannot be told.
  double strength{0.0};  ///< The likeliest one's.
  double factor{0.0};    ///< The largest of theirs.
};

/// A slow drift of X (DriftWatch): the line through its mean residuals.
struct SlowDrift {
  double now{0.0};    ///< At the end, signed [%]; 0: there is none.
  double slope{0.0};  ///< With the same sign [%/h].
  double hours{0.0};  ///< For how long; less where the line was at zero.
};

/// "X reads 0.22 % above its model, growing by 0.041 % an hour for 5.3 h";
/// empty for none.
std::string DriftValue(const SlowDrift& drift);

/// The value of TransitionKind::kSecond: `names`, those of second.faults, or
/// "unknown", or "none" where it is over.
std::string SecondValue(const SecondFault& second, std::string names);
/// The inverse. @param faults names, by bit; others are left out.
SecondFault ParseSecond(std::string_view value,
                        const std::vector<std::string>& faults);

/// A transition of an episode.
struct Transition {
  TransitionKind kind{TransitionKind::kDetected};
  std::int64_t stamp_ns{0};
  /// Key of the episode: stamp of the first abnormal sample of its detection.
  std::int64_t detection_stamp_ns{0};
  FaultSet faults{0};    ///< The isolated set, empty until isolated.
  double factor{0.0};    ///< Largest of the set, or else of any fault.
  double strength{0.0};  ///< Estimated, of the fault with that factor, or the
                         ///< likeliest one by physics; 0 until isolated.
  double lowest{0.0};    ///< Ends of its 95 % interval, equal if not known.
  double highest{0.0};   ///<
  std::optional<Severity> severity{};  ///< Nothing: heard on the bus.
  EndReason reason{EndReason::kNone};  ///< For kClosed.
  Unknown unknown{Unknown::kNone};     ///< As in the verdict at that time.
  Layer layer{Layer::kObservers};      ///< The source of `faults`.
  SecondFault second{};                ///< The fault on top of them.
  SlowDrift drift{};                   ///< Where `faults` is a drift.
  /// The largest share of the episode so far (Verdict::share).
  double share{0.0};
  /// In so many hours a healthy valve shows that once; nothing: not known.
  std::optional<double> return_hours{};
  /// Not rare enough for the budget of alarms: nobody is alarmed.
  bool notice{false};
};

/// The engine's result for one sample.
struct Verdict {
  std::int64_t stamp_ns{0};
  std::uint64_t source_id{0};
  std::uint64_t seq{0};
  Intake intake{Intake::kAccepted};
  bool initialised{false};  ///< Observers were re-initialised at this sample.
  Quality quality{Quality::kSettling};
  CoverageReasons uncovered{0};  ///< Why it is not LIVE; 0: other reasons.
  /// Signals of which a single reading was just found wrong (LoneReadings) or
  /// unusable (Bridge).
  SignalMask single{0};
  State state{State::kNormal};
  Unknown unknown{Unknown::kNone};
  bool detected{false};  ///< An episode is open.
  /// The largest share of its limit that a test of the observers or the floor
  /// has held for as long as it needs; above 1: it detects. 0: not judged.
  double share{0.0};
  double confidence{0.0};  ///< Share of the channels that voted.
  /// r = y − ŷ of the normal observer per channel; NaN where it abstains.
  std::array<double, kMaxChannels> residuals{};
  double normal_factor{0.0};                             ///< d_0
  std::array<double, kMaxFaults> fault_factors{};        ///< d by fault index.
  std::array<double, kMaxFaults> strengths{};            ///< By fault index.
  std::array<double, kMaxObservers> observer_factors{};  ///< By observer.
  FaultSet isolated{0};
  SecondFault second{};  ///< Beside `isolated`.
  SlowDrift drift{};     ///< Instead of a fault.
  std::array<Transition, 4> transitions{};
  int transition_count{0};

  std::span<const Transition> Transitions() const {
    return {transitions.data(), static_cast<std::size_t>(transition_count)};
  }
};

std::string_view IntakeName(Intake intake);     ///< "accepted", ...
std::string_view QualityName(Quality quality);  ///< "LIVE", ...
std::string_view StateName(State state);        ///< "NORMAL", ...
std::string_view UnknownName(Unknown unknown);  ///< "too_early", ...
/// "cv|dp", in the order of CoverageReason; empty for none.
std::string CoverageReasonsName(CoverageReasons reasons);
/// Why a sample is not LIVE: "UNCOVERED cv|dp", "BAD_INPUT no_readings".
std::string WhyUnjudged(Quality quality, Intake intake,
                        CoverageReasons reasons);
std::string_view TransitionName(TransitionKind kind);  ///< "DETECTED", ...
std::string_view EndReasonName(EndReason reason);      ///< "cleared", ...
std::string_view LayerName(Layer layer);               ///< "observers", ...
/// The inverse; what it does not know counts as by observers.
Layer ParseLayer(std::string_view name);

/// 64-bit FNV-1a over valve, source and detection stamp: recording an episode
/// twice yields the same id.
std::uint64_t EpisodeId(std::string_view valve_id, std::uint64_t source_id,
                        std::int64_t detection_stamp_ns);

}  // namespace fdi
