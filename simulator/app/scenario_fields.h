#pragma once

#include <string>
#include <string_view>

#include "simulator/excitation.h"
#include "simulator/operation.h"
#include "simulator/valve_parameters.h"

/// The fields of parameters and excitations by their names in TOML: one list
/// that the reader and the writer share. `visit(name, field)` is called for
/// each field; a struct within is visited by its own list.
namespace fdi::simulator {

template <typename Visitor>
void VisitFields(Disturbance& d, Visitor&& visit) {
  visit("sd", d.sd);
  visit("correlation", d.correlation);
}

template <typename Visitor>
void VisitFields(OperatingPointExcitation& e, Visitor&& visit) {
  visit("cv_pct", e.cv_pct);
  visit("cv_noise_pct", e.cv_noise_pct);
  visit("p1_kpa", e.p1_kpa);
  visit("p1_noise_kpa", e.p1_noise_kpa);
  visit("p2_kpa", e.p2_kpa);
  visit("p2_noise_kpa", e.p2_noise_kpa);
  visit("t1_degc", e.t1_degc);
  visit("amplitude_pct", e.amplitude_pct);
  visit("period_s", e.period_s);
}

template <typename Visitor>
void VisitFields(SineExcitation& e, Visitor&& visit) {
  visit("phase_s", e.phase_s);
}

template <typename Visitor>
void VisitFields(LevelLoopExcitation& e, Visitor&& visit) {
  visit("level_set_point_pct", e.level_set_point_pct);
  visit("steam_demand_t_h", e.steam_demand_t_h);
  visit("steam_noise_t_h", e.steam_noise_t_h);
  visit("level_noise_pct", e.level_noise_pct);
  visit("pump_noise_kpa", e.pump_noise_kpa);
  visit("initial_cv_pct", e.initial_cv_pct);
  visit("proportional_gain", e.proportional_gain);
  visit("integral_time_s", e.integral_time_s);
  visit("inlet_opening", e.inlet_opening);
  visit("outlet_opening", e.outlet_opening);
  visit("bypass_opening", e.bypass_opening);
}

template <typename Visitor>
void VisitFields(InputProfile& p, Visitor&& visit) {
  visit("t_s", p.t_s);
  visit("cv_pct", p.cv_pct);
  visit("p1_kpa", p.p1_kpa);
  visit("p2_kpa", p.p2_kpa);
  visit("t1_degc", p.t1_degc);
  visit("cv_noise_pct", p.cv_noise_pct);
  visit("p1_noise_kpa", p.p1_noise_kpa);
  visit("p2_noise_kpa", p.p2_noise_kpa);
}

/// Its rows come from a file.
template <typename Visitor>
void VisitFields(RecordedExcitation&, Visitor&&) {}

template <typename Visitor>
void VisitFields(ActuatorParameters& a, Visitor&& visit) {
  visit("moving_mass_kg", a.moving_mass_kg);
  visit("damping_n_s_m", a.damping_n_s_m);
  visit("spring_rate_n_m", a.spring_rate_n_m);
  visit("spring_preload_m", a.spring_preload_m);
  visit("diaphragm_area_m2", a.diaphragm_area_m2);
  visit("stroke_m", a.stroke_m);
  visit("chamber_volume_m3", a.chamber_volume_m3);
  visit("air_temperature_k", a.air_temperature_k);
  visit("ambient_pressure_pa", a.ambient_pressure_pa);
  visit("supply_pressure_gauge_pa", a.supply_pressure_gauge_pa);
  visit("plug_area_m2", a.plug_area_m2);
  visit("play_fraction", a.play_fraction);
  visit("coulomb_friction_n", a.coulomb_friction_n);
}

template <typename Visitor>
void VisitFields(PositionerParameters& p, Visitor&& visit) {
  visit("gain", p.gain);
  visit("integral_time_s", p.integral_time_s);
  visit("derivative_time_s", p.derivative_time_s);
  visit("filter_time_s", p.filter_time_s);
  visit("sampling_period_s", p.sampling_period_s);
  visit("filling_cv", p.filling_cv);
  visit("venting_cv", p.venting_cv);
  visit("transducer_dead_zone", p.transducer_dead_zone);
}

template <typename Visitor>
void VisitFields(TrimParameters& t, Visitor&& visit) {
  visit("kv_m3_h", t.kv_m3_h);
  visit("characteristic", t.characteristic);
  visit("exponent", t.exponent);
  visit("bypass_kv_m3_h", t.bypass_kv_m3_h);
}

template <typename Visitor>
void VisitFields(Transmitter& t, Visitor&& visit) {
  visit("low", t.low);
  visit("high", t.high);
  visit("noise_sd", t.noise_sd);
}

template <typename Visitor>
void VisitFields(InstrumentParameters& i, Visitor&& visit) {
  visit("flow_unit", i.flow_unit);
  visit("command", i.command);
  visit("pressure", i.pressure);
  visit("temperature", i.temperature);
  visit("position", i.position);
  visit("flow", i.flow);
  visit("positioner_noise_sd_pct", i.positioner_noise_sd_pct);
  visit("resolution_bits", i.resolution_bits);
}

template <typename Visitor>
void VisitFields(ValveParameters& v, Visitor&& visit) {
  visit("name", v.name);
  visit("actuator", v.actuator);
  visit("positioner", v.positioner);
  visit("trim", v.trim);
  visit("instruments", v.instruments);
}

/// Text in TOML's quotes.
std::string QuoteToml(std::string_view text);

}  // namespace fdi::simulator
