#include "diagnosis/observers/observer_bank.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <gtest/gtest.h>

#include "diagnosis/model/fault_catalogue.h"
#include "diagnosis/model/verdict.h"
#include "diagnosis/observers/detection.h"
#include "tests/diagnosis/linear_plant.h"

namespace fdi {
namespace {

using tests::LinearModel;

// X̂(k) = 0.5 X̂(k−1) + 0.5 CV(k−1), parallel or on the measured past.
ModelSet FirstOrder(bool parallel) {
  ModelSet models = tests::LinearPlant();
  ChannelObserver channel = LinearModel(Signal::kX, 1.0, 0.0);
  channel.model.parallel = parallel;
  channel.model.regressors = {{Signal::kX, 1}, {Signal::kCv, 1}};
  channel.model.regressor_min = {0.0, 0.0};
  channel.model.regressor_max = {100.0, 100.0};
  channel.model.rules[0].antecedents = {{50, 50, 1e6, 1e6}, {50, 50, 1e6, 1e6}};
  channel.model.rules[0].slopes = {0.5, 0.5};
  models.channels.resize(1);
  models.observers = {{"normal", 0, 0.0, {channel}}};
  models.faults.clear();
  return models;
}

Sample Reading(double cv, double x) {
  Sample sample;
  sample.Set(Signal::kCv, cv);
  sample.Set(Signal::kX, x);
  return sample;
}

void MarkUncertain(Sample& sample, Signal signal) {
  sample.quality[Index(signal)] = SignalQuality::kUncertain;
}

TEST(ObserverBankTest, WhatIsUncertainOrPredictedFromItIsNotMeasured) {
  const ModelSet models = FirstOrder(false);
  ObserverBank bank(models);
  const Sample good = Reading(60.0, 80.0);
  Sample x_uncertain = good;
  MarkUncertain(x_uncertain, Signal::kX);
  Sample cv_uncertain = good;
  MarkUncertain(cv_uncertain, Signal::kCv);
  bank.Initialise(good);
  const auto is_measured = [&](const Sample& sample) {
    bank.Step(sample);
    EXPECT_EQ(std::isnan(bank.residual(0, 0)), !bank.measured(0));
    EXPECT_EQ(bank.measured_channels(), bank.measured(0) ? 1 : 0);
    return bank.measured(0);
  };
  EXPECT_TRUE(is_measured(good));
  EXPECT_FALSE(is_measured(x_uncertain));
  EXPECT_FALSE(is_measured(good));  // Predicted from the X before.
  EXPECT_TRUE(is_measured(good));
  EXPECT_TRUE(is_measured(cv_uncertain));  // Predicted from the CV before.
  EXPECT_FALSE(is_measured(good));
  EXPECT_TRUE(is_measured(good));
}

// One sample in three: hardly any is predicted from readings alone.
TEST(ObserverBankTest, OfSlowDataTheReadingAloneDecides) {
  const ModelSet models = FirstOrder(false);
  ObserverBank bank(models);
  const Sample good = Reading(60.0, 80.0);
  Sample drawn = good;
  MarkUncertain(drawn, Signal::kX);
  MarkUncertain(drawn, Signal::kCv);
  bank.Initialise(good);
  int measured = 0;
  for (int k = 1; k <= 600; ++k) {
    bank.Step(k % 3 == 0 ? good : drawn);
    measured += k > 300 && bank.measured(0) ? 1 : 0;
  }
  EXPECT_EQ(measured, 100);
}

// X̂ = X̂_0 + 0.1 CV: it follows the dynamics of the normal observer.
TEST(ObserverBankTest, DifferenceIsAddedToTheNormalPrediction) {
  ModelSet models = FirstOrder(true);
  ChannelObserver difference = LinearModel(Signal::kX, 0.1, 0.0);
  difference.difference = true;
  models.observers.push_back({"f1 0.50", 1, 0.5, {difference}});
  models.observers.push_back({"f1 1.00", 1, 1.0, {difference}});
  models.observers[2].channels[0].model.rules[0].slopes = {0.2};
  models.faults = {1};
  ObserverBank bank(models);
  bank.Initialise(Reading(60.0, 80.0));
  for (int k = 1; k <= 10; ++k) {
    bank.Step(Reading(60.0, 5.0));
    const double normal = 60.0 + 20.0 * std::pow(0.5, k);
    EXPECT_NEAR(bank.prediction(0, 0), normal, 1e-12);
    EXPECT_NEAR(bank.prediction(1, 0), normal + 6.0, 1e-12);
    EXPECT_NEAR(bank.residual(2, 0), 5.0 - normal - 12.0, 1e-12);
  }
}

TEST(ObserverBankTest, ParallelObserverForgetsTheMeasuredPast) {
  const ModelSet models = FirstOrder(true);
  ObserverBank bank(models);
  bank.Initialise(Reading(60.0, 80.0));
  // From 80 towards 60 by halves, whatever is measured.
  for (int k = 1; k <= 10; ++k) {
    bank.Step(Reading(60.0, 5.0));
    EXPECT_NEAR(bank.prediction(0, 0), 60.0 + 20.0 * std::pow(0.5, k), 1e-12);
    EXPECT_NEAR(bank.residual(0, 0), 5.0 - bank.prediction(0, 0), 1e-12);
  }
}

TEST(ObserverBankTest, SeriesParallelObserverReadsTheMeasuredPast) {
  const ModelSet models = FirstOrder(false);
  ObserverBank bank(models);
  bank.Initialise(Reading(60.0, 80.0));
  bank.Step(Reading(60.0, 20.0));
  EXPECT_NEAR(bank.prediction(0, 0), 70.0, 1e-12);
  bank.Step(Reading(60.0, 20.0));
  EXPECT_NEAR(bank.prediction(0, 0), 40.0, 1e-12);
}

TEST(ObserverBankTest, PredictionStaysWithinTheOutputLimits) {
  ModelSet models = FirstOrder(true);
  models.observers[0].channels[0].model.output_max = 50.0;
  ObserverBank bank(models);
  bank.Initialise(Reading(60.0, 80.0));
  bank.Step(Reading(60.0, 80.0));
  EXPECT_EQ(bank.prediction(0, 0), 50.0);
}

TEST(ObserverBankTest, ExtrapolationIsWhatTheRangeWouldHaveKept) {
  ModelSet models = tests::LinearPlant();
  models.observers[0].channels[1].model.regressor_max = {60.0};
  ObserverBank bank(models);
  Sample sample = tests::PlantSample(0);
  sample.Set(Signal::kCv, 75.0);
  bank.Initialise(sample);
  bank.Step(sample);
  EXPECT_NEAR(bank.extrapolation(0, 1), 15.0, 1e-12);
  EXPECT_EQ(bank.extrapolation(1, 1), 0.0);
}

TEST(ObserverBankTest, WhatIsAllowedCountsAsExtrapolation) {
  const ModelSet models = tests::LinearPlant();
  ObserverBank bank(models);
  std::array<double, 7> factors{};
  Sample sample = Reading(50.0, 50.0 + 3.0 * tests::kNoise);
  sample.Set(Signal::kF, 50.0);
  bank.Initialise(sample);
  const auto normal = [&](double allowed) {
    bank.Allow(0, allowed);
    bank.Step(sample);
    bank.Score(factors);
    EXPECT_EQ(CertainResidual(bank, 0),
              std::max(3.0 * tests::kNoise - allowed, 0.0));
    EXPECT_EQ(CertainResidual(bank, 1), 0.0);
    return factors[0];
  };
  const double without = normal(0.0);
  EXPECT_GT(normal(0.25 * tests::kNoise), without);
  EXPECT_EQ(normal(3.0 * tests::kNoise), 1.0);
  EXPECT_EQ(normal(0.0), without);
}

TEST(FaultCatalogueTest, NamesAreReadInAnyCaseAndPaperNamesMapToTheFive) {
  EXPECT_EQ(ParseFault("F19"), 19);
  EXPECT_EQ(ParseFault("f1"), 1);
  EXPECT_EQ(ParseFault("paper2"), 3);
  EXPECT_EQ(ParseFault("PAPER5"), 19);
  EXPECT_FALSE(ParseFault("f99").has_value());
  EXPECT_FALSE(ParseFault("paper6").has_value());
  EXPECT_FALSE(ParseFault("f1x").has_value());
  EXPECT_FALSE(ParseFault("p3").has_value());
  EXPECT_EQ(ParseFault("T1"), 20);
  EXPECT_EQ(ParseFault("p1"), 21);
  EXPECT_EQ(ParseFault("P2"), 22);
  EXPECT_EQ(TransmitterOf(20), Signal::kT1);
  EXPECT_EQ(TransmitterOf(22), Signal::kP2);
  EXPECT_EQ(TransmitterOf(19), std::nullopt);
  for (int fault = 1; fault <= kLastFault; ++fault) {
    EXPECT_EQ(ParseFault(FaultName(fault)), fault);
  }
}

TEST(EpisodeIdTest, DependsOnValveSourceAndStamp) {
  const auto id = EpisodeId("FV-1", 1, 2);
  EXPECT_EQ(id, EpisodeId("FV-1", 1, 2));
  EXPECT_NE(id, EpisodeId("FV-2", 1, 2));
  EXPECT_NE(id, EpisodeId("FV-1", 2, 2));
  EXPECT_NE(id, EpisodeId("FV-1", 1, 3));
}

}  // namespace
}  // namespace fdi
