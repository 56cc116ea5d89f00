#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "diagnosis/model/held_readings.h"
#include "diagnosis/model/sample.h"
#include "diagnosis/model/ts_model.h"
#include "diagnosis/model/validity_region.h"

namespace fdi {

/// Trapezoidal membership: 0 outside [a, d], 1 on [b, c], linear between.
struct Trapezoid {
  double a{0.0};
  double b{0.0};
  double c{0.0};
  double d{0.0};

  double operator()(double value) const {
    if (value < b) {
      return value <= a ? 0.0 : (value - a) / (b - a);
    }
    if (value > c) {
      return value >= d ? 0.0 : (d - value) / (d - c);
    }
    return 1.0;
  }
};

inline constexpr int kMaxFaults = 64;
inline constexpr int kMaxObservers = 128;
inline constexpr int kMaxChannels = 16;
inline constexpr int kMaxWindows = 4;  // per channel

/// Standard error of a prediction, as a share of its extrapolation
/// (ObserverBank::extrapolation).
inline constexpr double kExtrapolationError = 0.5;

/// Fit of one channel model on validation data not used for fitting, run as in
/// the engine.
struct ValidationFigures {
  double mse{0.0};   ///< Mean squared residual [unit²].
  double vaf{0.0};   ///< Variance accounted for [%]; blind to an offset.
  double bias{0.0};  ///< Mean residual y − ŷ [unit].
  std::int64_t samples{0};
};

/// Limits on the normal residual over an exponential window: its mean and the
/// logarithm of its deviation about that mean (ResidualWindows). Model errors
/// grow with the activity of the command, so the limit on the deviation is
///
///     upper_log_rms + max(0, activity_slope · (a − log_activity))
///
/// with a the logarithm of the deviation of CV over the same window. Where the
/// mean of CV over the window is outside that of training, model errors do not
/// average out as in training, and the limits do not apply.
struct WindowLimits {
  int length{30};              ///< N [samples].
  double lower_mean{0.0};      ///< < 0 [unit].
  double upper_mean{0.0};      ///< > 0 [unit].
  double upper_log_rms{0.0};   ///< The deviation is in units of the output.
  double activity_slope{0.0};  ///< In [0, 1] [-].
  double log_activity{0.0};    ///< Value of a in training [log %].
  SignalRange command{kUnbounded};  ///< Means of CV for which it applies [%].
};

/// A residual channel of the model set.
struct ChannelSpec {
  std::string name;  ///< "X", "F", ...
  Signal output{Signal::kX};
  double lower_threshold{0.0};  ///< The normal residual r = y − ŷ below this
  double upper_threshold{0.0};  ///< or above this is abnormal [unit].
  std::vector<WindowLimits>
      windows{};  ///< Slow and small faults; may be empty.
};

/// Limits on the residual of a fault observer, in its deviations, over the
/// last t_k samples of its own condition (FitWindow); zeros: not known.
struct FitBounds {
  double lower_mean{0.0};    ///< < 0
  double upper_mean{0.0};    ///< > 0
  double upper_square{0.0};  ///< Limit on the mean square; > 0.

  bool operator==(const FitBounds&) const = default;
};

/// One channel of one observer.
struct ChannelObserver {
  TsModel model;
  /// The model is a condition's increment on the prediction of the normal
  /// observer, ŷ = ŷ_0 + δ, so that all share the mismatch of the normal
  /// observer. Never true for the normal observer itself.
  bool difference{false};
  Trapezoid membership;          ///< Over r = y − ŷ [unit of the output].
  double residual_sd{1.0};       ///< On validation data [unit], > 0.
  double correlation_time{1.0};  ///< In the residual [samples], ≥ 1.
  /// κ: interpolating this observer from its neighbours in strength has an
  /// error of κ times the distance from the interpolation to the nearer one
  /// [-].
  double interpolation_error{0.5};
  ValidationFigures validation;
  FitBounds fit{};
};

/// One observer: normal operation (fault 0) or one fault condition.
struct Observer {
  std::string name;                       ///< "normal", "f19 0.50".
  int fault{0};                           ///< 0 = normal, else 1..kLastFault.
  double strength{0.0};                   ///< As trained; signed.
  std::vector<ChannelObserver> channels;  ///< One per ModelSet::channels.
  /// P1, P2, T1: outside normal operation in all of the condition's own data.
  /// X and F: the observer accounts for its own data there, so it also has to
  /// account for whatever it explains.
  SignalMask moved{0};
};

/// Settings of detection and isolation; see docs/method.md.
struct DecisionParameters {
  double isolation_threshold{0.7};  ///< T, on decision factors [-].
  int detection_samples{2};         ///< n_d
  int isolation_samples{20};        ///< t_k
  double isolation_fraction{0.9};   ///< Share of t_k samples with d ≥ T.
  double join_fraction{0.75};  ///< Faults with d ≥ T in this share of the t_k
                               ///< samples join a supported set.
  int reisolation_samples{5};  ///< A set must hold this long to replace the
                               ///< isolated one.
  int clearing_samples{60};    ///< t_c
  int settling_samples{30};
  double evidence_window{200.0};  ///< Memory of evidence [samples].
  double evidence_core{3.0};      ///< Up to this far behind the best fault: 1;
  double evidence_support{9.0};   ///< this far or more: 0 [log-likelihood].
  /// Allowance of a fault in the comparison for interpolated observers, as a
  /// share of how far normal operation is behind; see FaultBank. 0: none.
  double interpolation_allowance{0.0};
  /// α: a fault is isolated before t_k where the probability of a wrong name is
  /// less; see Episode::Proven(). 0: never before t_k.
  double early_error{0.0};
};

/// Number of times in a row that a transmitter may repeat one reading; 0: not
/// watched. See StuckReadings.
struct StuckLimits {
  int t1{0};
  int p1{0};
  int p2{0};
};

/// One number of a valve's fitted physics, e.g. {"parameters.trim.kv_m3_h",
/// 118}.
struct PhysicalValue {
  std::string name;
  double value{0.0};
};

/// The wide limits of the floor (diagnosis/decision/floor.h). Rod and flow
/// follow two simple models; the margins are far beyond their errors on the
/// healthy record.
struct FloorLimits {
  static constexpr std::size_t kShapePoints = 21;
  /// In one sample the rod moves by this share of its distance to the command,
  /// limited to `rate` [%]: the quickest and the slowest response compatible
  /// with the record.
  struct Rod {
    double share{1.0};   ///< In (0, 1].
    double rate{100.0};  ///< [%/sample]

