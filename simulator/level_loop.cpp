#include "simulator/level_loop.h"

#include <algorithm>
#include <cmath>

#include "simulator/valve_equations.h"

namespace fdi::simulator {
namespace {

constexpr double kKgPerSPerTPerH = 1.0 / 3.6;
constexpr double kFeedTemperatureC = 100.7;
constexpr double kDrumPressurePa = 2398.6e3;
constexpr double kBlowDownKgS = 2.45 * kKgPerSPerTPerH;
constexpr double kFiringW = 10.25e6;
constexpr double kFeedEnthalpy = 424e3;      // J/kg.
constexpr double kWaterEnthalpy = 951e3;     // Saturated at 2.4 MPa.
constexpr double kSteamEnthalpy = 2802e3;    // Saturated at 2.4 MPa.
constexpr double kSteamHeat = 2490.0;        // cp of the steam, J/(kg K).
constexpr double kLevelMassKg = 27.4;        // Per % of level.
constexpr double kDrumEnergy = 735.0;        // J/Pa.
constexpr double kSuperheaterHeat = 1.04e6;  // J/K.
constexpr double kSteamTemperatureC = 398.8;
constexpr double kSuperheaterShare = 0.178;  // Share of the firing power.
constexpr double kFiringGain = 60.0;         // W/Pa.
constexpr double kFiringIntegralS = 300.0;
constexpr double kHandValveKv = 250.0;  // V1 and V2, open [m3/h].

// Tsat of water near 2.4 MPa: 221.8 degC there, 0.020 K per kPa.
double DrumTemperature(double pressure_pa) {
  return 221.8 + 0.020e-3 * (pressure_pa - 2.4e6);
}

double FeedDensity() {
  return WaterDensity(kFeedTemperatureC);
}

double TonsPerHour(double flow_m3_h) {
  return flow_m3_h * FeedDensity() / 1000.0;
}

// Additional pressure loss of a throttled hand valve [Pa]: 1 bar rho/1000
// (Q/Kv)^2 with Kv in proportion to the opening, less the loss of the open
// valve, which is part of that of the line.
double HandValveLoss(double flow_m3_h, double opening) {
  const double open = flow_m3_h / kHandValveKv;
  return 1e5 * FeedDensity() / 1000.0 * open * open *
         (1.0 / (opening * opening) - 1.0);
}

}  // namespace

LevelLoop::LevelLoop(const LevelLoopExcitation& config, double period_s,
                     std::uint64_t seed)
    : config_(config),
      period_s_(period_s),
      steam_(config.steam_noise_t_h, NormalSource(seed, 21)),
      pump_(config.pump_noise_kpa, NormalSource(seed, 22)),
      level_noise_(config.level_noise_pct, NormalSource(seed, 23)),
      boiler_{config.level_set_point_pct,
              kDrumPressurePa,
              config.steam_demand_t_h * kKgPerSPerTPerH,
              kSteamTemperatureC,
              config.steam_demand_t_h * kKgPerSPerTPerH + kBlowDownKgS,
              kFiringW},
      controller_(config.proportional_gain, config.integral_time_s,
                  config.initial_cv_pct) {}

ProcessInputs LevelLoop::InitialInputs() const {
  const double flow = boiler_.feed_flow_kg_s * 3600.0 / FeedDensity();
  return {config_.initial_cv_pct / 100.0, InletPressure(flow),
          OutletPressure(flow), kFeedTemperatureC};
}

double LevelLoop::InletPressure(double flow_m3_h) const {
  return 3557e3 - 3e3 * (TonsPerHour(flow_m3_h) - 17.3) -
         HandValveLoss(flow_m3_h, config_.inlet_opening) + pump_offset_pa_;
}

double LevelLoop::OutletPressure(double flow_m3_h) const {
  const double flow = TonsPerHour(flow_m3_h);
  return boiler_.drum_pressure_pa + 178e3 + 0.13e3 * flow * flow +
         HandValveLoss(flow_m3_h, config_.outlet_opening);
}

// Euler steps of at most 0.1 s: the fastest time constant is about a minute.
void LevelLoop::AdvanceBoiler() {
  const int steps = static_cast<int>(std::ceil(period_s_ / 0.1));
  const double h = period_s_ / steps;
  BoilerState& b = boiler_;
  for (int i = 0; i < steps; ++i) {
    const double error = kDrumPressurePa - b.drum_pressure_pa;
    firing_integral_w_ += kFiringGain * error / kFiringIntegralS * h;
    b.firing_w = std::clamp(kFiringW + kFiringGain * error + firing_integral_w_,
                            0.0, 2.0 * kFiringW);
    const double level_rate =
        (b.feed_flow_kg_s - b.steam_flow_kg_s - kBlowDownKgS) / kLevelMassKg;
    const double pressure_rate =
        (b.firing_w - b.feed_flow_kg_s * (kWaterEnthalpy - kFeedEnthalpy) -
         b.steam_flow_kg_s * (kSteamEnthalpy - kWaterEnthalpy)) /
        kDrumEnergy;
    const double superheat =
        b.steam_temperature_c - DrumTemperature(b.drum_pressure_pa);
    const double temperature_rate =
        (kSuperheaterShare * b.firing_w -
         b.steam_flow_kg_s * kSteamHeat * superheat) /
        kSuperheaterHeat;
    b.level_pct = std::clamp(b.level_pct + h * level_rate, 0.0, 100.0);
    b.drum_pressure_pa += h * pressure_rate;
    b.steam_temperature_c += h * temperature_rate;
  }
}

// The integral stays within 0..100 %, so that CV leaves its end once the error
// turns.
double InventoryController::Next(double error, double period_s) {
  integral_pct_ += gain_ / integral_time_s_ * error * period_s;
  integral_pct_ = std::clamp(integral_pct_, 0.0, 100.0);
  return std::clamp(integral_pct_ + gain_ * error, 0.0, 100.0);
}

// While CV is prescribed the loop is held: boiler and controller stand, to go
// on from there, but the pressures follow the flow. Forty halvings leave 1e-9
// m3/h of it.
ProcessInputs LevelLoop::Next(const FlowOfPressures& flow) {
  if (started_ && !held_) {
    AdvanceBoiler();
  }
  started_ = true;
  boiler_.steam_flow_kg_s =
      std::max(0.0, config_.steam_demand_t_h + steam_.Next()) * kKgPerSPerTPerH;
  pump_offset_pa_ = 1e3 * pump_.Next();
  const double reading = boiler_.level_pct + level_noise_.Next();
  const double cv_pct =
      held_
          ? controller_.integral_pct()
          : controller_.Next(reading - config_.level_set_point_pct, period_s_);
  // More flow leaves less driving pressure, so bisection finds the balance.
  double low = 0.0;
  double high = 1000.0;
  for (int i = 0; i < 40; ++i) {
    const double middle = 0.5 * (low + high);
    const bool more =
        flow(InletPressure(middle), OutletPressure(middle)) > middle;
    (more ? low : high) = middle;
  }
  if (!held_) {
    boiler_.feed_flow_kg_s = low * FeedDensity() / 3600.0;
  }
  return {cv_pct / 100.0, InletPressure(low), OutletPressure(low),
          kFeedTemperatureC};
}

InventoryLoop::InventoryLoop(const InventoryLoopExcitation& config,
                             double period_s, std::uint64_t seed)
    : config_(config),
      period_s_(period_s),
      demand_(config.demand_noise_pct, NormalSource(seed, 31)),
      p1_(config.p1_noise_kpa, NormalSource(seed, 32)),
      p2_(config.p2_noise_kpa, NormalSource(seed, 33)),
      level_noise_(config.level_noise_pct, NormalSource(seed, 34)),
      controller_(config.proportional_gain, config.integral_time_s,
                  config.initial_cv_pct),
      last_(InitialInputs()) {}

ProcessInputs InventoryLoop::InitialInputs() const {
  return {config_.initial_cv_pct / 100.0, 1e3 * config_.p1_kpa,
          1e3 * config_.p2_kpa, config_.t1_degc};
}

ProcessInputs InventoryLoop::Next(const FlowOfPressures& flow) {
  const double now = flow(last_.inlet_pressure_pa, last_.outlet_pressure_pa);
  const double demand = 1.0 + 0.01 * demand_.Next();
  // The flow of the start is what a demand of 1 takes, so the loop is in
  // balance with a valve of any size.
  if (mean_flow_ == 0.0) {
    mean_flow_ = std::max(now, 1e-12);
  } else if (!held_) {
    level_pct_ += 100.0 * period_s_ / config_.holding_time_s *
                  (now / mean_flow_ - demand);
    level_pct_ = std::clamp(level_pct_, -50.0, 50.0);
  }
  const double reading = level_pct_ + level_noise_.Next();
  const double cv_pct =
      held_ ? controller_.integral_pct() : controller_.Next(reading, period_s_);
  last_ = {cv_pct / 100.0, 1e3 * (config_.p1_kpa + p1_.Next()),
           1e3 * (config_.p2_kpa + p2_.Next()), config_.t1_degc};
  return last_;
}

InventoryLoopExcitation InventoryLoopOf(const Medium& medium) {
  constexpr double kLiquidC = 43.0;  // As in the other excitations.
  InventoryLoopExcitation loop;
  if (!medium.is_gas()) {
    loop.t1_degc = kLiquidC;
  }
  return loop;
}

}  // namespace fdi::simulator
