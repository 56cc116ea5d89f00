#include "trainer/app/injected_run.h"

#include "diagnosis/error.h"
#include "diagnosis/fault_catalogue.h"
#include "trainer/app/run_input.h"

namespace fdi::trainer {
namespace {

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

double SecondsOf(const storage::StoredRun& run, const Sample& sample) {
  return static_cast<double>(sample.stamp_ns - StartOf(run)) * 1e-9;
}

}  // namespace

std::int64_t StartOf(const storage::StoredRun& run) {
  return run.samples.front().sample.stamp_ns;
}

InjectedRun InjectInto(storage::StoredRun run, const FaultInjection& injection,
                       bool range_is_given) {
  RequireSuited(run, injection, range_is_given);
  InjectedRun result;
  result.source = RunName(run);
  result.left_out = LeftOut(injection);
  for (const simulator::FaultSchedule& schedule : injection.faults) {
    result.faults.push_back(simulator::ToText(schedule));
    const double end_s = SecondsOf(run, run.samples.back().sample);
    if (schedule.start_s > end_s) {
      throw ConfigError(result.faults.back() + " starts after the end of " +
                        result.source + " at " + std::to_string(end_s) + " s");
    }
  }
  const simulator::Transmitter& flow = injection.valve.instruments.flow;
  const bool changes_flow =
      (ChangedSignals(injection) & MaskOf(Signal::kF)) != 0;
  FaultInjector injector(injection);
  result.run = run;
  for (storage::StoredSample& stored : result.run.samples) {
    const LabelledSample labelled =
        injector.Step(stored.sample, SecondsOf(run, stored.sample));
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

}  // namespace fdi::trainer
