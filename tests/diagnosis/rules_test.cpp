#include <cstdint>
#include <vector>

#include <gtest/gtest.h>

#include "diagnosis/decision/look_answer.h"
#include "diagnosis/decision/valve_looks.h"
#include "tests/diagnosis/linear_plant.h"

namespace fdi {
namespace {

class NoSimulation final : public LookSimulation {
 public:
  NoSimulation() : LookSimulation({}) {}
  double HealthyFlow(const InputRow& /*input*/,
                     double /*x_pct*/) const override {
    return 1.0;
  }
  SecondLook Look(const LookWindow& /*window*/,
                  const std::stop_token& /*stop*/) const override {
    return {};
  }
  StrengthLook Strengths(const LookWindow& /*window*/,
                         const std::vector<Explanation>& /*known*/,
                         const std::stop_token& /*stop*/) const override {
    return {};
  }
  double Misfit(const LookWindow& /*window*/) const override { return 1.0; }
};

// Near the limits of what they see, observers name a fault now and then.
TEST(RulesTest, WhatTheObserversNamedForLongIsRemembered) {
  const ModelSet models = tests::LinearPlant();
  const NoSimulation simulation;
  ValveLooks looks(simulation, &models);
  Verdict verdict;
  verdict.detected = true;
  verdict.isolated = 0b001;
  verdict.transitions[0].kind = TransitionKind::kDetected;
  verdict.transitions[0].detection_stamp_ns = tests::PlantSample(0).stamp_ns;
  verdict.transition_count = 1;
  for (std::uint64_t k = 0; k < 700; ++k) {
    verdict.isolated = k < 690 ? 0b001 : 0b010;
    looks.Step(tests::PlantSample(k), verdict);
    verdict.transition_count = 0;
  }
  EXPECT_EQ(looks.Observed(models, 0b010), 0b011U);
}

// Without X or a pressure the errors of a healthy valve are wide, and a
// transducer as wrong as there is is what comes nearest to anything else.
TEST(RulesTest, ALookWhoseFaultIsAsLargeAsThereIsFitsNothing) {
  for (const double strength : {-1.0, -0.5}) {
    SecondLook look;
    look.ranked.resize(2);
    look.ranked[0].fault = 12;
    look.ranked[0].strength = strength;
    look.ranked[1].distance = 1000.0;
    look.misfit = 3.0;
    look.readings = 100.0;
    look.complete = false;
    EXPECT_EQ(AnswerOf(look).outcome,
              strength == -1.0 ? LookOutcome::kNoneFits : LookOutcome::kNamed);
  }
}

}  // namespace
}  // namespace fdi
