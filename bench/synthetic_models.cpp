#include "bench/synthetic_models.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <string>

namespace fdi::bench {
namespace {

constexpr double kInfinite = std::numeric_limits<double>::infinity();
constexpr double kNoise = 0.1;
constexpr double kInlet = 3500.0;   // P1 [kPa]
constexpr double kOutlet = 2600.0;  // P2 [kPa]
constexpr double kTemperature = 105.0;

FuzzySet Everything() {
  return {0.0, 0.0, kInfinite, kInfinite};
}

struct ModelShape {
  Signal output;
  std::vector<Regressor> regressors;
  int rules;
  int split;         // regressors whose range the rules divide
  double sharpness;  // cores per width
};

// Mean and half range of a signal in the samples.
std::pair<double, double> Spread(Signal signal) {
  switch (signal) {
    case Signal::kP1:
      return {kInlet, 10.0};
    case Signal::kP2:
      return {kOutlet, 10.0};
    case Signal::kF:
      return {59.0, 22.0};
    default:
      return {50.0, 21.0};
  }
}

// Rule i of `shape`: the i-th part of the range, an affine function near the
// valve's own.
TsRule Rule(const ModelShape& shape, int i, double offset,
            std::mt19937_64& random) {
  std::uniform_real_distribution<double> jitter(-0.1, 0.1);
  TsRule rule;
  rule.data_share = 1.0 / shape.rules;
  rule.intercept = offset;
  const auto count = shape.regressors.size();
  for (std::size_t j = 0; j < count; ++j) {
    const auto [mean, half] = Spread(shape.regressors[j].signal);
    const double part = 2.0 * half / shape.rules;
    const double low = mean - half + part * (i + jitter(random));
    const double width = part / shape.sharpness;
    rule.antecedents.push_back(
        static_cast<int>(j) < shape.split
            ? FuzzySet{low, low + part, i == 0 ? kInfinite : width,
                       i + 1 == shape.rules ? kInfinite : width}
            : Everything());
    rule.slopes.push_back(0.0);
  }
  return rule;
}

// Puts `gain` on the first regressor of `signal`, so that it acts about `mean`.
void Depend(TsRule& rule, const ModelShape& shape, Signal signal, double gain) {
  for (std::size_t j = 0; j < shape.regressors.size(); ++j) {
    if (shape.regressors[j].signal == signal) {
      rule.slopes[j] = gain;
      return;
    }
  }
}

ChannelObserver Model(const ModelShape& shape, double offset,
                      std::mt19937_64& random) {
  ChannelObserver channel;
  TsModel& model = channel.model;
  model.output = shape.output;
  model.regressors = shape.regressors;
  const bool own =
      std::any_of(shape.regressors.begin(), shape.regressors.end(),
                  [&](const Regressor& r) { return r.signal == shape.output; });
  for (const Regressor& regressor : shape.regressors) {
    const auto [mean, half] = Spread(regressor.signal);
    model.regressor_min.push_back(mean - half);
    model.regressor_max.push_back(mean + half);
  }
  model.output_min = -100.0;
  model.output_max = 5000.0;
  for (int i = 0; i < shape.rules; ++i) {
    TsRule rule = Rule(shape, i, offset, random);
    const bool by_x = shape.regressors.front().signal == Signal::kX;
    const double past = own ? 0.3 : 0.0;
    if (shape.output == Signal::kX) {
      Depend(rule, shape, Signal::kCv, 1.0);
    } else if (shape.output == Signal::kF) {
      rule.intercept = (1.0 - past) * (100.0 + offset);
      Depend(rule, shape, by_x ? Signal::kX : Signal::kCv, past - 1.0);
      Depend(rule, shape, Signal::kP1, (1.0 - past) * 0.01);
      Depend(rule, shape, Signal::kP2, (past - 1.0) * 0.01);
      Depend(rule, shape, Signal::kF, past);
    } else {
      rule.intercept += shape.output == Signal::kT1   ? kTemperature
                        : shape.output == Signal::kP1 ? kInlet
                                                      : kOutlet;
    }
    model.rules.push_back(rule);
  }
  channel.residual_sd =
      shape.output == Signal::kP1 || shape.output == Signal::kP2 ? 50.0 * kNoise
                                                                 : 2.0 * kNoise;
  const double sd = channel.residual_sd;
  channel.membership = {-6.0 * sd, -3.0 * sd, 3.0 * sd, 6.0 * sd};
  channel.correlation_time = 2.0;
  channel.interpolation_error = 0.1;
  return channel;
}

ChannelSpec Channel(const std::string& name, Signal output, double threshold,
                    std::vector<int> windows) {
  ChannelSpec channel{name, output, -threshold, threshold};
  for (const int length : windows) {
    channel.windows.push_back(
        {length, -threshold, threshold, std::log(threshold), 0.5, 3.0});
  }
  return channel;
}

// Observer i of fault 1 + (i − 1) % faults, the strengths of a fault rising.
Observer Condition(int i, int count, const std::vector<int>& faults) {
  const int kinds = static_cast<int>(faults.size());
  Observer observer;
  observer.name = i == 0 ? "normal" : "fault " + std::to_string(i);
  if (i > 0) {
    const int steps = (count - 2) / kinds + 1;
    observer.fault = faults[static_cast<std::size_t>((i - 1) % kinds)];
    observer.strength = static_cast<double>((i - 1) / kinds + 1) / steps;
  }
  return observer;
}

// Effect of the fault of `observer` on the channel: its own pattern.
double Effect(const Observer& observer, std::size_t channel) {
  const double pattern =
      observer.fault == 0
          ? 0.0
          : std::sin(1.7 * observer.fault + 2.3 * static_cast<double>(channel));
  return 8.0 * observer.strength * pattern;
}

}  // namespace

ModelSet PaperSet(int observers) {
  const ModelShape x{
      Signal::kX,
      {{Signal::kCv, 0}, {Signal::kCv, 1}, {Signal::kP2, 0}, {Signal::kP2, 1}},
      5,
      4,
      1.0};
  const std::vector<Regressor> flow{
      {Signal::kCv, 0}, {Signal::kCv, 1}, {Signal::kP1, 0}, {Signal::kP1, 1},
      {Signal::kP2, 0}, {Signal::kP2, 1}, {Signal::kF, 1}};
  std::mt19937_64 random(1);
  ModelSet models;
  models.name = "paper";
  models.faults = {1, 3, 6, 7, 19};
  models.channels = {Channel("X", Signal::kX, 1.0, {}),
                     Channel("F", Signal::kF, 1.0, {})};
  for (int i = 0; i < observers; ++i) {
    Observer observer = Condition(i, observers, models.faults);
    const int rules = i % 3 == 1 ? 1 + i % 4 : 5;
    const ModelShape f{Signal::kF, flow, rules, 7, 0.7};
    observer.channels = {Model(x, Effect(observer, 0), random),
                         Model(f, Effect(observer, 1), random)};
    models.observers.push_back(observer);
  }
  return models;
}

ModelSet ExtendedSet(int observers) {
  const Regressor cv{Signal::kCv, 0};
  const std::vector<Regressor> position{cv,
                                        {Signal::kCv, 5},
                                        {Signal::kCv, 6},
                                        {Signal::kP1, 3},
                                        {Signal::kP1, 4},
                                        {Signal::kP2, 0}};
  const std::vector<Regressor> indirect{cv,
                                        {Signal::kCv, 5},
                                        {Signal::kCv, 6},
                                        {Signal::kP1, 4},
                                        {Signal::kP1, 5},
                                        {Signal::kP2, 0},
                                        {Signal::kP2, 3}};
  const std::vector<ModelShape> shapes{
      {Signal::kX, position, 24, 1, 8.0},
      {Signal::kF,
       {{Signal::kX, 0}, {Signal::kP1, 0}, {Signal::kP2, 0}},
       12,
       1,
       6.0},
      {Signal::kF, indirect, 24, 1, 5.0},
      {Signal::kT1, {cv}, 1, 0, 1.0},
      {Signal::kP1, {cv}, 1, 0, 1.0},
      {Signal::kP2, {cv}, 1, 0, 1.0}};
  ModelSet models;
  models.name = "extended";
  for (int fault = 1; fault <= 19; ++fault) {
    models.faults.push_back(fault);
  }
  models.decision.evidence_window = 400.0;
  models.channels = {Channel("X", Signal::kX, 1.0, {30, 200}),
                     Channel("F", Signal::kF, 1.0, {30, 200}),
                     Channel("F(CV)", Signal::kF, 1.0, {30, 200}),
                     Channel("T1", Signal::kT1, 1.0, {30}),
                     Channel("P1", Signal::kP1, 30.0, {30}),
                     Channel("P2", Signal::kP2, 30.0, {30})};
  for (int i = 0; i < observers; ++i) {
    Observer observer = Condition(i, observers, models.faults);
    for (std::size_t c = 0; c < shapes.size(); ++c) {
      std::mt19937_64 random(c);  // the same antecedents in every observer
      const double effect = c < 3 ? Effect(observer, c) : 0.0;
      observer.channels.push_back(Model(shapes[c], effect, random));
    }
    models.observers.push_back(observer);
  }
  return models;
}

std::vector<Sample> Samples(int count, int phase, double shift) {
  std::mt19937_64 random(static_cast<std::uint64_t>(phase) + 1);
  std::normal_distribution<double> noise(0.0, kNoise);
  std::vector<Sample> samples;
  for (int k = 0; k < count; ++k) {
    Sample sample;
    sample.stamp_ns = static_cast<std::int64_t>(k + 1) * 1'000'000'000;
    sample.source_id = 1;
    sample.seq = static_cast<std::uint64_t>(k);
    const double cv =
        50.0 + 20.0 * std::sin(2.0 * std::numbers::pi * (k + phase) / 200.0);
    const double p1 = kInlet + 50.0 * noise(random);
    const double p2 = kOutlet + 50.0 * noise(random);
    sample.Set(Signal::kCv, cv);
    sample.Set(Signal::kP1, p1);
    sample.Set(Signal::kP2, p2);
    sample.Set(Signal::kT1, kTemperature + noise(random));
    sample.Set(Signal::kX, cv + noise(random));
    sample.Set(Signal::kF,
               100.0 - cv + 0.01 * (p1 - p2) + noise(random) + shift);
    samples.push_back(sample);
  }
  return samples;
}

}  // namespace fdi::bench
