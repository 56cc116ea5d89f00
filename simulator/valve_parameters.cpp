#include "simulator/valve_parameters.h"

#include <cmath>
#include <limits>

#include "base/error.h"
#include "simulator/require_range.h"

namespace fdi::simulator {
namespace {

ValveParameters LublinActuator3() {
  ValveParameters valve;
  valve.positioner.transducer_dead_zone = true;
  valve.positioner.relay = AirRelay::kOrifice;
  return valve;
}

ValveParameters LublinActuator3Refit() {
  ValveParameters valve;
  valve.name = "lublin-actuator-3-refit";
  valve.positioner.filling_cv = 2.5e-3;
  valve.positioner.venting_cv = 1.45e-3;
  valve.positioner.filter_time_s = 0.25;
  valve.trim.kv_m3_h = 70.0;
  valve.trim.exponent = 4.07;
  return valve;
}

ValveParameters PaperOperatingPoint() {
  ValveParameters valve;
  valve.name = "paper-operating-point";
  // The data sheet's supply: with it, evaporation opens the valve fully.
  valve.actuator.supply_pressure_gauge_pa = 240e3;
  valve.trim.characteristic = FlowCharacteristic::kLinear;
  valve.trim.kv_m3_h = 63.0;
  valve.instruments.flow_unit = FlowUnit::kM3PerHour;
  valve.instruments.flow = {0.0, 120.0, 0.557};
  valve.instruments.position.noise_sd = 0.412;
  return valve;
}

void Validate(const char* name, const Transmitter& transmitter) {
  const std::string field = std::string("instruments.") + name;
  constexpr double kHuge = 1e9;
  RequireRange(field + ".low", transmitter.low, -kHuge, kHuge);
  RequireRange(field + ".high", transmitter.high, -kHuge, kHuge);
  RequirePositive(field + ".high - low", transmitter.high - transmitter.low);
  RequireRange(field + ".noise_sd", transmitter.noise_sd, 0.0, kHuge);
}

void ValidateActuator(const ActuatorParameters& a) {
  RequireRange("actuator.moving_mass_kg", a.moving_mass_kg, 0.1, 1e3);
  RequireRange("actuator.damping_n_s_m", a.damping_n_s_m, 1.0, 1e6);
  RequireRange("actuator.spring_rate_n_m", a.spring_rate_n_m, 1e2, 1e8);
  RequireRange("actuator.spring_preload_m", a.spring_preload_m, 0.0, 1.0);
  RequireRange("actuator.diaphragm_area_m2", a.diaphragm_area_m2, 1e-4, 1.0);
  RequireRange("actuator.stroke_m", a.stroke_m, 1e-3, 1.0);
  RequireRange("actuator.chamber_volume_m3", a.chamber_volume_m3, 1e-5, 1.0);
  RequireRange("actuator.air_temperature_k", a.air_temperature_k, 200.0, 400.0);
  RequireRange("actuator.ambient_pressure_pa", a.ambient_pressure_pa, 5e4,
               1.5e5);
  RequireRange("actuator.supply_pressure_gauge_pa", a.supply_pressure_gauge_pa,
               1.2e5, 2e6);
  RequireRange("actuator.plug_area_m2", a.plug_area_m2, 0.0, 1.0);
  RequireRange("actuator.play_fraction", a.play_fraction, 0.0, 1.0);
  RequireRange("actuator.lowest_travel", a.lowest_travel, -1.0, 0.0);
  RequireRange("actuator.highest_travel", a.highest_travel, 1.0, 2.0);
  RequireRange("actuator.coulomb_friction_n", a.coulomb_friction_n, 0.0, 1e5);
}

void ValidatePositioner(const PositionerParameters& p) {
  RequireRange("positioner.gain", p.gain, 0.1, 1e4);
  RequireRange("positioner.integral_time_s", p.integral_time_s, 1e-3,
               std::numeric_limits<double>::infinity());
  RequireRange("positioner.derivative_time_s", p.derivative_time_s, 0.0, 100.0);
  RequireRange("positioner.filter_time_s", p.filter_time_s, 1e-3, 100.0);
  if (p.sampling_period_s != 0.0) {
    RequireRange("positioner.sampling_period_s", p.sampling_period_s, 1e-3,
                 10.0);
  }
  RequireRange("positioner.filling_cv", p.filling_cv, 1e-6, 1.0);
  RequireRange("positioner.venting_cv", p.venting_cv, 1e-6, 1.0);
  RequireRange("positioner.orifice_coefficient", p.orifice_coefficient, 1e-9,
               1e-3);
}

}  // namespace

std::vector<std::string> ParameterSetNames() {
  return {"lublin-actuator-3", "lublin-actuator-3-refit",
          "paper-operating-point"};
}

ValveParameters ParameterSet(std::string_view name) {
  for (const ValveParameters& set :
       {LublinActuator3(), LublinActuator3Refit(), PaperOperatingPoint()}) {
    if (set.name == name) {
      return set;
    }
  }
  throw ConfigError("unknown parameter set '" + std::string(name) +
                    "': expected lublin-actuator-3, lublin-actuator-3-refit "
                    "or paper-operating-point");
}

void Validate(const ValveParameters& parameters) {
  ValidateActuator(parameters.actuator);
  ValidatePositioner(parameters.positioner);
  RequireRange("trim.kv_m3_h", parameters.trim.kv_m3_h, 0.1, 1e5);
  RequireRange("trim.exponent", parameters.trim.exponent, 0.1, 20.0);
  RequireRange("trim.bypass_kv_m3_h", parameters.trim.bypass_kv_m3_h, 0.0, 1e5);
  const InstrumentParameters& i = parameters.instruments;
  Validate("command", i.command);
  Validate("pressure", i.pressure);
  Validate("temperature", i.temperature);
  Validate("position", i.position);
  Validate("flow", i.flow);
  RequireRange("instruments.positioner_noise_sd_pct", i.positioner_noise_sd_pct,
               0.0, 100.0);
  RequireRange("instruments.resolution_bits", i.resolution_bits, 4, 32);
}

}  // namespace fdi::simulator
