#include "trainer/onboarding/signal_subset.h"

#include "diagnosis/error.h"

namespace fdi::trainer {
namespace {

constexpr std::uint64_t kSeed = 1;

// Keeps the regressors that `signals` has.
void Restrict(SignalMask signals, std::vector<Regressor>& regressors) {
  std::erase_if(regressors, [&](const Regressor& r) {
    return (signals & MaskOf(r.signal)) == 0;
  });
}

}  // namespace

TrainingRun WithSignals(TrainingRun run, SignalMask signals) {
  for (LabelledSample& labelled : run.samples) {
    labelled.sample.present &= signals;
  }
  return run;
}

TrainingRun SimulateHealthyRun(const ValveType& type, double duration_s) {
  TrainingRun run;
  run.id = type.name;
  run.flow_unit = type.parameters.instruments.flow_unit;
  for (Sample& sample : SimulateHealthy(type, duration_s, kSeed)) {
    run.samples.push_back({sample, FaultTruth{}});
  }
  return run;
}

TrainingOptions OnboardingPreset(SignalMask signals) {
  for (const Signal signal : {Signal::kCv, Signal::kX}) {
    if ((signals & MaskOf(signal)) == 0) {
      throw DataError("the valve has no signal " +
                      std::string(SignalName(signal)) +
                      ": CV and X are the least that faults show in");
    }
  }
  TrainingOptions options = PresetOptions("extended");
  options.preset = "onboard";
  std::erase_if(options.channels, [&](const ChannelPlan& plan) {
    return (signals & MaskOf(plan.output)) == 0;
  });
  using enum Signal;
  for (ChannelPlan& plan : options.channels) {
    if (plan.name == "X") {
      plan.own_past_pool = {{kCv, 0}, {kCv, 1}, {kCv, 2}, {kP1, 0},
                            {kP2, 0}, {kX, 1},  {kX, 2}};
    }
    for (std::vector<Regressor>& pool : plan.pools) {
      Restrict(signals, pool);
    }
    Restrict(signals, plan.own_past_pool);
  }
  return options;
}

}  // namespace fdi::trainer
