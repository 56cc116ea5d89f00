#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "diagnosis/model/record_row.h"
#include "diagnosis/model/sample.h"

namespace fdi::simulator {

/// Temperatures of the medium that a simulation accepts [degC].
inline constexpr double kColdestMediumC = -100.0;
inline constexpr double kHottestMediumC = 650.0;

/// External inputs of the valve at one instant, in SI units.
struct ProcessInputs {
  double command{0.0};  ///< CV as a fraction of closing, 0..1.
  double inlet_pressure_pa{0.0};
  double outlet_pressure_pa{0.0};
  double temperature_c{0.0};
};

/// A first-order autoregressive disturbance: stationary standard deviation and
/// correlation of neighbours, x(k+1) = a x(k) + sd sqrt(1 - a^2) e(k).
struct Disturbance {
  double sd{0.0};           ///< >= 0.
  double correlation{0.0};  ///< a, in [0, 1).

  friend bool operator==(const Disturbance&, const Disturbance&) = default;
};

/// @throws ConfigError naming `field` and the range.
void RequireDisturbance(const std::string& field,
                        const Disturbance& disturbance);

/// Operation about one operating point in open loop, with an optional slow sine
/// on the command, to separate faults that look alike at a fixed position.
struct OperatingPointExcitation {
  double cv_pct{71.67};
  Disturbance cv_noise_pct{0.5, 0.95};
  double p1_kpa{3555.0};
  Disturbance p1_noise_kpa{22.0, 0.85};
  double p2_kpa{2615.0};
  Disturbance p2_noise_kpa{13.0, 0.6};
  double t1_degc{100.7};
  double amplitude_pct{0.0};  ///< Amplitude of the sine on the command.
  double period_s{400.0};     ///< Period of that sine, > 0.
};

/// The benchmark's excitation: CV 50 + 25 sin(2 pi 0.01 t) %,
/// P1 3500 + 175 sin(2 pi 0.1 t), P2 2600 + 26 sin(2 t) kPa, T1 43 degC.
struct SineExcitation {
  double phase_s{0.0};  ///< Time at the first sample.
};

/// The feedwater loop: boiler drum, superheater, level controller, steam demand
/// and the bypass circuit of the valve; see level_loop.h.
struct LevelLoopExcitation {
  double level_set_point_pct{49.2};
  double steam_demand_t_h{14.89};
  Disturbance steam_noise_t_h{0.72, 0.984};
  Disturbance level_noise_pct{1.05, 0.35};  ///< Level transmitter.
  Disturbance pump_noise_kpa{35.0, 0.85};   ///< On P1.
  double initial_cv_pct{59.9};
  double proportional_gain{5.0};  ///< % of CV per % of level.
  double integral_time_s{120.0};
  double inlet_opening{1.0};   ///< V1, upstream hand valve, in (0, 1].
  double outlet_opening{1.0};  ///< V2, downstream hand valve, in (0, 1].
  double bypass_opening{0.0};  ///< V3, bypass hand valve, in [0, 1].
};

/// A level or pressure that the flow through the valve fills and a demand
/// empties, kept by a PI controller through CV: a loop for valves of any size,
/// medium and trim, see level_loop.h.
struct InventoryLoopExcitation {
  double initial_cv_pct{60.0};  ///< The flow there is the mean demand.
  Disturbance demand_noise_pct{5.0, 0.984};  ///< Share of the mean.
  Disturbance level_noise_pct{1.05, 0.35};   ///< On its transmitter.
  double p1_kpa{1000.0};
  Disturbance p1_noise_kpa{8.0, 0.85};
  double p2_kpa{700.0};
  Disturbance p2_noise_kpa{5.0, 0.85};
  double t1_degc{190.0};
  double holding_time_s{650.0};   ///< Span over mean demand.
  double proportional_gain{5.0};  ///< % of CV per % of level.
  double integral_time_s{120.0};
};

/// A recorded excitation, one row per sample.
struct RecordedExcitation {
  std::vector<InputRow> rows{};
};

using ExcitationConfig =
    std::variant<OperatingPointExcitation, SineExcitation, LevelLoopExcitation,
                 InventoryLoopExcitation, RecordedExcitation>;

/// "operating-point", "sine", "level-loop", "inventory-loop" or "csv".
std::string_view ExcitationName(const ExcitationConfig& config);

/// The default excitation `name` (csv: without rows).
/// @throws ConfigError naming the accepted names.
ExcitationConfig DefaultExcitation(std::string_view name);

/// @throws ConfigError naming field, value and range.
void Validate(const ExcitationConfig& config);

/// Flow through the valve and its bypass [m3/h], as a function of the pressures
/// upstream and downstream [Pa], at the present opening.
using FlowOfPressures = std::function<double(double, double)>;

/// Process inputs at a time since the first sample [s].
using InputFunction = std::function<ProcessInputs(double)>;

/// Yields the process inputs of sample 0, 1, 2, ...
class Excitation {
 public:
  virtual ~Excitation() = default;

  /// True if the inputs do not depend on the valve. They are then known one
  /// period ahead, and the pressures run linearly from sample to sample. In a
  /// closed loop, the pressures computed at a sample are reached, and read, one
  /// period later.
  virtual bool is_open_loop() const { return true; }

  /// Inputs at which a closed loop starts; its first Next() follows.
  virtual ProcessInputs InitialInputs() const { return {}; }

  /// Opening of the bypass hand valve V3, 0..1.
  virtual double bypass_opening() const { return 0.0; }

  /// The inputs as smooth functions of time; empty if not available.
  virtual InputFunction AsFunction() const { return {}; }

  /// While held, a closed loop neither controls nor advances: its pressures
  /// follow the flow, and its command is ignored.
  virtual void Hold(bool /*held*/) {}

  /// Inputs of the next sample. `flow` is only used by closed loops.
  virtual ProcessInputs Next(const FlowOfPressures& flow) = 0;
};

/// @param seed same seed, same inputs, bit for bit.
std::unique_ptr<Excitation> MakeExcitation(const ExcitationConfig& config,
                                           double period_s, std::uint64_t seed);

}  // namespace fdi::simulator
