#include "bench/study/fault_injection.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/error.h"
#include "diagnosis/model/fault_catalogue.h"
#include "simulator/control_valve.h"
#include "trainer/campaign/run_input.h"

namespace fdi::trainer::study {
namespace {

using simulator::FaultEffects;
using simulator::ValveParameters;

constexpr SignalMask kOfT1 = MaskOf(Signal::kT1);
constexpr SignalMask kOfP1 = MaskOf(Signal::kP1);
constexpr SignalMask kOfP2 = MaskOf(Signal::kP2);
constexpr SignalMask kOfF = MaskOf(Signal::kF);
constexpr SignalMask kFlowEquation = kOfP1 | kOfP2 | kOfF | MaskOf(Signal::kX);

constexpr double kColdWaterC = 20.0;
constexpr double kMaxGain = 2.0;

struct Injectable {
  int fault;
  SignalMask needed;
  SignalMask changed;
};

constexpr std::array<Injectable, 8> kInjectable{{
    {5, kOfF, kOfF},
    {6, kFlowEquation, kOfF},
    {7, kOfT1, kOfT1},
    {18, kFlowEquation, kOfF},
    {19, kOfF, kOfF},
    {kTemperatureTransmitterFault, kOfT1, kOfT1},
    {kInletPressureTransmitterFault, kOfP1, kOfP1},
    {kOutletPressureTransmitterFault, kOfP2, kOfP2},
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

SignalMask UnionOf(const FaultInjection& injection,
                   SignalMask Injectable::*signals) {
  unsigned all = 0;
  for (const simulator::FaultSchedule& schedule : injection.faults) {
    all |= RequireInjectable(schedule.fault).*signals;
  }
  return static_cast<SignalMask>(all);
}

// The flow through the faulty trim minus that through the healthy one, as the
// transmitter of `sample` would see it. The external leak stays out:
// ChangeReadings() takes it from the whole flow.
double AddedFlow(ValveParameters valve, const Sample& sample,
                 const FaultEffects& effects) {
  const double t1_c =
      sample.Has(Signal::kT1) && std::isfinite(sample[Signal::kT1])
          ? sample[Signal::kT1]
          : kColdWaterC;
  const double closing = std::clamp(0.01 * sample[Signal::kX], 0.0, 1.0);
  valve.instruments.flow_unit = sample.flow_unit;
  FaultEffects added;
  added.opening_offset = effects.opening_offset;
  added.bypass_opening = effects.bypass_opening;
  const auto flow = [&](const FaultEffects& with) {
    return simulator::FlowOf(
        valve, with,
        {0.0, 1e3 * sample[Signal::kP1], 1e3 * sample[Signal::kP2], t1_c},
        closing, 0.0);
  };
  const double healthy = flow({});
  const double faulty = flow(added);
  const double gain = healthy > 0.0 ? std::clamp(sample[Signal::kF] / healthy,
                                                 1.0 / kMaxGain, kMaxGain)
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

// Tells people which effects of the faults the result lacks.
std::vector<std::string> LeftOut(const FaultInjection& injection) {
  std::vector<std::string> left_out;
  if ((ChangedSignals(injection) & kOfF) != 0) {
    left_out.emplace_back(
        "the reaction of the loop: command, position and pressures stay as "
        "recorded");
  }
  if (std::any_of(injection.faults.begin(), injection.faults.end(),
                  [](const auto& schedule) { return schedule.fault == 7; })) {
    left_out.emplace_back(
        "of f7 the critical flow: only T1 changes, F stays as recorded");
  }
  return left_out;
}

void RequireSuited(const storage::StoredRun& run,
                   const FaultInjection& injection, bool range_is_given) {
  const std::string what = RunName(run);
  const SignalMask needed = SignalsFor(injection);
  for (std::size_t i = 0; i < kSignalCount; ++i) {
    const auto signal = static_cast<Signal>(i);
    if ((needed & MaskOf(signal) & ~run.info.signals) != 0) {
      throw DataError(what + " has no " + std::string(SignalName(signal)) +
                      ", which the faults need");
    }
  }
  const FlowUnit unit = injection.valve.instruments.flow_unit;
  if ((needed & MaskOf(Signal::kF)) != 0 && !range_is_given &&
      run.info.run.flow_unit != unit) {
    throw ConfigError(what + " has its flow in " +
                      std::string(FlowUnitName(run.info.run.flow_unit)) +
                      ", the transmitter of " + injection.valve.name + " in " +
                      std::string(FlowUnitName(unit)) +
                      ": give its range, --flow-range LOW:HIGH");
  }
  for (const storage::StoredSample& stored : run.samples) {
    if (stored.truth && stored.truth->strength != 0.0) {
      throw DataError(what + " has " + FaultName(stored.truth->fault) +
                      " already: faults are put onto a healthy record");
    }
  }
}

}  // namespace

SignalMask SignalsFor(const FaultInjection& injection) {
  return UnionOf(injection, &Injectable::needed);
}

SignalMask ChangedSignals(const FaultInjection& injection) {
  return UnionOf(injection, &Injectable::changed);
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
  const simulator::Instrumentation& range = injection_.valve.instruments;
  if (effects.opening_offset != 0.0 || effects.bypass_opening != 0.0) {
    sample.Set(Signal::kF, sample[Signal::kF] +
                               AddedFlow(injection_.valve, sample, effects));
  }
  const double factor =
      (1.0 - effects.external_loss) * effects.flow_reading_factor;
  if ((ChangedSignals(injection_) & kOfF) != 0 && effects != FaultEffects{}) {
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

InjectedRun InjectInto(storage::StoredRun run, const FaultInjection& injection,
                       bool range_is_given) {
  RequireSuited(run, injection, range_is_given);
  const std::int64_t start_ns = run.samples.front().sample.stamp_ns;
  const auto seconds = [start_ns](const storage::StoredSample& stored) {
    return static_cast<double>(stored.sample.stamp_ns - start_ns) * 1e-9;
  };
  InjectedRun result;
  result.source = RunName(run);
  result.left_out = LeftOut(injection);
  const double end_s = seconds(run.samples.back());
  for (const simulator::FaultSchedule& schedule : injection.faults) {
    result.faults.push_back(simulator::ToText(schedule));
    if (schedule.start_s > end_s) {
      throw ConfigError(result.faults.back() + " starts after the end of " +
                        result.source + " at " + std::to_string(end_s) + " s");
    }
  }
  const simulator::Transmitter& flow = injection.valve.instruments.flow;
  const bool changes_flow = (ChangedSignals(injection) & kOfF) != 0;
  FaultInjector injector(injection);
  result.run = std::move(run);
  for (storage::StoredSample& stored : result.run.samples) {
    const LabelledSample labelled =
        injector.Step(stored.sample, seconds(stored));
    stored.sample = labelled.sample;
    stored.truth = labelled.truth;
    if (labelled.truth->strength != 0.0) {
      const double reading = labelled.sample[Signal::kF];
      ++result.faulty;
      result.at_limit +=
          changes_flow && (reading <= flow.low || reading >= flow.high);
    }
  }
  return result;
}

}  // namespace fdi::trainer::study
