#include "diagnosis/observer_kernels.h"

#include <cmath>

#include "diagnosis/lanes.h"
#include "diagnosis/prediction_kernel.h"

namespace fdi {
namespace {

using lanes::All;
using lanes::Any;
using lanes::Lanes;
using lanes::Load;
using lanes::Predict;
using lanes::Store;

// Trapezoid::operator() of each lane.
[[gnu::always_inline]] inline Lanes Membership(const ObserverBlock& block,
                                               const Lanes& value) {
  const auto low = value < Load(block.b);
  const auto high = value > Load(block.c);
  const Lanes inner = low ? value - Load(block.a) : Load(block.d) - value;
  const Lanes width = low ? Load(block.rise) : Load(block.fall);
  const auto outside = low ? value <= Load(block.a) : value >= Load(block.d);
  const Lanes flank = outside ? All(0.0) : inner / width;
  return (low | high) ? flank : All(1.0);
}

[[gnu::always_inline]] inline void Score(const ObserverPlan& plan,
                                         const ObserverState& state,
                                         std::size_t first, std::size_t last,
                                         double* memberships) {
  for (std::size_t b = first; b < last; ++b) {
    const ObserverBlock& block = plan.blocks()[b];
    const Lanes residual = Load(state.outputs->residuals[b]);
    const Lanes extrapolation = Load(state.outputs->extrapolations[b]);
    Lanes certain = residual;
    if (Any(extrapolation != All(0.0))) {
      const Lanes uncertain =
          kExtrapolationError * extrapolation / Load(block.sd);
      certain = residual / lanes::Sqrt(1.0 + uncertain * uncertain);
    }
    const Lanes membership = Membership(block, certain);
    Store(residual != residual ? All(kAbstains) : membership,
          memberships + (b - first) * kLanes);
  }
}

// ln S of four residuals.
[[gnu::always_inline]] inline Lanes LogVariance(const Lanes& variance) {
  return Lanes{std::log(variance[0]), std::log(variance[1]),
               std::log(variance[2]), std::log(variance[3])};
}

[[gnu::always_inline]] inline void Gather(const ObserverPlan& plan,
                                          const ObserverState& state,
                                          std::size_t channel,
                                          const GainTerms& terms, Quad* parts) {
  const std::size_t last = plan.first_block(channel + 1);
  for (std::size_t b = plan.first_block(channel); b < last; ++b) {
    const ObserverBlock& block = plan.blocks()[b];
    const Lanes residual = Load(state.outputs->residuals[b]);
    const Lanes extrapolation = Load(state.outputs->extrapolations[b]);
    Lanes variance = Load(block.variance);
    Lanes density = Load(block.log_variance);
    if (Any(extrapolation != All(0.0))) {
      const Lanes uncertain = kExtrapolationError * extrapolation;
      variance += uncertain * uncertain;
      density = LogVariance(variance);
    }
    density = terms.counts_spread ? density : All(0.0);
    const Lanes distance =
        lanes::Min(residual * residual / variance, All(kMostSurprise));
    const Lanes faded = Load(parts[b]) * terms.memory;
    const Lanes gain = -0.5 * (distance + density) / terms.time;
    Store(residual != residual ? faded : faded + gain, parts[b]);
  }
}

void PredictPortable(const ObserverPlan& plan, ObserverState& state) {
  Predict(plan, state);
}

void ScorePortable(const ObserverPlan& plan, const ObserverState& state,
                   std::size_t first, std::size_t last, double* memberships) {
  Score(plan, state, first, last, memberships);
}

void GatherPortable(const ObserverPlan& plan, const ObserverState& state,
                    std::size_t channel, const GainTerms& terms, Quad* parts) {
  Gather(plan, state, channel, terms, parts);
}

#if defined(__x86_64__)
[[gnu::target("avx2")]] void PredictAvx2(const ObserverPlan& plan,
                                         ObserverState& state) {
  Predict(plan, state);
}

[[gnu::target("avx2")]] void ScoreAvx2(const ObserverPlan& plan,
                                       const ObserverState& state,
                                       std::size_t first, std::size_t last,
                                       double* memberships) {
  Score(plan, state, first, last, memberships);
}

[[gnu::target("avx2")]] void GatherAvx2(const ObserverPlan& plan,
                                        const ObserverState& state,
                                        std::size_t channel,
                                        const GainTerms& terms, Quad* parts) {
  Gather(plan, state, channel, terms, parts);
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
