#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <limits>

#include "diagnosis/model/ts_model.h"
#include "diagnosis/observers/lanes.h"
#include "diagnosis/observers/observer_kernels.h"
#include "diagnosis/observers/observer_plan.h"

namespace fdi::lanes {

// A rule below 4e-18 of the strongest does not change a double sum.
inline constexpr double kFiringExponent = -40.0;
inline constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

/// ObserverKernels::predict, to be compiled for several instruction sets.
template <typename Lanes>
struct Prediction {
  using Regressors = std::array<Lanes, kMaxRegressors>;
  using RuleLanes = std::array<Lanes, kMaxRules>;

  // log μ(x) of one set; an infinite width gives 0 on its side.
  FDI_INLINE static Lanes LogMembership(const QuadSet& set, const Lanes& x) {
    const auto left = x < Load<Lanes>(set.left_center);
    const auto right = x > Load<Lanes>(set.right_center);
    const Lanes distance = Select(left, Load<Lanes>(set.left_center) - x,
                                  x - Load<Lanes>(set.right_center));
    const Lanes width =
        Select(left, Load<Lanes>(set.left_width), Load<Lanes>(set.right_width));
    const Lanes z = Select(left | right, distance / width, All<Lanes>(0.0));
    return -0.5 * z * z;
  }

  // −½ ‖L (x − v)‖².
  FDI_INLINE static Lanes LogNearness(const Quad* entries, std::size_t rows,
                                      const Regressors& x) {
    const Quad* entry = entries + rows;
    Lanes squares = All<Lanes>(0.0);
    for (std::size_t row = 0; row < rows; ++row) {
      Lanes z = All<Lanes>(0.0);
      for (std::size_t j = 0; j <= row; ++j) {
        z += Load<Lanes>(*entry++) * (x[j] - Load<Lanes>(entries[j]));
      }
      squares += z * z;
    }
    return -0.5 * squares;
  }

  FDI_INLINE static Lanes Exponent(const ObserverGroup& group,
                                   const QuadPremise& premise,
                                   const Regressors& x) {
    Lanes exponent = Load<Lanes>(premise.start);
    if (premise.nearness_rows > 0) {
      exponent += LogNearness(&group.nearness[premise.first_nearness],
                              premise.nearness_rows, x);
    }
    for (std::size_t s = premise.first_set;
         s < premise.first_set + premise.set_count; ++s) {
      exponent += LogMembership(group.sets[s], x[group.set_regressors[s]]);
    }
    return Max(Load<Lanes>(premise.least), exponent);
  }

  // exp(t) for the rules that fire, 0 for the others.
  FDI_INLINE static Lanes Weight(const Lanes& exponent, const Lanes& largest) {
    const Lanes t = exponent - largest;
    const auto fires = t > All<Lanes>(kFiringExponent);
    const Lanes bounded = Select(fires, t, All<Lanes>(kFiringExponent));
    return Select(fires, Exp(bounded), All<Lanes>(0.0));
  }

  // y_i = a_iᵀx + b_i; `consequent` holds b_i and a_i.
  FDI_INLINE static Lanes Output(const Quad* consequent, std::size_t regressors,
                                 const Regressors& x) {
    Lanes output = Load<Lanes>(consequent[0]);
    for (std::size_t j = 0; j < regressors; ++j) {
      output += Load<Lanes>(consequent[j + 1]) * x[j];
    }
    return output;
  }

