#include <memory>

#include <gtest/gtest.h>

#include "diagnosis/decision/valve_engine.h"
#include "diagnosis/model/fault_catalogue.h"
#include "diagnosis/observers/intake.h"
#include "tests/diagnosis/linear_plant.h"

namespace fdi {
namespace {

using tests::LinearModel;
using tests::PlantSample;

constexpr int kLimit = 100;

// The linear plant with a channel T1, and its fault: 20 degC too much.
ModelSet HeatedPlant() {
  ModelSet models = tests::LinearPlant();
  models.channels.push_back({"T1", Signal::kT1, -5.0, 5.0});
  for (Observer& observer : models.observers) {
    observer.channels.push_back(LinearModel(Signal::kT1, 0.0, 100.0));
  }
  Observer broken = models.observers.front();
  broken.name = "t1";
  broken.fault = kTemperatureTransmitterFault;
  broken.strength = 0.5;
  broken.channels[2] = LinearModel(Signal::kT1, 0.0, 120.0);
  models.observers.push_back(broken);
  models.faults.push_back(kTemperatureTransmitterFault);
  models.stuck.t1 = kLimit;
  return models;
}

// T1 changes with every sample, but from `stuck` to before `moves`.
Sample HeatedSample(int k, int stuck, int moves) {
  Sample sample = PlantSample(static_cast<std::uint64_t>(k));
  const int at = k >= stuck && k < moves ? stuck : k;
  sample.Set(Signal::kT1, 100.0 + 0.1 * (at % 7));
  return sample;
}

TEST(StuckReadingsTest, TransmitterIsNamedOnceItRepeatsItselfForTooLong) {
  ValveEngine engine(std::make_shared<const ModelSet>(HeatedPlant()));
  const int t_k = engine.models().decision.isolation_samples;
  std::vector<Transition> transitions;
  for (int k = 0; k < 700; ++k) {
    const Verdict& verdict = engine.Step(HeatedSample(k, 200, 500));
    transitions.insert(transitions.end(), verdict.Transitions().begin(),
                       verdict.Transitions().end());
    if (k == 499) {
      EXPECT_EQ(verdict.normal_factor, 0.0);
      EXPECT_EQ(FaultSetName(engine.models(), verdict.isolated), "t1");
    }
  }
  ASSERT_EQ(transitions.size(), 4U);
  EXPECT_EQ(transitions[0].kind, TransitionKind::kDetected);
  EXPECT_EQ(transitions[0].stamp_ns, HeatedSample(200 + kLimit, 0, 0).stamp_ns);
  EXPECT_EQ(transitions[1].kind, TransitionKind::kIsolated);
  EXPECT_EQ(transitions[1].stamp_ns,
            HeatedSample(200 + kLimit + t_k - 1, 0, 0).stamp_ns);
  EXPECT_EQ(transitions[3].reason, EndReason::kCleared);
}

TEST(StuckReadingsTest, WhatIsUncertainIsNoReading) {
  for (const bool marked : {false, true}) {
    ValveEngine engine(std::make_shared<const ModelSet>(HeatedPlant()));
    int transitions = 0;
    for (int k = 0; k < 600; ++k) {
      Sample sample = HeatedSample(k, 200, 500);
      sample.quality[Index(Signal::kT1)] = marked && k > 200 && k < 500
                                               ? SignalQuality::kUncertain
                                               : SignalQuality::kGood;
      transitions += engine.Step(sample).transition_count;
    }
    EXPECT_EQ(transitions == 0, marked);
  }
}

TEST(StuckReadingsTest, RunUpToTheLimitIsNormal) {
  ValveEngine engine(std::make_shared<const ModelSet>(HeatedPlant()));
  for (int k = 0; k < 600; ++k) {
    EXPECT_EQ(engine.Step(HeatedSample(k, 200, 200 + kLimit)).transition_count,
              0);
  }
}

TEST(StuckReadingsTest, WithoutTheFaultOrTheLimitThereIsNoEffect) {
  ModelSet without_fault = HeatedPlant();
  without_fault.observers.pop_back();
  without_fault.faults.pop_back();
  ModelSet without_limit = HeatedPlant();
  without_limit.stuck.t1 = 0;
  for (const ModelSet& models : {without_fault, without_limit}) {
    ValveEngine engine(std::make_shared<const ModelSet>(models));
    for (int k = 0; k < 600; ++k) {
      EXPECT_EQ(engine.Step(HeatedSample(k, 0, 600)).transition_count, 0);
    }
  }
}

TEST(StuckReadingsTest, AnotherSourceBeginsAnew) {
  ValveEngine engine(std::make_shared<const ModelSet>(HeatedPlant()));
  for (int k = 0; k < 180; ++k) {
    Sample sample = HeatedSample(k, 0, 600);
    sample.source_id = k < 90 ? 7 : 8;
    EXPECT_EQ(engine.Step(sample).transition_count, 0);
  }
}

}  // namespace
}  // namespace fdi
