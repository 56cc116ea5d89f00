#include "diagnosis/decision/certainty.h"

#include <memory>
#include <string>
#include <vector>

#include <gtest/gtest.h>

namespace fdi {
namespace {

TEST(CertaintyTest, ItFollowsFromTheNameItsLayerAndItsFactor) {
  using enum Certainty;
  EXPECT_EQ(CertaintyOf("f19", Layer::kObservers, 0.95), kSure);
  EXPECT_EQ(CertaintyOf("f19", Layer::kObservers, 0.8), kLikely);
  EXPECT_EQ(CertaintyOf("f19", Layer::kPhysics, 0.8), kSure);
  EXPECT_EQ(CertaintyOf("f19", Layer::kPhysics, 0.1), kLikely);
  EXPECT_EQ(CertaintyOf("x_stuck", Layer::kObservers, 1.0), kLikely);
  EXPECT_EQ(CertaintyOf("f3|f6", Layer::kPhysics, 1.0), kOneOf);
  EXPECT_EQ(CertaintyOf("", Layer::kObservers, 1.0), kNotYet);
  EXPECT_EQ(CertaintyOf("", Layer::kObservers, 0.0, Unknown::kOutsideKnown),
            kNotKnown);
  EXPECT_EQ(CertaintyOf("unknown", Layer::kObservers, 0.0), kNotKnown);
}

TEST(CertaintyTest, WhatASetDoesNotKnowAndLooksTheSameStandsBeside) {
  using Names = std::vector<std::string>;
  const auto beside = [](std::string_view fault, double strength,
                         const Names& known, Layer layer = Layer::kObservers) {
    return LookAlikesBeside(fault, layer, strength, known);
  };
  const Names paper{"f1", "f3", "f6", "f7", "f19"};
  EXPECT_EQ(beside("f6", 0.9, paper), Names{"f18"});
  EXPECT_EQ(beside("f6", 0.9, paper, Layer::kPhysics), Names());
  EXPECT_EQ(beside("f6", 0.9, {"f6", "f18"}), Names());
  EXPECT_EQ(beside("f6", 0.9, {}), Names());
  EXPECT_EQ(beside("f3|f6", 0.9, paper), Names());
  // A little more than an external leak may take, and the other sign.
  EXPECT_EQ(beside("f19", 0.05, paper), Names{"f5"});
  EXPECT_EQ(beside("f19", 0.07, paper), Names());
  EXPECT_EQ(beside("f19", -0.05, paper), Names());
  EXPECT_EQ(beside("f1", 0.9, paper), Names());
  // A sign that the set was not taught: a flow reading that is too low.
  EXPECT_EQ(beside("f2", 0.5, {"f2", "f5", "f19-"}), Names{"f19"});
  EXPECT_EQ(beside("f2", 0.5, {"f2", "f5", "f19+"}), Names());
  EXPECT_EQ(beside("f2", 0.5, {"f2", "f5", "f19"}), Names());
  EXPECT_EQ(beside("f2", 0.05, {"f2", "f19-"}), (Names{"f5", "f19"}));
  EXPECT_EQ(beside("f11", 0.5, {"f11", "f12-"}), Names{"f12"});
  EXPECT_EQ(WithLookAlikes(Certainty::kSure, {"f18"}), Certainty::kOneOf);
  EXPECT_EQ(WithLookAlikes(Certainty::kNotYet, {}), Certainty::kNotYet);
}

TEST(CertaintyTest, ARodThatDoesNotAnswerContradictsWhatLeavesItAlone) {
  using enum Certainty;
  EXPECT_EQ(WithAudit(kSure, "f7", "no_response"), kOneOf);
  EXPECT_EQ(WithAudit(kLikely, "f19", "stiction"), kOneOf);
  EXPECT_EQ(WithAudit(kLikely, "f6|f18", "stiction"), kOneOf);
  EXPECT_EQ(WithAudit(kSure, "f1", "no_response"), kSure);
  EXPECT_EQ(WithAudit(kSure, "f4", "stiction"), kSure);
  EXPECT_EQ(WithAudit(kSure, "f7", "oscillation_tuning"), kSure);
  EXPECT_EQ(WithAudit(kSure, "f7", ""), kSure);
  EXPECT_EQ(WithAudit(kNotYet, "", "no_response"), kNotYet);
}

TEST(CertaintyTest, AKnownFaultHasTheSignOfItsObserversIfThatIsOneOfTwo) {
  const std::vector<int> faults{2, 4, 12, 19, 201};
  const std::vector<Observer> observers{
      {"normal", 0, 0.0, {}},    {"f2 0.50", 2, 0.5, {}},
      {"f4 0.50", 4, 0.5, {}},   {"f12 -0.50", 12, -0.5, {}},
      {"f12 0.50", 12, 0.5, {}}, {"f19 -0.50", 19, -0.5, {}}};
  EXPECT_EQ(KnownFaults(faults, observers),
            (std::vector<std::string>{"f2", "f4", "f12", "f19-",
                                      "travel_deviation"}));
}

TEST(CertaintyTest, AnEventKnowsTheFaultsOfItsSet) {
  auto models = std::make_shared<ModelSet>();
  models->faults = {3, 6};
  FaultEvent event;
  event.transition.kind = TransitionKind::kIsolated;
  event.transition.factor = 1.0;
  event.transition.strength = 0.4;
  event.candidates = {{6, 1.0, 0.4, true}};
  EXPECT_EQ(CertaintyOf(event), Certainty::kSure);
  event.models = models;
  EXPECT_EQ(CertaintyOf(event), Certainty::kOneOf);
  EXPECT_EQ(LookAlikesOf(event), std::vector<std::string>{"f18"});
  models->faults = {2, 5, 19};
  models->observers = {{"f19 -0.50", 19, -0.5, {}}};
  event.candidates = {{2, 1.0, 0.4, true}};
  EXPECT_EQ(LookAlikesOf(event), std::vector<std::string>{"f19"});
}

TEST(CertaintyTest, OnTheBusTheCandidatesTellWhetherItIsTooEarly) {
  FaultEvent event;
  event.transition.kind = TransitionKind::kDetected;
  EXPECT_EQ(CertaintyOf(event), Certainty::kNotYet);
  event.transition.kind = TransitionKind::kReisolated;
  EXPECT_EQ(CertaintyOf(event), Certainty::kNotKnown);
  event.candidates = {{3, 0.5, 0.1, false}};
  EXPECT_EQ(CertaintyOf(event), Certainty::kNotYet);
  event.candidates = {{19, 0.8, 0.1, true}, {3, 0.8, 0.1, true}};
  EXPECT_EQ(IsolatedFaults(event), "f19|f3");
  EXPECT_EQ(CertaintyOf(event), Certainty::kOneOf);
}

}  // namespace
}  // namespace fdi
