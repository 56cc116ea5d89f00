#include "simulator/excitation.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>

#include "base/error.h"
#include "simulator/level_loop.h"
#include "simulator/random.h"
#include "simulator/require_range.h"

namespace fdi::simulator {
namespace {

constexpr double kTwoPi = 2.0 * std::numbers::pi;

// The valve takes commands of 0 to 100 %; noise, the sine and recorded rows
// (accepted from -10 to 110 %) may lie beyond.
ProcessInputs FromRow(const InputRow& row) {
  return {std::clamp(row.cv_pct, 0.0, 100.0) / 100.0, row.p1_kpa * 1e3,
          row.p2_kpa * 1e3, row.t1_degc};
}

class OperatingPoint final : public Excitation {
 public:
  OperatingPoint(const OperatingPointExcitation& config, double period_s,
                 std::uint64_t seed)
      : config_(config),
        period_s_(period_s),
        // A stream of the seed for each: to change one disturbance leaves the
        // others as they were, number by number.
        cv_(config.cv_noise_pct, NormalSource(seed, 11)),
        p1_(config.p1_noise_kpa, NormalSource(seed, 12)),
        p2_(config.p2_noise_kpa, NormalSource(seed, 13)) {}

  ProcessInputs Next(const FlowOfPressures&) override {
    const double t = static_cast<double>(sample_++) * period_s_;
    const double wave =
        config_.amplitude_pct * std::sin(kTwoPi * t / config_.period_s);
    return FromRow({config_.cv_pct + wave + cv_.Next(),
                    config_.p1_kpa + p1_.Next(), config_.p2_kpa + p2_.Next(),
                    config_.t1_degc});
  }

 private:
  OperatingPointExcitation config_;
  double period_s_;
  DisturbanceProcess cv_;
  DisturbanceProcess p1_;
  DisturbanceProcess p2_;
  std::uint64_t sample_{0};
};

class Sine final : public Excitation {
 public:
  Sine(const SineExcitation& config, double period_s)
      : phase_s_(config.phase_s), period_s_(period_s) {}

  ProcessInputs Next(const FlowOfPressures&) override {
    return At(phase_s_ + static_cast<double>(sample_++) * period_s_);
  }

  InputFunction AsFunction() const override {
    return [phase_s = phase_s_](double time_s) { return At(phase_s + time_s); };
  }

 private:
  // Fixed numbers, because the benchmark's recordings were made with them
  // (docs/model.md): they can only be compared under the same inputs.
  static ProcessInputs At(double t) {
    return FromRow({50.0 + 25.0 * std::sin(kTwoPi * 0.01 * t),
                    3500.0 + 175.0 * std::sin(kTwoPi * 0.1 * t),
                    2600.0 + 26.0 * std::sin(2.0 * t), 43.0});
  }

  double phase_s_;
  double period_s_;
  std::uint64_t sample_{0};
};

class Recorded final : public Excitation {
 public:
  Recorded(RecordedExcitation config, double period_s)
      : config_(std::move(config)), period_s_(period_s) {}

  // Held beyond the last row, because the pressures of the last period need one
  // more row.
  ProcessInputs Next(const FlowOfPressures&) override {
    const std::size_t last = config_.rows.size() - 1;
    return FromRow(config_.rows[std::min(row_++, last)]);
  }

  // Refers to the rows of this object and must not outlive it.
  InputFunction AsFunction() const override {
    return [this](double time_s) { return At(time_s / period_s_); };
  }

 private:
  // Interpolates linearly between the rows.
  ProcessInputs At(double row) const {
    const auto last = static_cast<double>(config_.rows.size() - 1);
    const double at = std::clamp(row, 0.0, last);
    const auto i = static_cast<std::size_t>(at);
    const InputRow& a = config_.rows[i];
    const InputRow& b = config_.rows[std::min(i + 1, config_.rows.size() - 1)];
    const double share = at - std::floor(at);
    return FromRow({std::lerp(a.cv_pct, b.cv_pct, share),
                    std::lerp(a.p1_kpa, b.p1_kpa, share),
                    std::lerp(a.p2_kpa, b.p2_kpa, share),
                    std::lerp(a.t1_degc, b.t1_degc, share)});
  }

