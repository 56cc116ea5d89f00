#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "diagnosis/membership.h"
#include "diagnosis/sample.h"
#include "diagnosis/ts_model.h"
#include "diagnosis/validity_region.h"

namespace fdi {

inline constexpr int kMaxFaults = 64;
inline constexpr int kMaxObservers = 128;
inline constexpr int kMaxChannels = 16;
inline constexpr int kMaxWindows = 4;  // per channel

/// A prediction is uncertain by this share of what it extrapolates
/// (ObserverBank::extrapolation).
inline constexpr double kExtrapolationError = 0.5;

/// Fit of one channel model on validation data it was not fitted to, run as
/// the engine runs it.
struct ValidationFigures {
  double mse{0.0};   ///< Mean squared residual [unit²].
  double vaf{0.0};   ///< Variance accounted for [%]; blind to an offset.
  double bias{0.0};  ///< Mean residual y − ŷ [unit].
  std::int64_t samples{0};
};

/// Limits on the normal residual over an exponential window: its mean and the
/// logarithm of its deviation about that mean (ResidualWindows). What a model
/// errs by grows with what the command does: the limit on the deviation is
///
///     upper_log_rms + activity_slope · (a − log_activity), not below the first
///
/// with a the logarithm of the deviation of CV over the same window. Where CV
/// stays, in its mean over the window, as it never did in training, what models
/// err by there does not average out as it did: the window has no limits.
struct WindowLimits {
  int length{30};              ///< N [samples].
  double lower_mean{0.0};      ///< < 0 [unit].
  double upper_mean{0.0};      ///< > 0 [unit].
  double upper_log_rms{0.0};   ///< Of the deviation in units of the output.
  double activity_slope{0.0};  ///< In [0, 1] [-].
  double log_activity{0.0};    ///< Of CV in training [log %].
  SignalRange command{kUnbounded};  ///< Means of CV that it holds for [%].
};

/// How far the limits of a channel may follow a drift of the healthy valve
/// (Detection::Follow); zeros: not at all.
struct DriftLimits {
  double lower_mean{0.0};  ///< <= 0 [unit].
  double upper_mean{0.0};  ///< >= 0 [unit].
  double log_scale{0.0};   ///< >= 0, of the deviation.

  bool operator==(const DriftLimits&) const = default;
};

/// A residual channel of the model set: which output it watches.
struct ChannelSpec {
  std::string name;  ///< "X", "F", ...
  Signal output{Signal::kX};
  double lower_threshold{0.0};  ///< The normal residual r = y − ŷ below this
  double upper_threshold{0.0};  ///< or above this is abnormal [unit].
  std::vector<WindowLimits>
      windows{};  ///< Slow and small faults; may be empty.
  DriftLimits drift{};
};

/// One channel of one observer.
struct ChannelObserver {
  TsModel model;
  /// The model is what the condition adds to the prediction of the normal
  /// observer, ŷ = ŷ_0 + δ: the mismatch of the normal observer is then common
  /// to all. Never true for the normal observer itself.
  bool difference{false};
  Trapezoid membership;          ///< Over r = y − ŷ [unit of the output].
  double residual_sd{1.0};       ///< On validation data [unit], > 0.
  double correlation_time{1.0};  ///< Of the residual [samples], ≥ 1.
  /// κ: interpolating this observer from its neighbours in strength errs by κ
  /// times what the interpolation differs from the nearer one [-].
  double interpolation_error{0.5};
  ValidationFigures validation;
};

/// One observer: normal operation (fault 0) or one fault condition.
struct Observer {
  std::string name;      ///< "normal", "f19 0.50".
  int fault{0};          ///< 0 = normal, else 1..22.
  double strength{0.0};  ///< Of the condition it was trained on; signed.
  std::vector<ChannelObserver> channels;  ///< One per ModelSet::channels.
};

/// Settings of detection and isolation; see docs/method.md.
struct DecisionParameters {
  double isolation_threshold{0.7};  ///< T, on decision factors [-].
  int detection_samples{2};         ///< n_d
  int isolation_samples{20};        ///< t_k
  double isolation_fraction{0.9};   ///< Share of t_k samples with d ≥ T.
  double join_fraction{0.75};  ///< Faults with d ≥ T in this share of the t_k
                               ///< samples join a set that others support.
  int reisolation_samples{5};  ///< So long another set must hold to replace
                               ///< the isolated one.
  int clearing_samples{60};    ///< t_c
  int settling_samples{30};
  double evidence_window{200.0};  ///< Memory of evidence [samples].
  double evidence_core{3.0};      ///< Behind the best fault by up to this: 1,
  double evidence_support{9.0};   ///< by more than this: 0 [log-likelihood].
};

/// How many samples in a row a transmitter may repeat one reading; 0: any
/// number, it is not watched. See StuckReadings.
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

/// The wide limits of the floor (diagnosis/floor.h). Rod and flow follow two
/// simple models; the margins are far beyond what they erred by on the healthy
/// record.
struct FloorLimits {
  /// The rod goes this share of its way to the command in a sample, at most so
  /// far [%]: the quickest and the slowest answer that the record leaves open.
  struct Rod {
    double share{1.0};   ///< In (0, 1].
    double rate{100.0};  ///< [%/sample]

