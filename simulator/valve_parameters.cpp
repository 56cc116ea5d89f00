#include "simulator/valve_parameters.h"

#include <cmath>
#include <limits>
#include <utility>

#include "base/csv_cells.h"
#include "base/error.h"
#include "base/text.h"
#include "simulator/require_range.h"

// The shipped valves, and the range of each parameter. The ranges are wide:
// they keep the equations solvable (no mass, volume or lag of 0) and catch most
// values in another unit, but do not say what is usual.
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

// F_L and x_T of a contoured plug, flow to open.
ValveParameters Globe(const char* name, Fluid fluid, double flow_high) {
  ValveParameters valve;
  valve.name = name;
  valve.medium.fluid = fluid;
  valve.trim.kv_m3_h = 40.0;
  valve.trim.exponent = std::log(50.0);
  valve.trim.bypass_kv_m3_h = 7.0;
  valve.trim.liquid_recovery = 0.90;
  valve.trim.choked_pressure_ratio = 0.72;
  valve.instruments.flow = {0.0, flow_high, 0.00141 * flow_high};
  valve.instruments.temperature = {0.0, 600.0, 0.846};
  return valve;
}

std::vector<ValveParameters> ShippedSets() {
  return {LublinActuator3(),
          LublinActuator3Refit(),
          PaperOperatingPoint(),
          Globe("liquid-globe", Fluid::kWater, 100.0),
          Globe("gas-globe", Fluid::kGas, 10.0),
          Globe("steam-globe", Fluid::kSteam, 5.0)};
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
  RequireRange("actuator.stroke_time_s", a.stroke_time_s, 0.5, 600.0);
  RequireRange("actuator.dead_band", a.dead_band, 1e-4, 0.2);
}

void ValidateTrim(const Trim& t) {
  RequireRange("trim.kv_m3_h", t.kv_m3_h, 1e-5, 1e6);
  RequireRange("trim.exponent", t.exponent, 0.1, 20.0);
  RequireRange("trim.shut_off", t.shut_off, 0.5, 0.9999);
  RequireRange("trim.leakage", t.leakage, 0.0, 0.1);
  // 0 stands for the benchmark's table of Km (RecoveryCoefficient).
  if (t.liquid_recovery != 0.0) {
    RequireRange("trim.liquid_recovery", t.liquid_recovery, 0.1, 1.0);
  }
  RequireRange("trim.choked_pressure_ratio", t.choked_pressure_ratio, 0.05,
               1.0);
  RequireRange("trim.bypass_kv_m3_h", t.bypass_kv_m3_h, 0.0, 1e6);
  const bool is_table = t.characteristic == FlowCharacteristic::kTable;
  if (t.table_h.size() != t.table_f.size() ||
      (is_table ? t.table_h.size() < 2 : !t.table_h.empty())) {
    throw ConfigError(
        "trim.table_h and trim.table_f have " +
        std::to_string(t.table_h.size()) + " and " +
        std::to_string(t.table_f.size()) +
        " values: expected equally many, at least 2, of a trim whose "
        "characteristic is \"table\", and none of others");
  }
  constexpr std::size_t kMostPoints = 50;
  if (t.table_h.size() > kMostPoints) {
    throw ConfigError("trim.table_h has " + std::to_string(t.table_h.size()) +
                      " values: expected at most " +
                      std::to_string(kMostPoints));
  }
  for (const auto& [name, table] :
       {std::pair{"trim.table_h", &t.table_h}, {"trim.table_f", &t.table_f}}) {
    double before = 0.0;
    for (const double value : *table) {
      if (!(value > before)) {
        throw ConfigError(std::string(name) + " has " + NumberText(value) +
                          " behind " + NumberText(before) +
                          ": expected values above 0 that rise");
      }
      before = value;
    }
    if (is_table && before != 1.0) {
      throw ConfigError(std::string(name) + " ends at " + NumberText(before) +
                        ": expected 1, the valve fully open");
    }
  }
  if (is_table && t.leakage >= t.table_f.front()) {
    throw ConfigError("trim.leakage is " + NumberText(t.leakage) +
                      ": expected less than trim.table_f at the first point");
  }
}

void ValidateMedium(const Medium& m) {
  RequireRange("medium.density_kg_m3", m.density_kg_m3, 100.0, 2e4);
  RequireRange("medium.critical_pressure_kpa", m.critical_pressure_kpa, 100.0,
               1e5);
  RequireRange("medium.vapour_pressure_kpa", m.vapour_pressure_kpa, 0.0,
               m.critical_pressure_kpa);
  RequireRange("medium.molar_mass_kg_kmol", m.molar_mass_kg_kmol, 1.0, 500.0);
  RequireRange("medium.compressibility", m.compressibility, 0.1, 3.0);
  RequireRange("medium.isentropic_exponent", m.isentropic_exponent, 1.01, 2.0);
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
  std::vector<std::string> names;
  for (const ValveParameters& set : ShippedSets()) {
    names.push_back(set.name);
  }
  return names;
}

std::string Describe(const ValveParameters& valve) {
  const auto name = []<typename Enum>(Enum value) {
    return std::string(kEnumNames<Enum>[static_cast<std::size_t>(value)]);
  };
  const Instrumentation& i = valve.instruments;
  return name(valve.medium.fluid) + ", " + name(valve.trim.characteristic) +
         ", Kv " + NumberText(valve.trim.kv_m3_h) + " m3/h, " +
         (valve.actuator.drive == ActuatorDrive::kElectric
              ? "electric"
              : "spring " + name(valve.actuator.spring)) +
         ", F " + NumberText(i.flow.low) + ".." + NumberText(i.flow.high) +
         ' ' + std::string(FlowUnitName(i.flow_unit));
}

ValveParameters ParameterSet(std::string_view name) {
  for (const ValveParameters& set : ShippedSets()) {
    if (set.name == name) {
      return set;
    }
  }
  throw ConfigError("unknown parameter set '" + std::string(name) +
                    "': expected one of " + JoinText(ParameterSetNames()));
}

void Validate(const ValveParameters& parameters) {
  ValidateActuator(parameters.actuator);
  ValidatePositioner(parameters.positioner);
  ValidateTrim(parameters.trim);
  ValidateMedium(parameters.medium);
  const Instrumentation& i = parameters.instruments;
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