  RecordedExcitation config_;
  double period_s_;
  std::size_t row_{0};
};

void ValidateOne(const OperatingPointExcitation& e) {
  RequireRange("operating-point.cv_pct", e.cv_pct, 0.0, 100.0);
  RequireRange("operating-point.p1_kpa", e.p1_kpa, 0.0, 2e4);
  RequireRange("operating-point.p2_kpa", e.p2_kpa, 0.0, 2e4);
  RequireRange("operating-point.t1_degc", e.t1_degc, kColdestMediumC,
               kHottestMediumC);
  RequireRange("operating-point.amplitude_pct", e.amplitude_pct, 0.0, 50.0);
  RequirePositive("operating-point.period_s", e.period_s);
  RequireDisturbance("operating-point.cv_noise_pct", e.cv_noise_pct);
  RequireDisturbance("operating-point.p1_noise_kpa", e.p1_noise_kpa);
  RequireDisturbance("operating-point.p2_noise_kpa", e.p2_noise_kpa);
}

void ValidateOne(const SineExcitation& e) {
  RequireRange("sine.phase_s", e.phase_s, 0.0, 1e9);
}

void ValidateOne(const LevelLoopExcitation& e) {
  RequireRange("level-loop.level_set_point_pct", e.level_set_point_pct, 10.0,
               90.0);
  RequireRange("level-loop.steam_demand_t_h", e.steam_demand_t_h, 1.0, 30.0);
  RequireDisturbance("level-loop.steam_noise_t_h", e.steam_noise_t_h);
  RequireDisturbance("level-loop.pump_noise_kpa", e.pump_noise_kpa);
  RequireDisturbance("level-loop.level_noise_pct", e.level_noise_pct);
  RequireRange("level-loop.initial_cv_pct", e.initial_cv_pct, 0.0, 100.0);
  RequireRange("level-loop.proportional_gain", e.proportional_gain, 0.0, 100.0);
  RequireRange("level-loop.integral_time_s", e.integral_time_s, 1.0, 1e6);
  RequireRange("level-loop.inlet_opening", e.inlet_opening, 0.05, 1.0);
  RequireRange("level-loop.outlet_opening", e.outlet_opening, 0.05, 1.0);
  RequireRange("level-loop.bypass_opening", e.bypass_opening, 0.0, 1.0);
}

void ValidateOne(const InventoryLoopExcitation& e) {
  RequireRange("inventory-loop.initial_cv_pct", e.initial_cv_pct, 1.0, 99.0);
  RequireDisturbance("inventory-loop.demand_noise_pct", e.demand_noise_pct);
  RequireDisturbance("inventory-loop.level_noise_pct", e.level_noise_pct);
  RequireRange("inventory-loop.p1_kpa", e.p1_kpa, 0.0, 2e4);
  RequireDisturbance("inventory-loop.p1_noise_kpa", e.p1_noise_kpa);
  RequireRange("inventory-loop.p2_kpa", e.p2_kpa, 0.0, 2e4);
  RequireDisturbance("inventory-loop.p2_noise_kpa", e.p2_noise_kpa);
  RequireRange("inventory-loop.t1_degc", e.t1_degc, kColdestMediumC,
               kHottestMediumC);
  RequireRange("inventory-loop.holding_time_s", e.holding_time_s, 1.0, 1e6);
  RequireRange("inventory-loop.proportional_gain", e.proportional_gain, 0.0,
               100.0);
  RequireRange("inventory-loop.integral_time_s", e.integral_time_s, 1.0, 1e6);
}

void ValidateOne(const RecordedExcitation& e) {
  if (e.rows.empty()) {
    throw ConfigError("csv excitation: it has no rows, expected at least 1");
  }
  for (std::size_t i = 0; i < e.rows.size(); ++i) {
    const std::string row = "csv row " + std::to_string(i + 1) + ' ';
    RequireRange(row + "CV [%]", e.rows[i].cv_pct, -10.0, 110.0);
    RequireRange(row + "P1 [kPa]", e.rows[i].p1_kpa, 0.0, 2e4);
    RequireRange(row + "P2 [kPa]", e.rows[i].p2_kpa, 0.0, 2e4);
    RequireRange(row + "T1 [degC]", e.rows[i].t1_degc, kColdestMediumC,
                 kHottestMediumC);
  }
}

// In the order of the alternatives of ExcitationConfig, whose index() selects.
constexpr std::string_view kNames[] = {"operating-point", "sine", "level-loop",
                                       "inventory-loop", "csv"};

}  // namespace

void RequireDisturbance(const std::string& field,
                        const Disturbance& disturbance) {
  RequireRange(field + ".sd", disturbance.sd, 0.0, 1e4);
  RequireRange(field + ".correlation", disturbance.correlation, 0.0, 0.9999);
}

std::string_view ExcitationName(const ExcitationConfig& config) {
  return kNames[config.index()];
}

ExcitationConfig DefaultExcitation(std::string_view name) {
  for (const ExcitationConfig& config :
       {ExcitationConfig(OperatingPointExcitation{}),
        ExcitationConfig(SineExcitation{}),
        ExcitationConfig(LevelLoopExcitation{}),
        ExcitationConfig(InventoryLoopExcitation{}),
        ExcitationConfig(RecordedExcitation{})}) {
    if (ExcitationName(config) == name) {
      return config;
    }
  }
  throw ConfigError("unknown excitation '" + std::string(name) +
                    "': expected operating-point, sine, level-loop, "
                    "inventory-loop or csv");
}

void Validate(const ExcitationConfig& config) {
  std::visit([](const auto& e) { ValidateOne(e); }, config);
}

std::unique_ptr<Excitation> MakeExcitation(const ExcitationConfig& config,
                                           double period_s,
                                           std::uint64_t seed) {
  Validate(config);
  RequirePositive("period_s", period_s);
  if (const auto* e = std::get_if<OperatingPointExcitation>(&config)) {
    return std::make_unique<OperatingPoint>(*e, period_s, seed);
  }
  if (const auto* e = std::get_if<SineExcitation>(&config)) {
    return std::make_unique<Sine>(*e, period_s);
  }
  if (const auto* e = std::get_if<LevelLoopExcitation>(&config)) {
    return std::make_unique<LevelLoop>(*e, period_s, seed);
  }
  if (const auto* e = std::get_if<InventoryLoopExcitation>(&config)) {
    return std::make_unique<InventoryLoop>(*e, period_s, seed);
  }
  return std::make_unique<Recorded>(std::get<RecordedExcitation>(config),
                                    period_s);
}

}  // namespace fdi::simulator
