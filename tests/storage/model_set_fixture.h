#pragma once

#include <random>
#include <string>

#include "diagnosis/model/model_set.h"

namespace fdi::storage {

/// A usable model set of `observers` observers for X and F, its numbers random.
inline ModelSet RandomModelSet(const std::string& name, int observers = 3,
                               unsigned seed = 1) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> uniform(0.001, 0.999);
  const auto number = [&] { return uniform(random); };
  ModelSet models;
  models.name = name;
  models.created_ns = 1'700'000'000'250'000'000;
  models.software = "test 0.1";
  models.preset = "paper";
  models.flow_unit = FlowUnit::kTPerHour;
  models.channels = {{"X", Signal::kX, -number(), number()},
                     {"F", Signal::kF, -number(), number()}};
  models.groups = {{1, 2}};
  models.undetectable = {7};
  models.training_runs = {"0123456789ab", "ba9876543210@0:1500"};
  models.threshold_hours = number();
  models.every = {.t1 = 5, .x = 30};
  for (int o = 0; o < observers; ++o) {
    Observer observer;
    observer.name = o == 0 ? "normal" : "f" + std::to_string(o) + " 0.50";
    observer.fault = o;
    observer.strength = o == 0 ? 0.0 : number();
    if (o > 0) {
      models.faults.push_back(o);
    }
    for (const ChannelSpec& spec : models.channels) {
      ChannelObserver channel;
      TsModel& model = channel.model;
      model.output = spec.output;
      model.regressors = {{Signal::kCv, 0}, {spec.output, 1}};
      model.regressor_min = {number(), number()};
      model.regressor_max = {1.0 + number(), 1.0 + number()};
      model.output_max = 100.0 + number();
      for (int r = 0; r < 2; ++r) {
        TsRule rule;
        for (int j = 0; j < 2; ++j) {
          rule.antecedents.push_back(
              {number(), 1.0 + number(), number(),
               r == 0 ? number() : std::numeric_limits<double>::infinity()});
          rule.slopes.push_back(-number());
        }
        rule.intercept = number();
        rule.data_share = 0.5;
        if (r == 1) {
          rule.center = {number(), number()};
          rule.metric = {number(), -number(), number()};
        }
        model.rules.push_back(rule);
      }
      channel.membership = {-4.0, -number(), number(), 4.0};
      channel.residual_sd = number();
      channel.validation = {number(), 100.0 * number(), -number(), 720};
      observer.channels.push_back(channel);
    }
    models.observers.push_back(observer);
  }
  if (models.faults.size() < 2) {
    models.groups.clear();
  }
  return models;
}

}  // namespace fdi::storage
