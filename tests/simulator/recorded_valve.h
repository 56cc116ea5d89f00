#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "simulator/random.h"
#include "simulator/second_look/second_look.h"
#include "simulator/valve_simulation.h"

/// Records of a valve whose physics are known.
namespace fdi::simulator {

inline constexpr std::size_t kLeadIn = 120;

/// Readings of the transmitters of a valve while its command is set anew every
/// 10 s; `faults` act from row kLeadIn on, as does the loop, which then moves
/// the command by `moved`.
inline std::vector<RecordRow> Recording(
    std::size_t count, std::uint64_t seed,
    const std::vector<FaultSchedule>& faults, double moved = 0.0) {
  NormalSource noise(seed, 7);
  RecordedExcitation excitation;
  double level = 60.0;
  for (std::size_t k = 0; k < count; ++k) {
    level = k % 10 == 0 ? std::clamp(60.0 + 8.0 * noise(), 46.0, 80.0) : level;
    const double command = level + (k < kLeadIn ? 0.0 : moved);
    excitation.rows.push_back(
        {command, 3555.0 + 20.0 * noise(), 2615.0 + 10.0 * noise(), 100.7});
  }
  ValveSimulationConfig config;
  config.excitation = std::move(excitation);
  config.duration_s = static_cast<double>(count);
  config.faults = faults;
  config.seed = seed;
  ValveSimulation simulation(config);
  std::vector<RecordRow> rows;
  while (!simulation.finished()) {
    const Sample s = simulation.Step().sample;
    rows.push_back(
        {{s[Signal::kCv], s[Signal::kP1], s[Signal::kP2], s[Signal::kT1]},
         s[Signal::kX],
         s[Signal::kF]});
  }
  return rows;
}

/// Physics of that valve, as onboarding finds it.
inline const ValvePhysics& Physics() {
  static const ValvePhysics physics = DescribeValve(
      ParameterSet("lublin-actuator-3"), {}, {Recording(1200, 1, {})});
  return physics;
}

inline const ValveLooker& Looker() {
  static const ValveLooker looker(Physics());
  return looker;
}

inline LookWindow Window(const std::vector<FaultSchedule>& faults,
                         std::uint64_t seed = 2, double moved = 0.0) {
  return {Recording(kLeadIn + 200, seed, faults, moved), kLeadIn,
          kBasicSignals};
}

inline void SetReadings(const RecordRow& row, Sample& sample) {
  sample.Set(Signal::kCv, row.input.cv_pct);
  sample.Set(Signal::kP1, row.input.p1_kpa);
  sample.Set(Signal::kP2, row.input.p2_kpa);
  sample.Set(Signal::kT1, row.input.t1_degc);
  sample.Set(Signal::kX, row.x_pct);
  sample.Set(Signal::kF, row.flow);
}

inline FaultSchedule Abrupt(int fault, double strength) {
  FaultSchedule schedule;
  schedule.fault = fault;
  schedule.start_s = kLeadIn;
  schedule.final_strength = strength;
  return schedule;
}

}  // namespace fdi::simulator
