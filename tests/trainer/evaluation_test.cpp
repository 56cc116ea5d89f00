#include "trainer/evaluation.h"

#include <gtest/gtest.h>

#include "tests/trainer/indications.h"

namespace fdi::trainer {
namespace {

TEST(IndicesTest, NothingIndicatedMeansMinusOne) {
  const RunIndices r = ComputeIndices(Quiet());
  EXPECT_EQ(r.fault, 6);
  EXPECT_NEAR(r.strength, 0.3, 1e-12);
  EXPECT_FALSE(r.detected);
  for (const double index : {r.t_dt_first, r.t_dt, r.t_it}) {
    EXPECT_EQ(index, -1.0);
  }
  EXPECT_EQ(r.r_fd, 0.0);
  EXPECT_EQ(r.d_acc, 0.0);
}

TEST(IndicesTest, PermanentDetectionIsTheLastRisingEdge) {
  std::vector<Indication> all = Quiet();
  Detect(all, 710, 720);
  Detect(all, 800, 1000);
  Isolate(all, 805, 1000, {3, 6});
  const RunIndices r = ComputeIndices(all);
  EXPECT_TRUE(r.detected);
  EXPECT_EQ(r.t_dt_first, 10.0);
  EXPECT_EQ(r.t_dt, 100.0);
  EXPECT_EQ(r.t_it, 105.0);
  EXPECT_EQ(r.d_acc, 0.5);
  EXPECT_EQ(r.episodes, 2);
}

TEST(IndicesTest, OnlyTheTenMinutesBeforeTheFaultCountAsFalse) {
  std::vector<Indication> all = Quiet();
  Detect(all, 40, 100);   // before t_on = 100
  Detect(all, 400, 460);  // false
  const RunIndices r = ComputeIndices(all);
  EXPECT_NEAR(r.r_fd, 60.0 / 600.0, 1e-12);
  EXPECT_FALSE(r.detected);
}

TEST(IndicesTest, AlarmThatStandsBeforeTheFaultIsNoDetection) {
  std::vector<Indication> all = Quiet();
  Detect(all, 600, 1000);
  const RunIndices r = ComputeIndices(all);
  EXPECT_FALSE(r.detected);
  EXPECT_EQ(r.t_dt, -1.0);
}

TEST(IndicesTest, HorizonEndsTheZone) {
  std::vector<Indication> all = Quiet();
  Detect(all, 700, 900);
  EXPECT_FALSE(ComputeIndices(all).detected);
  EXPECT_TRUE(ComputeIndices(all, 850.0).detected);
}

TEST(IndicesTest, WrongSetsAreCountedAndTheLastOneDecides) {
  std::vector<Indication> all = Quiet();
  Detect(all, 700, 1000);
  Isolate(all, 720, 760, {3});
  Isolate(all, 760, 1000, {6});
  const RunIndices r = ComputeIndices(all);
  EXPECT_EQ(r.wrong_isolations, 1);
  EXPECT_EQ(r.d_acc, 1.0);
  EXPECT_EQ(r.final_set, std::vector<int>{6});
}

TEST(IndicesTest, AnAnswerIsAsCertainAsItWasWhenItWasNamed) {
  std::vector<Indication> all = Quiet();
  Detect(all, 700, 1000);
  Isolate(all, 720, 760, {3});
  Isolate(all, 760, 1000, {3, 6});
  for (std::size_t k = 0; k < all.size(); ++k) {
    all[k].wording.certainty = k < 720   ? Certainty::kNotYet
                               : k < 760 ? Certainty::kSure
                               : k < 900
                                   ? Certainty::kOneOf
                                   : Certainty::kLikely;  // The set stays.
  }
  EXPECT_EQ(ComputeIndices(all).wording.certainty, Certainty::kOneOf);
  Isolate(all, 700, 1000, {});
  for (Indication& indication : all) {
    indication.wording.certainty = Certainty::kNotKnown;
  }
  EXPECT_EQ(ComputeIndices(all).wording.certainty, Certainty::kNotKnown);
}

TEST(IndicesTest, RunWithoutFaultHasRatesButNoTimes) {
  std::vector<Indication> all = Quiet();
  for (Indication& indication : all) {
    indication.truth = {};
  }
  Detect(all, 100, 110);
  Detect(all, 500, 510);
  const RunIndices r = ComputeIndices(all);
  EXPECT_EQ(r.fault, 0);
  EXPECT_NEAR(r.r_fd, 20.0 / 970.0, 1e-12);
  for (const double index : {r.t_dt_first, r.t_dt, r.t_it, r.d_acc}) {
    EXPECT_EQ(index, -1.0);
  }
  EXPECT_FALSE(r.detected);
  EXPECT_EQ(r.episodes, 2);
}

TEST(IndicesTest, NeverDetectedHasNoTimesWhateverWasSaidBeforeTheFault) {
  std::vector<Indication> all = Quiet();
  Detect(all, 400, 460);  // Only before the fault.
  Isolate(all, 430, 460, {6});
  const RunIndices r = ComputeIndices(all);
  EXPECT_FALSE(r.detected);
  for (const double index : {r.t_dt_first, r.t_dt, r.t_it}) {
    EXPECT_EQ(index, -1.0);
  }
  EXPECT_GT(r.r_fd, 0.0);
  EXPECT_EQ(r.d_acc, 0.0);
  EXPECT_TRUE(r.final_set.empty());
}

TEST(IndicesTest, DetectionThatIsOverAtTheHorizonKeepsItsTimes) {
  std::vector<Indication> all = Quiet();
  Detect(all, 720, 900);
  const RunIndices r = ComputeIndices(all);
  EXPECT_FALSE(r.detected);
  EXPECT_EQ(r.t_dt_first, 20.0);
  EXPECT_EQ(r.t_dt, 20.0);
}

TEST(IndicesTest, SetWithoutTheFaultIsDetectedButNeverIsolated) {
  std::vector<Indication> all = Quiet();
  Detect(all, 720, 1000);
  Isolate(all, 740, 1000, {3, 18});
  const RunIndices r = ComputeIndices(all);
  EXPECT_TRUE(r.detected);
  EXPECT_EQ(r.t_it, -1.0);
  EXPECT_EQ(r.d_acc, 0.0);
  EXPECT_EQ(r.wrong_isolations, 0);  // Only sets of one fault count.
  EXPECT_EQ(r.final_set, (std::vector<int>{3, 18}));
}

TEST(IndicesTest, IsolationHasAFirstAndAPermanentTimeToo) {
  std::vector<Indication> all = Quiet();
  Detect(all, 710, 1000);
  Isolate(all, 730, 760, {6});
  Isolate(all, 760, 840, {3});
  Isolate(all, 840, 1000, {3, 6});
  const RunIndices r = ComputeIndices(all);
  EXPECT_EQ(r.t_it, 140.0);
  EXPECT_EQ(r.wrong_isolations, 1);
  EXPECT_EQ(r.d_acc, 0.5);
}

TEST(IndicesTest, WhatHappensBehindTheHorizonDoesNotCount) {
  std::vector<Indication> all = Quiet();
  Detect(all, 720, 760);
  Detect(all, 860, 1000);  // Behind the horizon,
  Isolate(all, 880, 1000, {6});
  const RunIndices r = ComputeIndices(all, 850.0);
  EXPECT_FALSE(r.detected);
  EXPECT_EQ(r.t_dt, 20.0);
  EXPECT_EQ(r.t_it, -1.0);
  EXPECT_EQ(r.d_acc, 0.0);
  EXPECT_EQ(r.episodes, 2);  // of the whole run
}

TEST(IndicesTest, FaultFromTheFirstSampleLeavesNothingToBeFalse) {
  std::vector<Indication> all = Quiet();
  for (Indication& indication : all) {
    indication.truth = {6, 0.5};
  }
  Detect(all, 40, 1000);
  const RunIndices r = ComputeIndices(all);
  EXPECT_EQ(r.r_fd, -1.0);
  EXPECT_EQ(r.t_dt, 40.0);
  EXPECT_TRUE(r.detected);
}

TEST(IndicesTest, RunThatNeverSettlesHasNoRates) {
  std::vector<Indication> all = Quiet();
  for (Indication& indication : all) {
    indication.settled = false;
    indication.truth = {};
  }
  const RunIndices r = ComputeIndices(all);
  EXPECT_EQ(r.r_fd, -1.0);
  EXPECT_EQ(ComputeIndices({}).r_fd, -1.0);
}

}  // namespace
}  // namespace fdi::trainer