  // ŷ of four observers, each with rules of its own.
  FDI_INLINE static Lanes Evaluate(const ObserverGroup& group,
                                   std::size_t block,
                                   const ObserverBlock& limits,
                                   const Regressors& x) {
    const std::size_t rules = group.rules[block];
    const std::size_t n = group.regressors.size();
    const QuadPremise* premises = &group.premises[group.first_premise[block]];
    const Quad* consequent = &group.consequents[group.first_consequent[block]];
    RuleLanes weights;
    Lanes sum = All<Lanes>(1.0);
    weights[0] = All<Lanes>(1.0);
    if (rules > 1) {
      Lanes largest = All<Lanes>(-std::numeric_limits<double>::infinity());
      for (std::size_t r = 0; r < rules; ++r) {
        weights[r] = Exponent(group, premises[r], x);
        largest = Max(largest, weights[r]);
      }
      sum = All<Lanes>(0.0);
      for (std::size_t r = 0; r < rules; ++r) {
        weights[r] = Weight(weights[r], largest);
        sum += weights[r];
      }
    }
    Lanes value = All<Lanes>(0.0);
    for (std::size_t r = 0; r < rules; ++r) {
      value += weights[r] / sum * Output(consequent + r * (n + 1), n, x);
    }
    return Clamp(value, Load<Lanes>(limits.output_min),
                 Load<Lanes>(limits.output_max));
  }

  // The firing rules of a shared premise.
  struct Firing {
    std::size_t count{0};
    std::array<std::size_t, kMaxRules> rules;
    std::array<double, kMaxRules> weights;
  };

  FDI_INLINE static void ComputeFiring(const ObserverGroup& group,
                                       const Regressors& x, Firing& firing) {
    std::array<Lanes, kMaxRules / kLanes> exponents;
    const std::size_t quads = group.premises.size();
    Lanes most = All<Lanes>(-std::numeric_limits<double>::infinity());
    for (std::size_t q = 0; q < quads; ++q) {
      exponents[q] = Exponent(group, group.premises[q], x);
      most = Max(most, exponents[q]);
    }
    const double largest =
        std::max(std::max(most[0], most[1]), std::max(most[2], most[3]));
    firing.count = 0;
    double sum = 0.0;
    for (std::size_t q = 0; q < quads; ++q) {
      const auto fires = exponents[q] - largest > All<Lanes>(kFiringExponent);
      if (!Any(fires)) {
        continue;
      }
      const Lanes weights = Weight(exponents[q], All<Lanes>(largest));
      for (std::size_t i = 0; i < kLanes; ++i) {
        if (fires[i] != 0) {
          firing.rules[firing.count] = q * kLanes + i;
          firing.weights[firing.count++] = weights[i];
          sum += weights[i];
        }
      }
    }
    for (std::size_t i = 0; i < firing.count; ++i) {
      firing.weights[i] /= sum;
    }
  }

  // ŷ of four observers from the weights of their shared premise.
  FDI_INLINE static Lanes Blend(const ObserverGroup& group, std::size_t block,
                                const ObserverBlock& limits,
                                const Firing& firing, const Regressors& x) {
    const std::size_t n = group.regressors.size();
    const Quad* consequents = &group.consequents[group.first_consequent[block]];
    Lanes value = All<Lanes>(0.0);
    for (std::size_t i = 0; i < firing.count; ++i) {
      value += firing.weights[i] *
               Output(consequents + firing.rules[i] * (n + 1), n, x);
    }
    return Clamp(value, Load<Lanes>(limits.output_min),
                 Load<Lanes>(limits.output_max));
  }

  // Shared by the predictions of a group.
  struct Common {
    const ObserverPlan& plan;
    double reading;
    double base;                // Normal prediction below a difference, or 0.
    double base_extrapolation;  // Extrapolation of `base`.
  };

  static Common CommonOf(const ObserverPlan& plan, const ObserverState& state,
                         const ObserverGroup& group) {
    const std::size_t normal = plan.slot(0, group.channel);
    const auto of_normal = [&](const std::vector<Quad>& quads) {
      return group.difference ? quads[normal / kLanes].lane[normal % kLanes]
                              : 0.0;
    };
    return {plan, state.outputs->readings[group.channel],
            of_normal(state.outputs->predictions),
            of_normal(state.outputs->extrapolations)};
  }

