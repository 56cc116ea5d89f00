#include "bench/study/studies.h"

#include <gtest/gtest.h>

namespace fdi::trainer::study {
namespace {

EvaluatedRun Ended(int fault, bool detected, std::vector<int> set,
                   double d_acc = 0.0) {
  EvaluatedRun run;
  run.indices.fault = fault;
  run.indices.detected = detected;
  run.indices.final_set = std::move(set);
  run.indices.d_acc = d_acc;
  run.indices.r_fd = 0.0;
  run.duration_s = 1800.0;
  return run;
}

TEST(LeaveOneOutTest, UnknownIsWhatWasDetectedAndNotNamed) {
  const LeftOutFault f6 = CountLeftOut(
      6, {6, 18},
      {Ended(6, true, {}), Ended(6, false, {}), Ended(6, true, {18}),
       Ended(6, true, {3, 18}), Ended(6, false, {3, 18})});
  EXPECT_EQ(f6.runs, 5);
  EXPECT_EQ(f6.detected, 3);
  EXPECT_EQ(f6.unknown, 1);
  EXPECT_EQ(f6.wrongly_named, 3);
  EXPECT_EQ(f6.as_look_alike, 1);
  EXPECT_EQ(f6.named.at({3, 18}), 2);
  EXPECT_EQ(SumOf({f6, f6}).wrongly_named, 6);
}

TEST(SeedStudyTest, CountsByFaultByRepetitionAndAltogether) {
  EvaluatedRun alarmed = Ended(0, false, {});
  alarmed.indices.episodes = 2;
  EvaluatedRun early = Ended(3, true, {3}, 1.0);
  early.indices.r_fd = 0.25;
  const SeedStudy study =
      StudySeeds({{Ended(3, true, {3, 6}, 0.5), Ended(6, false, {}), alarmed},
                  {early, Ended(6, true, {6}, 1.0), Ended(0, false, {})}});
  ASSERT_EQ(study.faults.size(), 2U);
  EXPECT_EQ(study.faults[0].fault, 3);
  EXPECT_EQ(study.faults[0].runs, 2);
  EXPECT_EQ(study.faults[0].contained, 2);
  EXPECT_EQ(study.faults[0].exact, 1);
  EXPECT_EQ(study.faults[1].detected, 1);
  EXPECT_EQ(study.total.runs, 4);
  EXPECT_EQ(study.total.exact, 2);
  ASSERT_EQ(study.repetitions.size(), 2U);
  EXPECT_EQ(study.repetitions[0].detected, 1);
  EXPECT_EQ(study.repetitions[1].detected, 2);
  EXPECT_EQ(study.max_r_fd, 0.25);
  EXPECT_EQ(study.runs_with_false_alarm, 1);
  EXPECT_EQ(study.fault_free_episodes, 2);
  EXPECT_DOUBLE_EQ(study.fault_free_hours, 1.0);
}

}  // namespace
}  // namespace fdi::trainer::study