    friend bool operator==(const Rod&, const Rod&) = default;
  };
  int delay{0};  ///< Between a command and its action [samples].
  Rod quick;
  Rod slow;
  double deviation{10.0};    ///< X beyond both by more is none of them [%].
  int deviation_samples{5};  ///< For so many samples in a row.
  double stuck_travel{5.0};  ///< The rod moves no further [%] while X repeats.

  /// F = gain exp(−exponent X/100) √(P1 − P2) [flow unit, kPa]; without both
  /// pressures at the level of training. 0: no flow was measured.
  double flow_gain{0.0};
  double flow_exponent{4.0};
  double dp_level{0.0};     ///< Mean P1 − P2 of the record, or 1 [kPa].
  double flow_high{0.0};    ///< The largest flow of the record [flow unit].
  double flow_factor{1.5};  ///< No opening passes more than this times F(X),
  double flow_margin{0.1};  ///< and this share of the largest flow.
  int flow_samples{10};     ///< For so many samples in a row.

  friend bool operator==(const FloorLimits&, const FloorLimits&) = default;
};

/// The stored knowledge about one kind of valve: what the trainer writes, the
/// monitor loads, and both run. Observer 0 is the normal one.
struct ModelSet {
  std::string name;
  int version{0};                 ///< Given when stored, 1, 2, ...
  std::uint64_t content_hash{0};  ///< Of the stored bytes, given when stored.
  std::int64_t created_ns{0};
  std::string software;  ///< Version and revision of the trainer.
  std::string preset;    ///< "paper", ...
  double sample_period_s{1.0};
  FlowUnit flow_unit{FlowUnit::kM3PerHour};
  ValidityRegion validity;
  StuckLimits stuck;
  /// What holds always; sets made before there was a floor have none, and are
  /// judged within their region alone.
  std::optional<FloorLimits> floor;
  DecisionParameters decision;
  std::vector<ChannelSpec> channels;
  std::vector<Observer> observers;
  std::vector<int> faults;  ///< Numbers, ascending; index = bit in FaultSet.
                            ///< With a floor, its findings are the last.
  std::vector<std::vector<int>> groups;  ///< Faults it cannot tell apart.
  std::vector<int> undetectable;         ///< Faults that look normal.
  std::vector<std::string> training_runs;
  double threshold_hours{0.0};  ///< Fault-free hours behind the thresholds.
  double false_alarms_per_hour{1e-3};  ///< The rate they are set for.
  /// The valve as onboarding fitted it, for its simulation; empty without.
  std::vector<PhysicalValue> physics{};
};

/// A set of faults as bits: bit i stands for ModelSet::faults[i].
using FaultSet = std::uint64_t;

/// Adds the findings of the floor, if there is one, to the faults.
void AddFindings(ModelSet& models);

/// Those of the faults that are findings of the floor.
FaultSet FindingsOf(const ModelSet& models);

/// Index of `fault` in `models.faults`, or -1.
int FaultIndex(const ModelSet& models, int fault);

/// "f3|f6"; "unknown" for the empty set.
std::string FaultSetName(const ModelSet& models, FaultSet faults);

/// The signals that some channel of the set reads, its output included.
SignalMask RequiredSignals(const ModelSet& models);

/// @throws DataError naming the first thing that makes the set unusable.
void Validate(const ModelSet& models);

}  // namespace fdi
