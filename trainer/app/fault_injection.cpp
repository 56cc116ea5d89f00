#include "trainer/app/fault_injection.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "diagnosis/error.h"
#include "diagnosis/fault_catalogue.h"
#include "simulator/valve_equations.h"
#include "simulator/water.h"

namespace fdi::trainer {
namespace {

using simulator::FaultEffects;
using simulator::ValveParameters;

constexpr SignalMask kT1 = MaskOf(Signal::kT1);
constexpr SignalMask kP1 = MaskOf(Signal::kP1);
constexpr SignalMask kP2 = MaskOf(Signal::kP2);
constexpr SignalMask kF = MaskOf(Signal::kF);
constexpr SignalMask kFlowEquation = kP1 | kP2 | kF | MaskOf(Signal::kX);

constexpr double kColdWaterC = 20.0;
constexpr double kLargestGain = 2.0;

struct Injectable {
  int fault;
  SignalMask needed;
  SignalMask changed;
};

constexpr std::array<Injectable, 8> kInjectable{{
    {5, kF, kF},
    {6, kFlowEquation, kF},
    {7, kT1, kT1},
    {18, kFlowEquation, kF},
    {19, kF, kF},
    {kTemperatureTransmitterFault, kT1, kT1},
    {kInletPressureTransmitterFault, kP1, kP1},
    {kOutletPressureTransmitterFault, kP2, kP2},
}};

const Injectable& RequireInjectable(int fault) {
  std::string accepted;
  for (const Injectable& injectable : kInjectable) {
    if (injectable.fault == fault) {
      return injectable;
    }
    accepted.append(" ").append(FaultName(injectable.fault));
  }
  throw ConfigError(FaultName(fault) +
                    " cannot be put onto a record, as its readings do not tell "
                    "the effect; accepted are" +
                    accepted);
}

// Flow through trim and bypass [m3/h], faults included.
double FlowOf(const simulator::TrimParameters& trim, double closing,
              const simulator::MediumState& medium,
              const FaultEffects& effects) {
  using namespace simulator;
  const double bypass = std::clamp(effects.bypass_opening, 0.0, 1.0);
  return Flow(trim.kv_m3_h, Opening(trim, closing) + effects.opening_offset,
              EffectivePressureDrop(medium, RecoveryCoefficient(closing)),
              medium.density_kg_m3) +
         Flow(trim.bypass_kv_m3_h, bypass,
              EffectivePressureDrop(medium,
                                    BypassRecoveryCoefficient(1.0 - bypass)),
              medium.density_kg_m3);
}

// What the flow through the faulty trim is more than through the healthy one,
// as the transmitter of `sample` would see it.
double AddedFlow(const ValveParameters& valve, const Sample& sample,
                 const FaultEffects& effects) {
  const double t1_c =
      sample.Has(Signal::kT1) && std::isfinite(sample[Signal::kT1])
          ? sample[Signal::kT1]
          : kColdWaterC;
  const simulator::MediumState medium = simulator::MediumAt(
      1e3 * sample[Signal::kP1], 1e3 * sample[Signal::kP2], t1_c);
  const double closing = std::clamp(0.01 * sample[Signal::kX], 0.0, 1.0);
  const double unit = sample.flow_unit == FlowUnit::kTPerHour
                          ? 1e-3 * medium.density_kg_m3
                          : 1.0;
  const double healthy = unit * FlowOf(valve.trim, closing, medium, {});
  const double faulty = unit * FlowOf(valve.trim, closing, medium, effects);
  const double gain = healthy > 0.0
                          ? std::clamp(sample[Signal::kF] / healthy,
                                       1.0 / kLargestGain, kLargestGain)
                          : 1.0;
  return gain * (faulty - healthy);
}

void StepReading(Signal signal, double step,
                 const simulator::Transmitter& range, Sample& sample) {
  if (step != 0.0) {
    const double value = sample[signal] + step * (range.high - range.low);
    sample.Set(signal, std::clamp(value, range.low, range.high));
  }
}

bool AllFinite(const Sample& sample, SignalMask signals) {
  for (std::size_t i = 0; i < kSignalCount; ++i) {
    const SignalMask mask = MaskOf(static_cast<Signal>(i));
    if ((signals & mask) != 0 &&
        ((sample.present & mask) == 0 || !std::isfinite(sample.values[i]))) {
      return false;
    }
  }
  return true;
}

}  // namespace

SignalMask SignalsFor(const FaultInjection& injection) {
  unsigned signals = 0;
  for (const simulator::FaultSchedule& schedule : injection.faults) {
    signals |= RequireInjectable(schedule.fault).needed;
  }
  return static_cast<SignalMask>(signals);
}

SignalMask ChangedSignals(const FaultInjection& injection) {
  unsigned signals = 0;
  for (const simulator::FaultSchedule& schedule : injection.faults) {
    signals |= RequireInjectable(schedule.fault).changed;
  }
  return static_cast<SignalMask>(signals);
}

std::vector<std::string> LeftOut(const FaultInjection& injection) {
  std::vector<std::string> left_out;
  if ((ChangedSignals(injection) & kF) != 0) {
    left_out.emplace_back(
        "the reaction of the loop: command, position and pressures stay as "
        "recorded");
  }
  const bool evaporates =
      std::any_of(injection.faults.begin(), injection.faults.end(),
                  [](const auto& schedule) { return schedule.fault == 7; });
  if (evaporates) {
    left_out.emplace_back(
        "of f7 the critical flow: only T1 changes, F stays as recorded");
  }
  return left_out;
}

FaultInjector::FaultInjector(FaultInjection injection)
    : injection_(std::move(injection)),
      needed_(SignalsFor(injection_)),
      held_(injection_.faults.size()) {}

LabelledSample FaultInjector::Step(const Sample& healthy, double time_s) {
  LabelledSample result{healthy, TruthAt(injection_.faults, time_s)};
  if (AllFinite(healthy, needed_)) {
    ChangeReadings(EffectsAt(injection_.faults, time_s), result.sample);
    HoldFlatlines(time_s, result.sample);
  }
  return result;
}

void FaultInjector::ChangeReadings(const FaultEffects& effects,
                                   Sample& sample) {
  const simulator::InstrumentParameters& range = injection_.valve.instruments;
  if (effects.opening_offset != 0.0 || effects.bypass_opening != 0.0) {
    sample.Set(Signal::kF, sample[Signal::kF] +
                               AddedFlow(injection_.valve, sample, effects));
  }
  const double factor =
      (1.0 - effects.external_loss) * effects.flow_reading_factor;
  if ((ChangedSignals(injection_) & kF) != 0 && effects != FaultEffects{}) {
    sample.Set(Signal::kF, std::clamp(factor * sample[Signal::kF],
                                      range.flow.low, range.flow.high));
  }
  if (effects.temperature_rise_c != 0.0) {
    const double t1_c =
        std::min(sample[Signal::kT1] + effects.temperature_rise_c,
                 simulator::kMaxTemperatureC);
    sample.Set(Signal::kT1,
               std::clamp(t1_c, range.temperature.low, range.temperature.high));
  }
  StepReading(Signal::kT1, effects.temperature_reading_step, range.temperature,
              sample);
  StepReading(Signal::kP1, effects.inlet_reading_step, range.pressure, sample);
  StepReading(Signal::kP2, effects.outlet_reading_step, range.pressure, sample);
}

void FaultInjector::HoldFlatlines(double time_s, Sample& sample) {
  for (std::size_t i = 0; i < injection_.faults.size(); ++i) {
    const simulator::FaultSchedule& fault = injection_.faults[i];
    if (fault.flatline && StrengthAt(fault, time_s) != 0.0) {
      const Signal signal = *TransmitterOf(fault.fault);
      held_[i] = held_[i].value_or(sample[signal]);
      sample.Set(signal, *held_[i]);
    }
  }
}

}  // namespace fdi::trainer
