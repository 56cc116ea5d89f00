#pragma once

#include <cstdint>

#include "simulator/excitation.h"
#include "simulator/random.h"
#include "simulator/valve_parameters.h"

namespace fdi::simulator {

/// State of the boiler that the valve feeds.
struct BoilerState {
  double level_pct;  ///< In the drum.
  double drum_pressure_pa;
  double steam_flow_kg_s;
  double steam_temperature_c;  ///< After the superheater.
  double feed_flow_kg_s;
  double firing_w;
};

/// PI controller for CV [%] with anti-windup; more CV means less flow.
class InventoryController {
 public:
  InventoryController(double gain, double integral_time_s, double initial_pct)
      : gain_(gain),
        integral_time_s_(integral_time_s),
        integral_pct_(initial_pct) {}

  /// @param error level above the set point [%].
  double Next(double error, double period_s);
  /// The command without the proportional action [%].
  double integral_pct() const { return integral_pct_; }

 private:
  double gain_;
  double integral_time_s_;
  double integral_pct_;
};

/// Feedwater loop about the operating point of the Lublin boiler: the valve
/// feeds a drum whose level a PI controller maintains through CV; steam demand
/// is the disturbance.
///
///   27.4 dL/dt   = Wf - Ws - Wb                         (kg/s, L in %)
///   735  dP/dt   = Q - Wf (hl - hf) - Ws (hg - hl)      (J/Pa)
///   1.04e6 dT/dt = 0.178 Q - Ws cp (T - Tsat)           (J/K)
///   Q by PI on P about 10.25 MW; Wb is the blow-down
///   P1 = 3557 kPa - 3 (F - 17.3) - loss of V1 + pump noise   (F in t/h)
///   P2 = P + 178 kPa + 0.13 F^2 + loss of V2
///
/// F and the two pressures are solved together at every sample. Values are
/// fitted to means, deviations and correlations of the plant record; enthalpies
/// are those of saturated water and steam at 2.4 MPa, feed at 100.7 degC.
class LevelLoop final : public Excitation {
 public:
  LevelLoop(const LevelLoopExcitation& config, double period_s,
            std::uint64_t seed);

  bool is_open_loop() const override { return false; }
  ProcessInputs InitialInputs() const override;
  double bypass_opening() const override { return config_.bypass_opening; }
  void Hold(bool held) override { held_ = held; }
  ProcessInputs Next(const FlowOfPressures& flow) override;

  const BoilerState& boiler() const { return boiler_; }

 private:
  void AdvanceBoiler();
  double InletPressure(double flow_m3_h) const;
  double OutletPressure(double flow_m3_h) const;

  LevelLoopExcitation config_;
  double period_s_;
  DisturbanceProcess steam_;
  DisturbanceProcess pump_;
  DisturbanceProcess level_noise_;
  BoilerState boiler_;
  double pump_offset_pa_{0.0};
  double firing_integral_w_{0.0};
  InventoryController controller_;
  bool started_{false};
  bool held_{false};
};

/// A loop in which the valve fills what a demand empties:
///
///   dL/dt = 100 (F / F0 - D) / T        (L in %, F0 the flow at the start)
///
/// D is 1 and a first-order autoregressive disturbance, P1 and P2 wander about
/// their means. F / F0 is all that it knows of the valve.
class InventoryLoop final : public Excitation {
 public:
  InventoryLoop(const InventoryLoopExcitation& config, double period_s,
                std::uint64_t seed);

  bool is_open_loop() const override { return false; }
  ProcessInputs InitialInputs() const override;
  void Hold(bool held) override { held_ = held; }
  ProcessInputs Next(const FlowOfPressures& flow) override;

 private:
  InventoryLoopExcitation config_;
  double period_s_;
  DisturbanceProcess demand_;
  DisturbanceProcess p1_;
  DisturbanceProcess p2_;
  DisturbanceProcess level_noise_;
  InventoryController controller_;
  double level_pct_{0.0};  // Above the set point.
  double mean_flow_{0.0};  // In the first sample; 0 before.
  ProcessInputs last_;
  bool held_{false};
};

/// The default loop at a temperature at which `medium` is what its name says:
/// at 1000 kPa, water boils at 180 degC and steam condenses.
InventoryLoopExcitation InventoryLoopOf(const Medium& medium);

}  // namespace fdi::simulator
