#include "trainer/dataset.h"

#include <functional>
#include <optional>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"

namespace fdi::trainer {
namespace {

using TruthAt = std::function<std::optional<FaultTruth>(int)>;

TrainingRun MakeRun(const std::string& id, int count, const TruthAt& truth) {
  TrainingRun run;
  run.id = id;
  for (int k = 0; k < count; ++k) {
    LabelledSample labelled;
    labelled.sample.stamp_ns = std::int64_t{k} * 1'000'000'000;
    labelled.sample.Set(Signal::kCv, k);
    labelled.sample.Set(Signal::kX, k);
    labelled.truth = truth(k);
    run.samples.push_back(labelled);
  }
  return run;
}

TruthAt Normal() {
  return [](int) { return FaultTruth{}; };
}

// CV of the samples of a stretch is the index in the run.
int FirstIndex(const Stretch& stretch) {
  return static_cast<int>(stretch.samples.front()[Signal::kCv]);
}

int LastIndex(const Stretch& stretch) {
  return static_cast<int>(stretch.samples.back()[Signal::kCv]);
}

TEST(DatasetTest, AbruptFaultIsCutWhereItBeginsAndTheStepIsLeftOut) {
  const auto conditions = BuildConditions({MakeRun("a", 400, [](int k) {
    return FaultTruth{19, k < 200 ? 0.0 : -0.5};
  })});
  ASSERT_EQ(conditions.size(), 2U);
  EXPECT_EQ(conditions[0].fault, 0);
  EXPECT_EQ(FirstIndex(conditions[0].training[0]), 20);
  EXPECT_EQ(LastIndex(conditions[0].validation[0]), 199);
  EXPECT_EQ(conditions[1].fault, 19);
  EXPECT_DOUBLE_EQ(conditions[1].strength, -0.5);
  EXPECT_EQ(FirstIndex(conditions[1].training[0]), 220);
  EXPECT_EQ(LastIndex(conditions[1].validation[0]), 399);
}

TEST(DatasetTest, GapsAndRepeatsCutARun) {
  TrainingRun run = MakeRun("a", 10, Normal());
  run.samples[4].sample.stamp_ns += 700'000'000;  // and back again
  const std::vector<Stretch> parts = SplitAtGaps(run);
  ASSERT_EQ(parts.size(), 3U);
  EXPECT_EQ(LastIndex(parts[0]), 3);
  EXPECT_EQ(FirstIndex(parts[1]), 4);
  EXPECT_EQ(FirstIndex(parts[2]), 5);
  EXPECT_EQ(LastIndex(parts[2]), 9);
}

TEST(DatasetTest, LastShareOfEveryStretchValidates) {
  const auto conditions = BuildConditions({MakeRun("a", 220, Normal())});
  EXPECT_EQ(CountSamples(conditions[0].training), 140);
  EXPECT_EQ(CountSamples(conditions[0].validation), 60);
  EXPECT_EQ(LastIndex(conditions[0].training[0]) + 1,
            FirstIndex(conditions[0].validation[0]));
}

TEST(DatasetTest, DevelopingFaultFallsIntoBandsOfItsFullStrength) {
  // 0 to 0.6 over 4000 samples, then constant.
  const auto conditions = BuildConditions({MakeRun("a", 5000, [](int k) {
    return FaultTruth{3, k < 200 ? 0.0 : std::min(0.6, (k - 200) * 0.00015)};
  })});
  // .03 and .06 of full strength .6 round to 0.05; 0.6 is its own condition.
  std::vector<double> strengths;
  for (const Condition& condition : conditions) {
    strengths.push_back(condition.strength);
  }
  ASSERT_EQ(strengths.size(), 7U);
  EXPECT_NEAR(strengths[1], 0.0525, 0.01);
  EXPECT_NEAR(strengths[2], 0.1275, 0.01);
  EXPECT_NEAR(strengths[6], 0.59, 0.015);
}

TEST(DatasetTest, StretchesDoNotCrossGapsOrRuns) {
  TrainingRun gap = MakeRun("a", 300, Normal());
  for (std::size_t k = 150; k < 300; ++k) {
    gap.samples[k].sample.stamp_ns += 5'000'000'000;
  }
  const auto conditions = BuildConditions({gap, MakeRun("b", 100, Normal())});
  ASSERT_EQ(conditions[0].training.size(), 3U);
  EXPECT_EQ(LastIndex(conditions[0].validation[0]), 149);
  EXPECT_EQ(conditions[0].training[2].run_id, "b");
}

TEST(DatasetTest, EqualConditionsOfSeveralRunsArePooled) {
  const auto fault = [](double s) {
    return [s](int k) { return FaultTruth{6, k < 100 ? 0.0 : s}; };
  };
  const auto conditions = BuildConditions({MakeRun("a", 300, fault(0.5)),
                                           MakeRun("b", 300, fault(0.51)),
                                           MakeRun("c", 300, fault(0.75))});
  ASSERT_EQ(conditions.size(), 3U);
  EXPECT_EQ(conditions[0].training.size(), 3U);
  EXPECT_EQ(conditions[1].training.size(), 2U);
  EXPECT_NEAR(conditions[1].strength, 0.505, 1e-12);
}

TEST(DatasetTest, RunWithoutTruthIsRefusedUnlessAssumedNormal) {
  const TrainingRun run =
      MakeRun("a1b2", 300, [](int) { return std::nullopt; });
  try {
    BuildConditions({run});
    FAIL();
  } catch (const DataError& error) {
    EXPECT_NE(std::string(error.what()).find("a1b2"), std::string::npos);
  }
  DatasetOptions options;
  options.assume_normal = true;
  EXPECT_EQ(BuildConditions({run}, options).size(), 1U);
}

TEST(DatasetTest, RunsThatDoNotBelongTogetherAreRefused) {
  const TrainingRun run = MakeRun("a", 300, Normal());
  TrainingRun other = run;
  other.period_s = 2.0;
  EXPECT_THROW(BuildConditions({run, other}), DataError);
  other = run;
  other.flow_unit = FlowUnit::kTPerHour;
  EXPECT_THROW(BuildConditions({run, other}), DataError);
  other = run;
  other.samples[0].sample.present = MaskOf(Signal::kCv);
  EXPECT_THROW(BuildConditions({run, other}), DataError);
}

TEST(DatasetTest, FaultRunsAloneAreRefused) {
  EXPECT_THROW(BuildConditions({MakeRun("a", 300,
                                        [](int) {
                                          return FaultTruth{6, 0.5};
                                        })}),
               DataError);
}

std::string Refusal(const std::vector<TrainingRun>& runs) {
  try {
    BuildConditions(runs);
  } catch (const DataError& error) {
    return error.what();
  }
  return "accepted";
}

TEST(DatasetTest, FaultWithoutEnoughSamplesIsRefusedByRunAndFault) {
  const auto late = MakeRun("b", 400, [](int k) {
    return FaultTruth{19, k < 360 ? 0.0 : 0.5};
  });
  EXPECT_THAT(
      Refusal({MakeRun("a", 400, Normal()), late}),
      testing::AllOf(testing::HasSubstr("run b"), testing::HasSubstr("f19"),
                     testing::HasSubstr("60 samples")));
}

TEST(DatasetTest, ConstantPositionIsRefusedUnlessAnotherRunMovesIt) {
  TrainingRun still = MakeRun("b", 400, Normal());
  for (LabelledSample& sample : still.samples) {
    sample.sample.Set(Signal::kX, 50.0);
  }
  EXPECT_THAT(Refusal({still}), testing::AllOf(testing::HasSubstr("run b"),
                                               testing::HasSubstr("signal X")));
  EXPECT_EQ(Refusal({MakeRun("a", 400, Normal()), still}), "accepted");
}

TEST(DatasetTest, PressureOfZerosIsRefusedASteadyOneIsNot) {
  TrainingRun run = MakeRun("b", 400, Normal());
  for (LabelledSample& sample : run.samples) {
    sample.sample.Set(Signal::kP1, 3500.0);
  }
  EXPECT_EQ(Refusal({run}), "accepted");
  for (LabelledSample& sample : run.samples) {
    sample.sample.Set(Signal::kP1, 0.0);
  }
  EXPECT_THAT(Refusal({run}), testing::AllOf(testing::HasSubstr("run b"),
                                             testing::HasSubstr("signal P1")));
}

}  // namespace
}  // namespace fdi::trainer
