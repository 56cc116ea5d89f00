#pragma once

#include <cmath>
#include <cstdint>
#include <memory>
#include <numbers>
#include <random>

#include "diagnosis/model/model_set.h"

/// A plant whose residuals can be told by hand. X = CV; F = 100 − CV without
/// fault; f6 adds 20 s to F, f3 adds s (20 + 0.4 (CV − 50)): the same at
/// CV = 50, another slope. f1 takes 20 s from X.
namespace fdi::tests {

inline constexpr double kNoise = 0.5;  // of both outputs

inline ChannelObserver LinearModel(Signal output, double slope,
                                   double intercept) {
  TsRule rule;
  rule.antecedents = {{50.0, 50.0, 1e6, 1e6}};
  rule.slopes = {slope};
  rule.intercept = intercept;
  rule.data_share = 1.0;
  ChannelObserver channel;
  channel.model.output = output;
  channel.model.regressors = {{Signal::kCv, 0}};
  channel.model.regressor_min = {0.0};
  channel.model.regressor_max = {100.0};
  channel.model.output_min = -100.0;
  channel.model.output_max = 200.0;
  channel.model.rules = {rule};
  channel.membership = {-5 * kNoise, -2 * kNoise, 2 * kNoise, 5 * kNoise};
  channel.residual_sd = kNoise;
  channel.interpolation_error = 0.02;
  return channel;
}

inline Observer F6(double s) {
  return {"f6",
          6,
          s,
          {LinearModel(Signal::kX, 1.0, 0.0),
           LinearModel(Signal::kF, -1.0, 100.0 + 20.0 * s)}};
}

inline Observer F3(double s) {
  return {
      "f3",
      3,
      s,
      {LinearModel(Signal::kX, 1.0, 0.0),
       LinearModel(Signal::kF, -1.0 + 0.4 * s, 100.0 + 20.0 * s - 20.0 * s)}};
}

inline Observer F1(double s) {
  return {"f1",
          1,
          s,
          {LinearModel(Signal::kX, 1.0, -20.0 * s),
           LinearModel(Signal::kF, -1.0, 100.0)}};
}

inline ModelSet LinearPlant() {
  ModelSet models;
  models.name = "linear";
  models.channels = {{"X", Signal::kX, -4 * kNoise, 4 * kNoise},
                     {"F", Signal::kF, -4 * kNoise, 4 * kNoise}};
  models.decision.isolation_samples = 10;
  models.decision.clearing_samples = 20;
  models.decision.settling_samples = kMaxLag;
  models.observers = {{"normal",
                       0,
                       0.0,
                       {LinearModel(Signal::kX, 1.0, 0.0),
                        LinearModel(Signal::kF, -1.0, 100.0)}},
                      F1(0.5),
                      F1(1.0),
                      F3(0.5),
                      F3(1.0),
                      F6(0.5),
                      F6(1.0)};
  models.faults = {1, 3, 6};
  models.validity.cv = {0.0, 90.0};
  return models;
}

inline std::shared_ptr<const ModelSet> SharedPlant() {
  return std::make_shared<const ModelSet>(LinearPlant());
}

/// Sample k, 1 s apart, in m³/h, CV = 50 + swing sin(2 π k/40).
inline Sample PlantSample(std::uint64_t k, double swing = 20.0) {
  Sample sample;
  sample.stamp_ns = static_cast<std::int64_t>(k + 1) * 1'000'000'000;
  sample.source_id = 7;
  sample.seq = k;
  const double cv = 50.0 + swing * std::sin(2.0 * std::numbers::pi *
                                            static_cast<double>(k) / 40.0);
  sample.Set(Signal::kCv, cv);
  sample.Set(Signal::kX, cv);
  sample.Set(Signal::kF, 100.0 - cv);
  return sample;
}

inline void AddF6(Sample& sample, double s) {
  sample.values[Index(Signal::kF)] += 20.0 * s;
}

inline void AddF3(Sample& sample, double s) {
  sample.values[Index(Signal::kF)] +=
      s * (20.0 + 0.4 * (sample[Signal::kCv] - 50.0));
}

/// Adds noise of deviation kNoise to both outputs (Box-Muller on mt19937_64).
class Noise {
 public:
  explicit Noise(std::uint64_t seed) : engine_(seed) {}

  void Add(Sample& sample) {
    const double radius = std::sqrt(-2.0 * std::log(Uniform()));
    const double angle = 2.0 * std::numbers::pi * Uniform();
    sample.values[Index(Signal::kX)] += kNoise * radius * std::cos(angle);
    sample.values[Index(Signal::kF)] += kNoise * radius * std::sin(angle);
  }

 private:
  double Uniform() {
    return (static_cast<double>(engine_() >> 11) + 0.5) * 0x1p-53;
  }

  std::mt19937_64 engine_;
};

}  // namespace fdi::tests