    friend bool operator==(const Rod&, const Rod&) = default;
  };
  int delay{0};  ///< From a command to its effect [samples].
  Rod quick;
  Rod slow;
  double deviation{10.0};    ///< X further outside the range is a finding [%],
  int deviation_samples{5};  ///< after this many consecutive samples.
  double stuck_travel{5.0};  ///< Travel [%] after which a repeated X is stuck.

  /// F = gain f(X) √(P1 − P2) [flow unit, kPa]; without both pressures,
  /// dp_level is used. 0: no flow was measured.
  double flow_gain{0.0};
  double flow_exponent{4.0};  ///< f = exp(−exponent X/100),
  /// or, unless empty, that of the trim at X = 0, 5, ..., 100 %.
  std::vector<double> flow_shape{};
  double dp_level{0.0};     ///< Mean P1 − P2 of the record, or 1 [kPa].
  double flow_high{0.0};    ///< The largest flow of the record [flow unit].
  double flow_factor{1.5};  ///< Flow limit: this factor times F(X),
  double flow_margin{0.1};  ///< plus this share of the largest flow.
  int flow_samples{10};     ///< Consecutive samples for a finding.
  /// Flow below this share of F(X) is too little; 0: no flow was measured.
  double flow_share{0.0};

  friend bool operator==(const FloorLimits&, const FloorLimits&) = default;
};

/// That thresholds are set for where nothing else is asked.
inline constexpr double kFalseAlarmsPerHour = 1e-3;

/// The trained knowledge about one kind of valve: written by the trainer,
/// loaded by the monitor, run by both. Observer 0 is the normal one.
struct ModelSet {
  std::string name;
  int version{0};                 ///< Assigned by the store: 1, 2, ...
  std::uint64_t content_hash{0};  ///< Assigned by the store.
  std::int64_t created_ns{0};
  std::string software;  ///< Version and revision of the trainer.
  std::string preset;    ///< "paper", ...
  double sample_period_s{1.0};
  FlowUnit flow_unit{FlowUnit::kM3PerHour};
  ValidityRegion validity;
  StuckLimits stuck;
  ReadEvery every;  ///< Transmitters that are polled.
  /// Limits that always apply; none without CV, or without both X and F.
  std::optional<FloorLimits> floor;
  DecisionParameters decision;
  std::vector<ChannelSpec> channels;
  std::vector<Observer> observers;
  std::vector<int> faults;  ///< Numbers, ascending; index = bit in FaultSet.
                            ///< With a floor, its findings are the last.
  std::vector<std::vector<int>> groups;  ///< Indistinguishable faults.
  std::vector<int> undetectable;         ///< Faults that look normal.
  std::vector<std::string> training_runs;
  double threshold_hours{0.0};  ///< Fault-free hours behind the thresholds.
  /// Target rate of the thresholds, over all channels together.
  double false_alarms_per_hour{kFalseAlarmsPerHour};
  /// The fitted physics of an onboarded valve, for simulation; else empty.
  std::vector<PhysicalValue> physics{};
  /// Its models read the position X as CV, and have no X: see
  /// PositionAsCommand().
  bool position_as_command{false};
};

/// A set of faults as bits: bit i stands for ModelSet::faults[i].
using FaultSet = std::uint64_t;

constexpr bool Has(FaultSet faults, std::size_t bit) {
  return (faults >> bit & 1U) != 0;
}

/// Number of findings of its floor; 0 without a floor.
int FindingCount(const ModelSet& models);

/// Appends the findings of the floor, if there is one, to the faults.
void AddFindings(ModelSet& models);

/// The subset of the faults that are findings of the floor.
FaultSet FindingsOf(const ModelSet& models);

/// Index of `fault` in `models.faults`, or -1.
int FaultIndex(const ModelSet& models, int fault);

/// "f3|f6"; "unknown" for the empty set.
std::string FaultSetName(const ModelSet& models, FaultSet faults);

/// The signals of the valve that the set's channels read, including their
/// outputs.
SignalMask RequiredSignals(const ModelSet& models);

/// @throws DataError naming the first defect that makes the set unusable.
void Validate(const ModelSet& models);

}  // namespace fdi
