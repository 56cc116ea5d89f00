#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "tests/diagnosis/linear_plant.h"
#include "trainer/observer_calibration.h"

namespace fdi::trainer {
namespace {

constexpr double kLimit = 8.0;

// 500 samples of the linear plant with what `observer` knows, the first
// `trained` of them for training.
Condition ConditionOf(const Observer& observer, std::uint64_t trained) {
  Condition condition;
  condition.fault = observer.fault;
  condition.strength = observer.strength;
  if (trained > 0) {
    condition.training.emplace_back();
  }
  condition.validation.emplace_back();
  for (std::uint64_t k = 0; k < 500; ++k) {
    Sample sample = tests::PlantSample(k);
    if (observer.fault == 6) {
      tests::AddF6(sample, observer.strength);
    } else if (observer.fault == 3) {
      tests::AddF3(sample, observer.strength);
    } else if (observer.fault == 1) {
      sample.values[Index(Signal::kX)] -= 20.0 * observer.strength;
    }
    (k < trained ? condition.training : condition.validation)
        .front()
        .samples.push_back(sample);
  }
  return condition;
}

class DriftLimitsTest : public ::testing::TestWithParam<std::uint64_t> {};

// At full strength f1 takes 20 from X, f3 and f6 add 20 to F: 12 beyond a limit
// of 8. Nothing lowers F or raises X.
TEST_P(DriftLimitsTest, HalfOfWhatAFaultPassesItsLimitByIsLeft) {
  ModelSet models = tests::LinearPlant();
  std::vector<Condition> conditions;
  for (const Observer& observer : models.observers) {
    conditions.push_back(ConditionOf(observer, GetParam()));
  }
  models.channels.push_back({"no windows", Signal::kF, -1.0, 1.0});
  for (Observer& observer : models.observers) {
    observer.channels.push_back(observer.channels[1]);
  }
  for (std::size_t c = 0; c < 2; ++c) {
    models.channels[c].windows = {{30, -0.1, 0.1, 0.0},
                                  {80, -kLimit, kLimit, std::log(10.0)}};
  }

  FitDriftLimits(conditions, models);

  const DriftLimits& x = models.channels[0].drift;
  EXPECT_NEAR(x.lower_mean, -6.0, 0.01);
  EXPECT_DOUBLE_EQ(x.upper_mean, 3.0 * kLimit);
  EXPECT_DOUBLE_EQ(x.log_scale, std::log(3.0));
  const DriftLimits& f = models.channels[1].drift;
  EXPECT_DOUBLE_EQ(f.lower_mean, -3.0 * kLimit);
  EXPECT_NEAR(f.upper_mean, 6.0, 0.2);
  EXPECT_EQ(models.channels[2].drift, DriftLimits{});
}

// Trained on recordings of faults, and on faults put onto healthy data.
INSTANTIATE_TEST_SUITE_P(Trained, DriftLimitsTest, ::testing::Values(350, 0));

}  // namespace
}  // namespace fdi::trainer