  // Stores the outputs of four observers: their own part of the prediction, and
  // the same with all regressors clamped to the trained range.
  FDI_INLINE static void StoreOutputs(const Common& common, const Lanes& own,
                                      const Lanes& inside, std::size_t block,
                                      ObserverState& state) {
    const Lanes prediction = common.base + own;
    const Lanes saturation =
        Load<Lanes>(common.plan.blocks()[block].saturation);
    const Lanes reading = All<Lanes>(common.reading);
    const auto hidden = (reading >= saturation) & (prediction >= saturation);
    const Lanes residual = reading - Min(prediction, saturation);
    ObserverOutputs& outputs = *state.outputs;
    Store(prediction, outputs.predictions[block]);
    Store(common.base_extrapolation + Magnitude(own - inside),
          outputs.extrapolations[block]);
    Store(Select(hidden, All<Lanes>(kNan), residual), outputs.residuals[block]);
  }

  FDI_INLINE static Lanes Regressor(const ObserverPlan& plan,
                                    const ObserverState& state,
                                    const ObserverGroup& group,
                                    std::size_t block,
                                    const RegressorSource& source) {
    const std::size_t row = state.Row(source.lag);
    if (source.own) {
      return Load<Lanes>(
          state.own_past[row * plan.own_blocks() + group.own_block + block]);
    }
    return All<Lanes>(state.measured[row][source.signal]);
  }

  // Clamps `x` to the trained range; returns whether any value changed.
  FDI_INLINE static bool Beyond(const Quad* minimum, const Quad* maximum,
                                std::size_t count, const Regressors& x,
                                Regressors& inside) {
    bool beyond = false;
    for (std::size_t j = 0; j < count; ++j) {
      inside[j] = Clamp(x[j], Load<Lanes>(minimum[j]), Load<Lanes>(maximum[j]));
      beyond = beyond || Any(inside[j] != x[j]);
    }
    return beyond;
  }

  FDI_INLINE static void PredictShared(const ObserverPlan& plan,
                                       const ObserverGroup& group,
                                       ObserverState& state) {
    const Common common = CommonOf(plan, state, group);
    const std::size_t n = group.regressors.size();
    Regressors x;
    Regressors inside;
    for (std::size_t j = 0; j < n; ++j) {
      x[j] = Regressor(plan, state, group, 0, group.regressors[j]);
    }
    Firing firing;
    Firing firing_inside;
    ComputeFiring(group, x, firing);
    const bool beyond =
        Beyond(group.minimum.data(), group.maximum.data(), n, x, inside);
    if (beyond) {
      ComputeFiring(group, inside, firing_inside);
    }
    for (std::size_t b = 0; b < group.blocks; ++b) {
      const std::size_t block = group.first_block + b;
      const ObserverBlock& limits = plan.blocks()[block];
      const Lanes own = Blend(group, b, limits, firing, x);
      StoreOutputs(
          common, own,
          beyond ? Blend(group, b, limits, firing_inside, inside) : own, block,
          state);
    }
  }

  FDI_INLINE static void PredictApart(const ObserverPlan& plan,
                                      const ObserverGroup& group,
                                      ObserverState& state) {
    const Common common = CommonOf(plan, state, group);
    const std::size_t n = group.regressors.size();
    const std::size_t now = state.Row(0) * plan.own_blocks() + group.own_block;
    Regressors x;
    Regressors inside;
    for (std::size_t b = 0; b < group.blocks; ++b) {
      for (std::size_t j = 0; j < n; ++j) {
        x[j] = Regressor(plan, state, group, b, group.regressors[j]);
      }
      const std::size_t block = group.first_block + b;
      const ObserverBlock& limits = plan.blocks()[block];
      const Lanes own = Evaluate(group, b, limits, x);
      const bool beyond =
          Beyond(&group.minimum[b * n], &group.maximum[b * n], n, x, inside);
      StoreOutputs(common, own,
                   beyond ? Evaluate(group, b, limits, inside) : own, block,
                   state);
      if (group.free_running) {
        state.own_past[now + b] = state.outputs->predictions[block];
      }
    }
  }

  FDI_INLINE static void Run(const ObserverPlan& plan, ObserverState& state) {
    for (const ObserverGroup& group : plan.groups()) {
      if (state.active[group.channel] == 0) {
        continue;
      }
      if (group.shared) {
        PredictShared(plan, group, state);
      } else {
        PredictApart(plan, group, state);
      }
    }
  }
};

}  // namespace fdi::lanes
