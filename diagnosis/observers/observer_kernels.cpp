#include "diagnosis/observers/observer_kernels.h"

#include <cmath>

#include "diagnosis/observers/lanes.h"
#include "diagnosis/observers/prediction_kernel.h"

namespace fdi {
namespace {

using lanes::All;
using lanes::Any;
using lanes::Load;
using lanes::Min;
using lanes::Select;
using lanes::Store;

// Trapezoid::operator() of each lane.
template <typename Lanes>
FDI_INLINE Lanes Membership(const ObserverBlock& block, const Lanes& value) {
  const Lanes a = Load<Lanes>(block.a);
  const Lanes d = Load<Lanes>(block.d);
  const auto low = value < Load<Lanes>(block.b);
  const auto high = value > Load<Lanes>(block.c);
  const Lanes inner = Select(low, value - a, d - value);
  const Lanes width =
      Select(low, Load<Lanes>(block.rise), Load<Lanes>(block.fall));
  const auto within = (low & (value > a)) | (high & (value < d));
  return Select(low | high, Select(within, inner / width, All<Lanes>(0.0)),
                All<Lanes>(1.0));
}

template <typename Lanes>
FDI_INLINE void Score(const ObserverPlan& plan, const ObserverState& state,
                      std::size_t first, std::size_t last,
                      double* memberships) {
  const ObserverOutputs& outputs = *state.outputs;
  for (std::size_t b = first; b < last; ++b) {
    const ObserverBlock& block = plan.blocks()[b];
    const Lanes residual = Load<Lanes>(outputs.residuals[b]);
    const Lanes extrapolation = Load<Lanes>(outputs.extrapolations[b]);
    Lanes certain = residual;
    if (Any(extrapolation != All<Lanes>(0.0))) {
      // The error e of extrapolation widens the membership:
      // r / sqrt(1 + (e / sd)²).
      const Lanes uncertain =
          kExtrapolationError * extrapolation / Load<Lanes>(block.sd);
      certain = residual / lanes::ByLane(1.0 + uncertain * uncertain,
                                         [](double x) { return std::sqrt(x); });
    }
    Store(Select(residual != residual, All<Lanes>(kAbstains),
                 Membership(block, certain)),
          memberships + (b - first) * kLanes);
  }
}

template <typename Lanes>
FDI_INLINE void Gather(const ObserverPlan& plan, const ObserverState& state,
                       std::size_t channel, const GainTerms& terms,
                       Quad* parts) {
  const ObserverOutputs& outputs = *state.outputs;
  const std::size_t last = plan.first_block(channel + 1);
  for (std::size_t b = plan.first_block(channel); b < last; ++b) {
    const ObserverBlock& block = plan.blocks()[b];
    const Lanes residual = Load<Lanes>(outputs.residuals[b]);
    const Lanes extrapolation = Load<Lanes>(outputs.extrapolations[b]);
    Lanes variance = Load<Lanes>(block.variance);
    Lanes density = Load<Lanes>(block.log_variance);
    if (Any(extrapolation != All<Lanes>(0.0))) {
      const Lanes uncertain = kExtrapolationError * extrapolation;
      variance += uncertain * uncertain;
      density = lanes::ByLane(variance, [](double x) { return std::log(x); });
    }
    density = terms.counts_spread ? density : All<Lanes>(0.0);
    const Lanes distance =
        Min(residual * residual / variance, All<Lanes>(kMaxSquaredDistance));
    const Lanes faded = Load<Lanes>(parts[b]) * terms.memory;
    const Lanes gain = -0.5 * (distance + density) / terms.time;
    Store(Select(residual != residual, faded, faded + gain), parts[b]);
  }
}

using Portable = lanes::Pair;

void PredictPortable(const ObserverPlan& plan, ObserverState& state) {
  lanes::Prediction<Portable>::Run(plan, state);
}

void ScorePortable(const ObserverPlan& plan, const ObserverState& state,
                   std::size_t first, std::size_t last, double* memberships) {
  Score<Portable>(plan, state, first, last, memberships);
}

void GatherPortable(const ObserverPlan& plan, const ObserverState& state,
                    std::size_t channel, const GainTerms& terms, Quad* parts) {
  Gather<Portable>(plan, state, channel, terms, parts);
}

#if defined(__x86_64__)
[[gnu::target("avx2")]] void PredictAvx2(const ObserverPlan& plan,
                                         ObserverState& state) {
  lanes::Prediction<lanes::Wide>::Run(plan, state);
}

[[gnu::target("avx2")]] void ScoreAvx2(const ObserverPlan& plan,
                                       const ObserverState& state,
                                       std::size_t first, std::size_t last,
                                       double* memberships) {
  Score<lanes::Wide>(plan, state, first, last, memberships);
}

[[gnu::target("avx2")]] void GatherAvx2(const ObserverPlan& plan,
                                        const ObserverState& state,
                                        std::size_t channel,
                                        const GainTerms& terms, Quad* parts) {
  Gather<lanes::Wide>(plan, state, channel, terms, parts);
}
#endif

constexpr ObserverKernels kPortable{PredictPortable, ScorePortable,
                                    GatherPortable};
#if defined(__x86_64__)
constexpr ObserverKernels kAvx2{PredictAvx2, ScoreAvx2, GatherAvx2};
#endif

}  // namespace

ObserverOutputs::ObserverOutputs(const ObserverPlan& plan)
    : readings(plan.models().channels.size(), 0.0),
      saturated(readings.size(), 0),
      predictions(plan.blocks().size()),
      residuals(predictions.size()),
      extrapolations(predictions.size()) {}

ObserverState::ObserverState(const ObserverPlan& plan,
                             std::shared_ptr<ObserverOutputs> place)
    : depth(plan.depth()),
      measured(static_cast<std::size_t>(depth)),
      uncertain(static_cast<std::size_t>(depth), 0),
      own_past(static_cast<std::size_t>(depth) * plan.own_blocks()),
      active(plan.models().channels.size(), 0),
      outputs(std::move(place)) {}

InstructionSet BestInstructionSet() {
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx2") != 0) {
    return InstructionSet::kAvx2;
  }
#endif
  return InstructionSet::kPortable;
}

const ObserverKernels& KernelsFor(
    [[maybe_unused]] InstructionSet instructions) {
#if defined(__x86_64__)
  if (instructions == InstructionSet::kAvx2) {
    return kAvx2;
  }
#endif
  return kPortable;
}

}  // namespace fdi
