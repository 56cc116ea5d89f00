#include "bench/study/model_reduction.h"

#include <gmock/gmock.h>

#include "base/error.h"
#include "diagnosis/model/fault_catalogue.h"

namespace fdi::trainer::study {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

// f3, f6 and f18 with channels X, F and T1.
ModelSet Set() {
  ModelSet models;
  models.name = "set";
  models.channels = {{"X", Signal::kX}, {"F", Signal::kF}, {"T1", Signal::kT1}};
  models.faults = {3, 6, 18};
  models.groups = {{3, 6, 18}, {6, 18}};
  models.undetectable = {6};
  for (const int fault : {0, 3, 6, 6, 18}) {
    Observer observer;
    observer.fault = fault;
    observer.channels.resize(3);
    for (std::size_t c = 0; c < 3; ++c) {
      observer.channels[c].residual_sd = 1.0 + static_cast<double>(c);
    }
    models.observers.push_back(observer);
  }
  return models;
}

TEST(ModelReductionTest, LeftOutFaultIsNowhereInTheSet) {
  const ModelSet reduced = WithoutFaults(Set(), {6});
  EXPECT_THAT(reduced.faults, ElementsAre(3, 18));
  EXPECT_THAT(reduced.groups, ElementsAre(ElementsAre(3, 18)));
  EXPECT_TRUE(reduced.undetectable.empty());
  ASSERT_EQ(reduced.observers.size(), 3U);
  EXPECT_EQ(reduced.observers[2].fault, 18);
}

TEST(ModelReductionTest, LeftOutChannelTakesItsModelsAlong) {
  const ModelSet reduced = WithoutChannels(Set(), {"t1", "X"});
  ASSERT_EQ(reduced.channels.size(), 1U);
  EXPECT_EQ(reduced.channels[0].name, "F");
  for (const Observer& observer : reduced.observers) {
    ASSERT_EQ(observer.channels.size(), 1U);
    EXPECT_EQ(observer.channels[0].residual_sd, 2.0);
  }
}

TEST(ModelReductionTest, LeftOutPartsActNoMore) {
  ModelSet models = Set();
  models.floor = FloorLimits{};
  AddFindings(models);
  models.faults.push_back(kPositionDrift);
  models.physics = {{"parameters.trim.kv_m3_h", 118.0}};
  models.decision.early_error = 1e-3;
  for (ChannelSpec& channel : models.channels) {
    channel.windows.resize(1);
  }

  EXPECT_TRUE(WithoutParts(models, {"looks"}).physics.empty());
  EXPECT_EQ(WithoutParts(models, {"early"}).decision.early_error, 0.0);
  EXPECT_TRUE(WithoutParts(models, {"windows"}).channels[1].windows.empty());
  const ModelSet without_floor = WithoutParts(models, {"floor"});
  EXPECT_FALSE(without_floor.floor.has_value());
  EXPECT_THAT(without_floor.faults, ElementsAre(3, 6, 18));
  EXPECT_FALSE(without_floor.physics.empty());
}

TEST(ModelReductionTest, WhatTheSetDoesNotHaveIsNamedWithWhatItHas) {
  try {
    WithoutFaults(Set(), {7});
    FAIL();
  } catch (const ConfigError& error) {
    EXPECT_THAT(error.what(), HasSubstr("f7; it knows f3 f6 f18"));
  }
  try {
    WithoutChannels(Set(), {"P2"});
    FAIL();
  } catch (const ConfigError& error) {
    EXPECT_THAT(error.what(), HasSubstr("'P2'; it has X F T1"));
  }
  EXPECT_THROW(WithoutChannels(Set(), {"X", "F", "T1"}), ConfigError);
}

}  // namespace
}  // namespace fdi::trainer::study
