#include "diagnosis/records/certainty.h"

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
