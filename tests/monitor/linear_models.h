#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <string>

#include "diagnosis/model/model_set.h"

/// A plant so simple that every verdict can be told by hand: X = CV without
/// fault, X = CV − 20 with f7, X = CV + 20 with f1.
namespace fdi::monitor {

inline constexpr double kF7Offset = -20.0;
inline constexpr double kF1Offset = 20.0;
inline constexpr int kSettlingSamples = 16;  // kMaxLag: the engine's least

inline ChannelObserver OffsetModel(double offset) {
  TsRule rule;
  rule.antecedents = {{50.0, 50.0, 1e6, 1e6}};
  rule.slopes = {1.0};
  rule.intercept = offset;
  rule.data_share = 1.0;
  ChannelObserver channel;
  channel.model.output = Signal::kX;
  channel.model.regressors = {{Signal::kCv, 0}};
  channel.model.regressor_min = {0.0};
  channel.model.regressor_max = {100.0};
  channel.model.output_min = -50.0;
  channel.model.output_max = 150.0;
  channel.model.rules = {rule};
  channel.membership = {-6.0, -3.0, 3.0, 6.0};
  return channel;
}

inline ModelSet LinearModels() {
  ModelSet models;
  models.name = "linear";
  models.version = 1;
  models.content_hash = 0x1234;
  models.decision.isolation_samples = 5;
  models.decision.clearing_samples = 10;
  models.decision.settling_samples = kSettlingSamples;
  models.channels = {{"X", Signal::kX, -5.0, 5.0}};
  models.observers = {{"normal", 0, 0.0, {OffsetModel(0.0)}},
                      {"f1", 1, 1.0, {OffsetModel(kF1Offset)}},
                      {"f7", 7, 1.0, {OffsetModel(kF7Offset)}}};
  models.faults = {1, 7};
  return models;
}

inline std::shared_ptr<const ModelSet> SharedLinearModels(
    std::uint64_t hash = 0x1234) {
  ModelSet models = LinearModels();
  models.content_hash = hash;
  return std::make_shared<const ModelSet>(std::move(models));
}

/// Sample k of a source: CV = 50, X = 50 + offset, 1 s apart.
inline Sample PlantSample(std::uint64_t k, double offset = 0.0,
                          std::uint64_t source = 1) {
  Sample sample;
  sample.stamp_ns =
      1'700'000'000'000'000'000 + static_cast<std::int64_t>(k) * 1'000'000'000;
  sample.source_id = source;
  sample.seq = k;
  sample.Set(Signal::kCv, 50.0);
  sample.Set(Signal::kX, 50.0 + offset);
  return sample;
}

inline Sample BadSample(std::uint64_t k) {
  Sample sample = PlantSample(k);
  sample.Set(Signal::kX, std::numeric_limits<double>::quiet_NaN());
  return sample;
}

}  // namespace fdi::monitor
