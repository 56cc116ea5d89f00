#include "trainer/onboarding/fault_synthesis.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>

#include "base/error.h"
#include "diagnosis/model/fault_catalogue.h"
#include "simulator/record_fit.h"
#include "simulator/valve_simulation.h"

namespace fdi::trainer {
namespace {

// With all signals these make 126 conditions; a model set has room for 127
// beside its normal observer (kMaxObservers).
constexpr std::array kStrengths{0.1, 0.25, 0.5, 0.75, 1.0};
constexpr std::array kSignedStrengths{0.1, 0.25, 0.5, 0.75};
// Shares of the span: faults of transmitters are steps.
constexpr std::array kTransmitterStrengths{0.02, 0.1, 0.5, 1.0};

void Add(int fault, const auto& strengths, bool both_ways,
         std::vector<FaultCondition>& faults) {
  for (const double strength : strengths) {
    faults.push_back({fault, strength});
    if (both_ways) {
      faults.push_back({fault, -strength});
    }
  }
}

}  // namespace

std::vector<FaultCondition> OnboardingFaults(
    SignalMask signals, const simulator::ValveParameters& valve,
    std::size_t most) {
  std::vector<FaultCondition> faults;
  for (int fault = 1; fault <= kLastFault; ++fault) {
    if (!IsVisibleIn(fault, signals) || !Exists(fault, valve) ||
        FaultFactsOf(fault).simulation_only) {
      continue;
    }
    if (TransmitterOf(fault)) {
      Add(fault, kTransmitterStrengths, true, faults);
    } else if (HasNegative(fault)) {
      Add(fault, kSignedStrengths, true, faults);
    } else {
      Add(fault, kStrengths, false, faults);
    }
  }
  // The search from the back finds the last faults first. 0.1 is the same
  // literal in all lists, so that it compares exactly.
  while (faults.size() > most) {
    const auto weakest =
        std::find_if(faults.rbegin(), faults.rend(), [](const auto& f) {
          return std::abs(f.strength) == kStrengths.front();
        });
    faults.erase(weakest == faults.rend() ? faults.end() - 1
                                          : std::next(weakest).base());
  }
  return faults;
}

namespace {

using simulator::Transmitter;

constexpr double kMinRatioFlow = 0.02;  // of the range of the transmitter

double Held(const Transmitter& transmitter, double value) {
  return std::clamp(value, transmitter.low, transmitter.high);
}

std::vector<Sample> Run(const simulator::ValveSimulationConfig& config) {
  simulator::ValveSimulation simulation(config);
  std::vector<Sample> samples;
  while (!simulation.finished()) {
    samples.push_back(simulation.Step().sample);
  }
  return samples;
}

// F F_i/F_0, which is free of the error of the simulated Kv. Where the
// simulated healthy flow is close to 0, the ratio would amplify any error, and
// F + F_i − F_0 takes its place.
double FaultyFlow(const Transmitter& transmitter, double reading,
                  double healthy, double faulty) {
  const double least = kMinRatioFlow * (transmitter.high - transmitter.low);
  return Held(transmitter, healthy > least ? reading * faulty / healthy
                                           : reading + faulty - healthy);
}

}  // namespace

InputRow InputsOf(const Sample& sample, const InputRow& levels) {
  const auto value = [&](Signal signal, double level) {
    return sample.Has(signal) ? sample[signal] : level;
  };
  return {value(Signal::kCv, levels.cv_pct), value(Signal::kP1, levels.p1_kpa),
          value(Signal::kP2, levels.p2_kpa),
          value(Signal::kT1, levels.t1_degc)};
}

FaultSynthesizer::FaultSynthesizer(ValveType type, bool at_position)
    : type_(std::move(type)), at_position_(at_position) {
  Validate(type_.parameters);
}

std::vector<Sample> FaultSynthesizer::Simulate(
    const FaultCondition& fault, const std::vector<Sample>& inputs) const {
  simulator::RecordedExcitation excitation;
  const auto last = static_cast<std::ptrdiff_t>(inputs.size()) - 1;
  // Row k gets the command stamped `delay` rows before it, or the nearest that
  // exists. The delay is negative where a plant stamps a command after it acts.
  for (std::ptrdiff_t k = 0; k <= last; ++k) {
    excitation.rows.push_back(
        InputsOf(inputs[static_cast<std::size_t>(k)], type_.levels));
    excitation.rows.back().cv_pct = inputs[static_cast<std::size_t>(std::clamp(
        k - type_.command_delay, std::ptrdiff_t{0}, last))][Signal::kCv];
  }
  simulator::ValveSimulationConfig config;
  config.parameters = type_.parameters;
  config.excitation = std::move(excitation);
  config.continuous_inputs = type_.interpolated_command;
  config.period_s = simulator::SimulatedPeriod(
      inputs.size() > 1
          ? 1e-9 * static_cast<double>(inputs[1].stamp_ns - inputs[0].stamp_ns)
          : 1.0,
      config.parameters);
  config.duration_s = config.period_s * static_cast<double>(inputs.size());
  // Only the difference of two simulations is used; the recorded readings have
  // noise and resolution of their own.
  config.noise = false;
  config.resolution = false;
  config.tolerance_scale = 10.0;  // X to 0.02 %, in half the time.
  if (fault.fault != 0) {
    simulator::FaultSchedule schedule;
    schedule.fault = fault.fault;
    schedule.final_strength = fault.strength;
    config.faults = {schedule};
  }
  return Run(config);
}

// One simulation for all faults of a stretch. The lock is not held while it
// runs: two threads may simulate the same stretch, with equal results, of which
// the first is kept.
std::vector<Sample> FaultSynthesizer::Healthy(const Stretch& stretch) const {
  const std::tuple key{stretch.run_id, stretch.samples.front().stamp_ns,
                       stretch.samples.size()};
  {
    const MutexLock lock(mutex_);
    const auto found = healthy_.find(key);
    if (found != healthy_.end()) {
      return found->second;
    }
  }
  std::vector<Sample> samples = Simulate({}, stretch.samples);
  const MutexLock lock(mutex_);
  healthy_.emplace(key, samples);
  return samples;
}

std::vector<Sample> FaultSynthesizer::BehindRod(
    const FaultCondition& fault, std::vector<Sample> samples) const {
  simulator::FaultEffects effects;
  simulator::ApplyFault(fault.fault, fault.strength, effects);
  const simulator::Instrumentation& i = type_.parameters.instruments;
  for (Sample& sample : samples) {
    // The fault of a transmitter of T1, P1 or P2 leaves the flow as it is.
    if (!TransmitterOf(fault.fault)) {
      sample.Set(Signal::kF, FlowReading(type_.parameters, effects,
                                         InputsOf(sample, type_.levels),
                                         sample[Signal::kX]));
    }
    const auto read = [&](Signal signal, const Transmitter& transmitter,
                          double value, double share) {
      sample.Set(signal, Held(transmitter, value + share * (transmitter.high -
                                                            transmitter.low)));
    };
    read(Signal::kP1, i.pressure, sample[Signal::kP1] * effects.inlet_factor,
         effects.inlet_reading_step);
    read(Signal::kP2, i.pressure, sample[Signal::kP2] * effects.outlet_factor,
         effects.outlet_reading_step);
    read(Signal::kT1, i.temperature,
         TemperatureWith(effects, sample[Signal::kT1]),
         effects.temperature_reading_step);
  }
  return samples;
}

std::vector<Sample> FaultSynthesizer::operator()(const FaultCondition& fault,
                                                 const Stretch& healthy) const {
  const std::vector<Sample> without = Healthy(healthy);
  // A fault that leaves the rod needs no simulation of its own: X is that of
  // the healthy valve, and the rest is algebra. So is any at a position that is
  // read, wherever the fault has taken the rod.
  const std::vector<Sample> with =
      fault.fault == 0 ? without
      : at_position_ || simulator::LeavesRod(fault.fault)
          ? BehindRod(fault, without)
          : Simulate(fault, healthy.samples);
  std::vector<Sample> samples = healthy.samples;
  const simulator::Instrumentation& instruments = type_.parameters.instruments;
  for (std::size_t k = 0; k < samples.size(); ++k) {
    Sample& sample = samples[k];
    const auto add = [&](Signal signal, const Transmitter& transmitter) {
      if (sample.Has(signal)) {
        sample.Set(signal, Held(transmitter, sample[signal] + with[k][signal] -
                                                 without[k][signal]));
      }
    };
    add(Signal::kP1, instruments.pressure);
    add(Signal::kP2, instruments.pressure);
    add(Signal::kT1, instruments.temperature);
    add(Signal::kX, instruments.position);
    if (sample.Has(Signal::kF)) {
      sample.Set(Signal::kF,
                 FaultyFlow(instruments.flow, sample[Signal::kF],
                            without[k][Signal::kF], with[k][Signal::kF]));
    }
  }
  return samples;
}

std::vector<Sample> SimulateHealthy(const ValveType& type, double duration_s,
                                    std::uint64_t seed) {
  simulator::ValveSimulationConfig config;
  config.parameters = type.parameters;
  if (type.parameters.medium.fluid == simulator::Fluid::kWater) {
    config.excitation = simulator::LevelLoopExcitation{};
  } else {
    simulator::InventoryLoopExcitation loop;
    loop.initial_cv_pct = type.levels.cv_pct;
    loop.p1_kpa = type.levels.p1_kpa;
    loop.p2_kpa = type.levels.p2_kpa;
    loop.t1_degc = type.levels.t1_degc;
    config.excitation = loop;
  }
  config.duration_s = duration_s;
  config.seed = seed;
  return Run(config);
}

}  // namespace fdi::trainer
