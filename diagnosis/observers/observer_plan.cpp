#include "diagnosis/observers/observer_plan.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>
#include <limits>
#include <numeric>

namespace fdi {
namespace {

constexpr double kInfinite = std::numeric_limits<double>::infinity();
// Minimum number of observers for which sharing rule weights pays off.
constexpr std::size_t kMinSharedMembers = 8;

// One rule per lane; null where there are fewer.
using LaneRules = std::array<const TsRule*, kLanes>;
// One model per lane; likewise.
using LaneModels = std::array<const TsModel*, kLanes>;

// The kernels read the numbers of a group in this order, each a Quad, with n
// regressors and m entries of the longest center:
//
//     nearness    = (v{m} L{m (m + 1)/2})*   by premise; L row by row
//     sets        = set*                     by premise, then regressor
//     consequents = (b a{n})*                by block, then rule
//     minimum     = value{n}*                by block, or once if shared;
//     maximum       likewise
//
// Beside other rules of its lane, a missing rule has the exponent −∞ and thus
// the weight 0.
Quad ByLane(const std::function<double(std::size_t)>& number) {
  Quad quad;
  for (std::size_t i = 0; i < kLanes; ++i) {
    quad.lane[i] = number(i);
  }
  return quad;
}

bool IsEverything(const FuzzySet& set) {
  return std::isinf(set.left_width) && std::isinf(set.right_width);
}

void AddSets(const LaneRules& rules, std::size_t regressors,
             ObserverGroup& group, QuadPremise& premise) {
  premise.first_set = group.sets.size();
  for (std::size_t j = 0; j < regressors; ++j) {
    const auto set = [&](std::size_t i) {
      return rules[i] != nullptr ? rules[i]->antecedents[j]
                                 : FuzzySet{0.0, 0.0, kInfinite, kInfinite};
    };
    if (IsEverything(set(0)) && IsEverything(set(1)) && IsEverything(set(2)) &&
        IsEverything(set(3))) {
      continue;
    }
    group.sets.push_back({ByLane([&](auto i) { return set(i).left_center; }),
                          ByLane([&](auto i) { return set(i).right_center; }),
                          ByLane([&](auto i) { return set(i).left_width; }),
                          ByLane([&](auto i) { return set(i).right_width; })});
    group.set_regressors.push_back(j);
  }
  premise.set_count = group.sets.size() - premise.first_set;
}

// Padding entries are 0 and have no effect.
void AddNearness(const LaneRules& rules, ObserverGroup& group,
                 QuadPremise& premise) {
  premise.first_nearness = group.nearness.size();
  const auto rows = [&](std::size_t i) {
    return rules[i] != nullptr ? rules[i]->center.size() : std::size_t{0};
  };
  premise.nearness_rows = std::max({rows(0), rows(1), rows(2), rows(3)});
  const std::size_t n = premise.nearness_rows;
  for (std::size_t j = 0; j < n; ++j) {
    group.nearness.push_back(ByLane(
        [&](auto i) { return j < rows(i) ? rules[i]->center[j] : 0.0; }));
  }
  for (std::size_t row = 0; row < n; ++row) {
    for (std::size_t j = 0; j <= row; ++j) {
      group.nearness.push_back(ByLane([&](auto i) {
        return row < rows(i) ? rules[i]->metric[row * (row + 1) / 2 + j] : 0.0;
      }));
    }
  }
}

void AddPremise(const LaneRules& rules, ObserverGroup& group) {
  QuadPremise premise;
  // Unlike 0.0, −0.0 changes no addend, not even the sign of a zero: where sets
  // are omitted, the exponent has the bits of Exponent() in ts_model.cpp.
  premise.start =
      ByLane([&](auto i) { return rules[i] != nullptr ? -0.0 : -kInfinite; });
  premise.least = ByLane([&](auto i) {
    return rules[i] != nullptr ? kFarthestExponent : -kInfinite;
  });
  AddNearness(rules, group, premise);
  AddSets(rules, group.regressors.size(), group, premise);
  group.premises.push_back(premise);
}

void AddConsequent(const LaneRules& rules, ObserverGroup& group) {
  group.consequents.push_back(ByLane(
      [&](auto i) { return rules[i] != nullptr ? rules[i]->intercept : 0.0; }));
  for (std::size_t j = 0; j < group.regressors.size(); ++j) {
    group.consequents.push_back(ByLane([&](auto i) {
      return rules[i] != nullptr ? rules[i]->slopes[j] : 0.0;
    }));
  }
}

// Rule r of each model; null where there are fewer.
LaneRules RulesAt(const LaneModels& models, std::size_t r) {
  LaneRules rules{};
  for (std::size_t i = 0; i < kLanes; ++i) {
    const bool has = models[i] != nullptr && r < models[i]->rules.size();
    rules[i] = has ? &models[i]->rules[r] : nullptr;
  }
  return rules;
}

void AddRange(const LaneModels& models, ObserverGroup& group) {
  for (std::size_t j = 0; j < group.regressors.size(); ++j) {
    group.minimum.push_back(ByLane([&](auto i) {
      return models[i] != nullptr ? models[i]->regressor_min[j] : -kInfinite;
    }));
    group.maximum.push_back(ByLane([&](auto i) {
      return models[i] != nullptr ? models[i]->regressor_max[j] : kInfinite;
    }));
  }
}

// The rules of `model`, in blocks of four, for all observers of the group.
void AddSharedPremises(const TsModel& model, ObserverGroup& group) {
  for (std::size_t r = 0; r < model.rules.size(); r += kLanes) {
    LaneRules rules{};
    for (std::size_t i = 0; i < kLanes && r + i < model.rules.size(); ++i) {
      rules[i] = &model.rules[r + i];
    }
    AddPremise(rules, group);
  }
  AddRange({&model, &model, &model, &model}, group);
}

// The next block of a group. Its first model has the most rules.
void AddBlock(const LaneModels& models, ObserverGroup& group) {
  group.rules.push_back(models[0]->rules.size());
  group.first_premise.push_back(group.shared ? 0 : group.premises.size());
  group.first_consequent.push_back(group.consequents.size());
  for (std::size_t r = 0; r < group.rules.back(); ++r) {
    if (!group.shared) {
      AddPremise(RulesAt(models, r), group);
    }
    AddConsequent(RulesAt(models, r), group);
  }
  if (!group.shared) {
    AddRange(models, group);
  }
}

std::vector<RegressorSource> Sources(const TsModel& model) {
  std::vector<RegressorSource> sources;
  for (const Regressor& regressor : model.regressors) {
    // Validate() has refused a lag of 0 on the output, so own values are past
    // ones.
    const bool own = model.parallel && regressor.signal == model.output;
    sources.push_back({own, Index(regressor.signal), regressor.lag});
  }
  return sources;
}

bool SameRegressors(const TsModel& a, const TsModel& b) {
  return a.regressors == b.regressors && a.parallel == b.parallel;
}

// Groups items that are `alike`, in order of first occurrence. Quadratic at
// worst, but once per model set and for at most kMaxObservers.
template <typename Alike>
std::vector<std::vector<std::size_t>> Sorted(
    const std::vector<std::size_t>& observers, const Alike& alike) {
  std::vector<std::vector<std::size_t>> groups;
  for (const std::size_t o : observers) {
    const auto group =
        std::find_if(groups.begin(), groups.end(),
                     [&](const auto& g) { return alike(g.front(), o); });
    if (group != groups.end()) {
      group->push_back(o);
    } else {
      groups.push_back({o});
    }
  }
  return groups;
}

}  // namespace

ObserverPlan::ObserverPlan(const ModelSet& models)
    : models_(&models),
      channels_(models.channels.size()),
      slots_(models.observers.size() * models.channels.size()) {
  for (std::size_t c = 0; c < channels_; ++c) {
    unsigned mask = MaskOf(models.channels[c].output);
    for (std::size_t o = 0; o < models.observers.size(); ++o) {
      mask |= RequiredSignals(At(o, c).model);
      depth_ = std::max(depth_, MaxLag(At(o, c).model) + 1);
    }
    signals_.push_back(static_cast<SignalMask>(mask));
    first_blocks_.push_back(blocks_.size());
    AddChannel(c);
    bool in_order = true;
    for (std::size_t o = 0; o < models.observers.size(); ++o) {
      in_order = in_order && slot(o, c) == first_blocks_[c] * kLanes + o;
    }
    in_order_.push_back(in_order ? 1 : 0);
  }
  first_blocks_.push_back(blocks_.size());
}

// Difference groups come last, because they need the normal prediction.
void ObserverPlan::AddChannel(std::size_t channel) {
  const auto model = [&](std::size_t o) -> const TsModel& {
    return At(o, channel).model;
  };
  Members all(models_->observers.size());
  std::iota(all.begin(), all.end(), std::size_t{0});
  for (const bool difference : {false, true}) {
    Members some;
    std::copy_if(all.begin(), all.end(), std::back_inserter(some), [&](auto o) {
      return At(o, channel).difference == difference;
    });
    // A free-running model reads its own past, so that equal antecedents still
    // fire differently.
    Members rest;
    for (const Members& members : Sorted(some, [&](auto a, auto b) {
           return !IsFreeRunning(model(b)) &&
                  SharesAntecedents(model(a), model(b));
         })) {
      if (members.size() >= kMinSharedMembers) {
        AddGroup(channel, members, true);
      } else {
        rest.insert(rest.end(), members.begin(), members.end());
      }
    }
    for (const Members& members : Sorted(rest, [&](auto a, auto b) {
           return SameRegressors(model(a), model(b));
         })) {
      AddGroup(channel, members, false);
    }
  }
}

void ObserverPlan::AddGroup(std::size_t channel, const Members& members,
                            bool shared) {
  Members ordered = members;
  // A block evaluates as many rules as its first model has, so models with
  // similar numbers of rules share one. The sort is stable to leave observers
  // with equally many in order, for in_order().
  std::stable_sort(ordered.begin(), ordered.end(), [&](auto a, auto b) {
    return At(a, channel).model.rules.size() >
           At(b, channel).model.rules.size();
  });
  const ChannelObserver& first = At(ordered.front(), channel);
  ObserverGroup group;
  group.channel = channel;
  group.difference = first.difference;
  group.shared = shared;
  group.first_block = blocks_.size();
  group.blocks = (ordered.size() + kLanes - 1) / kLanes;
  group.regressors = Sources(first.model);
  group.free_running = IsFreeRunning(first.model);
  group.own_block = own_blocks_;
  own_blocks_ += group.free_running ? group.blocks : 0;
  if (shared) {
    AddSharedPremises(first.model, group);
  }
  for (std::size_t b = 0; b < group.blocks; ++b) {
    LaneModels models{};
    for (std::size_t i = 0; i < kLanes && b * kLanes + i < ordered.size();
         ++i) {
      models[i] = &At(ordered[b * kLanes + i], channel).model;
    }
    AddBlock(models, group);
  }
  AddSlots(group, ordered);
  groups_.push_back(std::move(group));
}

// Appends the blocks of the group, whose first_block must be the number of
// blocks so far.
void ObserverPlan::AddSlots(const ObserverGroup& group,
                            const Members& members) {
  for (std::size_t k = 0; k < members.size(); ++k) {
    slots_[members[k] * channels_ + group.channel] =
        group.first_block * kLanes + k;
    if (k % kLanes == 0) {
      blocks_.emplace_back();
    }
    const ChannelObserver& own = At(members[k], group.channel);
    const Trapezoid& m = own.membership;
    ObserverBlock& block = blocks_.back();
    const std::size_t i = k % kLanes;
    block.output_min.lane[i] = own.model.output_min;
    block.output_max.lane[i] = own.model.output_max;
    block.saturation.lane[i] = own.model.saturation;
    block.a.lane[i] = m.a;
    block.b.lane[i] = m.b;
    block.c.lane[i] = m.c;
    block.d.lane[i] = m.d;
    block.rise.lane[i] = m.b - m.a;
    block.fall.lane[i] = m.d - m.c;
    const double variance = own.residual_sd * own.residual_sd;
    block.sd.lane[i] = own.residual_sd;
    block.variance.lane[i] = variance;
    block.log_variance.lane[i] = std::log(variance);
  }
}

}  // namespace fdi
