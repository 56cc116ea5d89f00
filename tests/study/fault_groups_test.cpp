#include "bench/study/fault_groups.h"

#include <gtest/gtest.h>

namespace fdi::trainer::study {
namespace {

EvaluatedRun Ended(int fault, std::vector<int> set, double d_acc) {
  EvaluatedRun run;
  run.indices.fault = fault;
  run.indices.detected = !set.empty();
  run.indices.final_set = std::move(set);
  run.indices.d_acc = d_acc;
  return run;
}

TEST(FaultGroupsTest, AccuracyIsTheMeanOverDetectedRuns) {
  EvaluatedRun early = Ended(6, {6}, 1.0);
  early.indices.r_fd = 0.25;
  const StudyFigures figures = StudyFiguresOf(
      {early, Ended(6, {3, 18}, 0.0), Ended(3, {}, 0.0), EvaluatedRun{}},
      {{6, 18}});
  EXPECT_DOUBLE_EQ(figures.mean_d_acc, 0.5);
  EXPECT_DOUBLE_EQ(figures.mean_d_acc_group, 0.75);
  EXPECT_EQ(figures.contained_group, 2);
  EXPECT_EQ(figures.exact_group, 1);
  EXPECT_EQ(figures.max_r_fd, 0.25);
}

TEST(FaultGroupsTest, RowsOfTheConfusionSumToTheirRuns) {
  const ConfusionMatrix matrix =
      BuildConfusion({Ended(6, {3, 6}, 0.5), Ended(6, {}, 0.0)});
  EXPECT_EQ(matrix.rows, (std::vector<FaultGroup>{{6}}));
  EXPECT_EQ(matrix.columns, (std::vector<FaultGroup>{{3}, {6}}));
  EXPECT_EQ(matrix.counts[0], (std::vector<double>{0.5, 0.5, 0.0, 1.0}));
}

}  // namespace
}  // namespace fdi::trainer::study
