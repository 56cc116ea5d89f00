#include "diagnosis/observers/observer_bank.h"

#include <algorithm>
#include <limits>

namespace fdi {
namespace {

constexpr double kShareGain = 0.01;  // of the share of whole rows, per reading

}  // namespace

ObserverBank::ObserverBank(std::shared_ptr<const ObserverPlan> plan,
                           std::shared_ptr<ObserverOutputs> outputs,
                           InstructionSet instructions)
    : plan_(std::move(plan)),
      kernels_(&KernelsFor(instructions)),
      state_(*plan_, std::move(outputs)),
      whole_share_(plan_->models().channels.size(), 1.0) {}

ObserverBank::ObserverBank(const std::shared_ptr<const ObserverPlan>& plan,
                           InstructionSet instructions)
    : ObserverBank(plan, std::make_shared<ObserverOutputs>(*plan),
                   instructions) {}

ObserverBank::ObserverBank(const ModelSet& models)
    : ObserverBank(std::make_shared<const ObserverPlan>(models)) {}

void ObserverBank::Initialise(const Sample& sample) {
  std::fill(state_.measured.begin(), state_.measured.end(), sample.values);
  std::fill(state_.uncertain.begin(), state_.uncertain.end(),
            sample.uncertain());
  active_count_ = 0;
  for (std::size_t c = 0; c < state_.active.size(); ++c) {
    const SignalMask needed = plan_->signals(c);
    state_.active[c] = (sample.present & needed) == needed ? 1 : 0;
    active_count_ += state_.active[c];
  }
  for (const ObserverGroup& group : plan_->groups()) {
    Quad rest;
    rest.lane.fill(sample[plan_->models().channels[group.channel].output]);
    for (int lag = 0; group.free_running && lag < state_.depth; ++lag) {
      const auto row =
          state_.own_past.begin() +
          static_cast<std::ptrdiff_t>(state_.Row(lag) * plan_->own_blocks() +
                                      group.own_block);
      std::fill_n(row, group.blocks, rest);
    }
  }
}

// Same rule as in fitting (BuildRegression), over about the last 100 readings.
bool ObserverBank::IsMeasured(std::size_t channel, bool all_certain) {
  if (state_.active[channel] == 0) {
    return false;
  }
  const TsModel& model = plan_->models().observers[0].channels[channel].model;
  const auto is_uncertain = [&](Signal signal, int lag) {
    return (state_.uncertain[state_.Row(lag)] & MaskOf(signal)) != 0;
  };
  if (is_uncertain(model.output, 0)) {
    return false;
  }
  const bool whole =
      all_certain ||
      std::ranges::none_of(model.regressors, [&](const Regressor& r) {
        return is_uncertain(r.signal, r.lag);
      });
  double& share = whole_share_[channel];
  share += kShareGain * ((whole ? 1.0 : 0.0) - share);
  return whole || share < 0.5;
}

void ObserverBank::Step(const Sample& sample) {
  state_.head = (state_.head + 1) % state_.depth;
  state_.measured[state_.Row(0)] = sample.values;
  state_.uncertain[state_.Row(0)] = sample.uncertain();
  measured_count_ = 0;
  const bool all_certain = std::ranges::all_of(
      state_.uncertain, [](SignalMask uncertain) { return uncertain == 0; });
  const Observer& normal = plan_->models().observers.front();
  for (std::size_t c = 0; c < state_.active.size(); ++c) {
    const TsModel& model = normal.channels[c].model;
    const bool measured = IsMeasured(c, all_certain);
    measured_count_ += measured ? 1 : 0;
    const double reading = measured ? sample[model.output]
                                    : std::numeric_limits<double>::quiet_NaN();
    state_.outputs->readings[c] = reading;
    state_.outputs->saturated[c] =
        state_.active[c] != 0 && reading >= model.saturation ? 1 : 0;
  }
  kernels_->predict(*plan_, state_);
  if (allows_) {
    AddAllowed();
  }
}

void ObserverBank::AddAllowed() {
  allows_ = false;
  for (std::size_t c = 0; c < state_.active.size(); ++c) {
    const double extrapolation = allowed_[c] / kExtrapolationError;
    allows_ = allows_ || extrapolation > 0.0;
    for (std::size_t b = plan_->first_block(c);
         state_.active[c] != 0 && b < plan_->first_block(c + 1); ++b) {
      for (double& of_observer : state_.outputs->extrapolations[b].lane) {
        of_observer += extrapolation;
      }
    }
  }
}

void ObserverBank::StepAgain(const Sample& sample) {
  state_.head = (state_.head + state_.depth - 1) % state_.depth;
  Step(sample);
}

void ObserverBank::Amend(int lag,
                         const std::array<double, kSignalCount>& values,
                         SignalMask uncertain) {
  if (lag < state_.depth) {
    state_.measured[state_.Row(lag)] = values;
    state_.uncertain[state_.Row(lag)] = uncertain;
  }
}

void ObserverBank::TakeReadings(const ObserverBank& bank) {
  state_.active = bank.state_.active;
  state_.outputs->readings = bank.state_.outputs->readings;
  state_.outputs->saturated = bank.state_.outputs->saturated;
  active_count_ = bank.active_count_;
  measured_count_ = bank.measured_count_;
}

void ObserverBank::SetPrediction(int observer, int channel, double prediction,
                                 double extrapolation) {
  const auto c = static_cast<std::size_t>(channel);
  const std::size_t slot = plan_->slot(static_cast<std::size_t>(observer), c);
  const auto set = [slot](std::vector<Quad>& quads, double value) {
    quads[slot / kLanes].lane[slot % kLanes] = value;
  };
  set(state_.outputs->predictions, prediction);
  set(state_.outputs->extrapolations, extrapolation);
  set(state_.outputs->residuals,
      Residual(plan_->models()
                   .observers[static_cast<std::size_t>(observer)]
                   .channels[c]
                   .model,
               reading(channel), prediction));
}

void ObserverBank::Score(std::span<double> factors) const {
  std::array<double, kMaxObservers * kLanes> memberships;  // of one channel
  std::fill(factors.begin(), factors.end(), kAbstains);
  for (std::size_t c = 0; c < state_.active.size(); ++c) {
    if (state_.active[c] == 0) {
      continue;
    }
    const std::size_t first = plan_->first_block(c);
    kernels_->score(*plan_, state_, first, plan_->first_block(c + 1),
                    memberships.data());
    const bool in_order = plan_->in_order(c);
    for (std::size_t o = 0; in_order && o < factors.size(); ++o) {
      factors[o] = std::min(factors[o], memberships[o]);
    }
    for (std::size_t o = 0; !in_order && o < factors.size(); ++o) {
      factors[o] =
          std::min(factors[o], memberships[plan_->slot(o, c) - first * kLanes]);
    }
  }
  std::replace(factors.begin(), factors.end(), kAbstains, 0.0);
}

}  // namespace fdi
