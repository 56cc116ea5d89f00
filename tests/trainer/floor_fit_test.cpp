#include "trainer/floor_fit.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "diagnosis/decision/floor.h"
#include "tests/trainer/gaussian.h"

namespace fdi::trainer {
namespace {

// A rod that closes at 8 %/s and opens at 3 %/s, a second after its command,
// and F = 2 exp(-3 X) sqrt(dP) with noise of 3 %.
Condition Healthy(double opening, bool flow = true) {
  const std::vector<double> noise = GaussianSeries(6000, 31);
  Stretch stretch{"r", {}};
  double x = 60.0;
  double cv = 60.0;
  for (std::size_t k = 0; k < 3000; ++k) {
    x = NextRodPosition({0.8, cv > x ? 8.0 : opening}, x, cv);
    cv = std::clamp(60.0 + 15.0 * std::sin(0.02 * static_cast<double>(k)) +
                        5.0 * noise[2 * k],
                    0.0, 100.0);
    Sample sample;
    sample.stamp_ns = static_cast<std::int64_t>(k + 1) * 1'000'000'000;
    sample.Set(Signal::kCv, cv);
    sample.Set(Signal::kX, x);
    sample.Set(Signal::kP1, 3500.0);
    sample.Set(Signal::kP2, 2600.0);
    if (flow) {
      sample.Set(Signal::kF,
                 60.0 * std::exp(-0.03 * x) * (1.0 + 0.03 * noise[2 * k + 1]));
    }
    stretch.samples.push_back(sample);
  }
  Condition normal;
  normal.training = {stretch};
  normal.validation = {{"r", {}}};
  return normal;
}

TEST(FloorFitTest, FindsTheAnswersOfTheRodAndTheLawOfTheFlow) {
  const auto floor = FitFloor(Healthy(3.0), 1.0);
  ASSERT_TRUE(floor.has_value());
  EXPECT_EQ(floor->delay, 1);
  EXPECT_GE(floor->quick.rate, 8.0);
  EXPECT_LE(floor->slow.rate, 1.5);
  EXPECT_GE(floor->slow.rate, 1.0);
  EXPECT_EQ(floor->deviation, 8.0);
  EXPECT_EQ(floor->deviation_samples, 5);
  EXPECT_NEAR(floor->flow_exponent, 3.0, 0.1);
  EXPECT_NEAR(FlowAt(*floor, 60.0, 900.0), 60.0 * std::exp(-1.8), 0.2);
  EXPECT_EQ(floor->flow_factor, 1.5);
}

// F = 60 (1 - X) at 900 kPa: a linear trim, which no exponential follows.
TEST(FloorFitTest, TakesTheTrimThatItIsGiven) {
  Condition normal = Healthy(3.0);
  for (Sample& sample : normal.training.front().samples) {
    const double x = 0.01 * sample[Signal::kX];
    sample.Set(Signal::kF, sample[Signal::kF] * std::exp(3.0 * x) * (1.0 - x));
  }
  std::vector<double> shape;
  for (int i = 0; i <= 20; ++i) {
    shape.push_back(1.0 - 0.05 * i);
  }
  const auto floor = FitFloor(normal, 1.0, shape);
  EXPECT_EQ(floor->flow_shape, shape);
  EXPECT_EQ(floor->flow_exponent, 0.0);
  for (const double x : {0.0, 12.0, 50.0, 97.0}) {
    EXPECT_NEAR(FlowAt(*floor, x, 900.0), 60.0 - 0.6 * x, 0.2);
  }
  EXPECT_EQ(FlowAt(*floor, 105.0, 900.0), 0.0);
  EXPECT_GT(std::abs(FlowAt(*FitFloor(normal, 1.0), 97.0, 900.0) - 1.8), 1.0);
}

TEST(FloorFitTest, TimesAreSecondsWhateverThePeriod) {
  EXPECT_EQ(FitFloor(Healthy(3.0), 0.5)->deviation_samples, 10);
  EXPECT_EQ(FitFloor(Healthy(3.0), 10.0)->deviation_samples, 2);
}

TEST(FloorFitTest, WithoutAPositionTheFlowIsThatOfTheCommand) {
  Condition normal = Healthy(3.0);
  for (Sample& sample : normal.training.front().samples) {
    sample.present =
        static_cast<SignalMask>(sample.present & ~MaskOf(Signal::kX));
    sample.Set(Signal::kF, 60.0 * std::exp(-0.03 * sample[Signal::kCv]));
    sample.values[Index(Signal::kX)] = 0.0;
  }
  const auto floor = FitFloor(normal, 1.0);
  ASSERT_TRUE(floor.has_value());
  EXPECT_NEAR(floor->flow_exponent, 3.0, 0.1);
  EXPECT_EQ(floor->quick.rate, 100.0);
  EXPECT_LE(floor->slow.rate, 1.0);
  FloorLimits wider = *floor;
  WidenFloor(normal.training, wider);
  EXPECT_EQ(wider, *floor);
}

// Polled every half a minute, the rod travels far without a reading.
TEST(FloorFitTest, SilenceIsAsLongAsInTheRecord) {
  Condition normal = Healthy(3.0);
  double x = 0.0;
  int k = 0;
  for (Sample& sample : normal.training.front().samples) {
    const bool poll = k++ % 30 == 0;
    x = poll ? sample[Signal::kX] : x;
    sample.Set(Signal::kX, x);
    sample.quality[Index(Signal::kX)] =
        poll ? SignalQuality::kGood : SignalQuality::kUncertain;
  }
  EXPECT_EQ(FitFloor(Healthy(3.0), 1.0)->stuck_travel, 5.0);
  EXPECT_GT(FitFloor(normal, 1.0)->stuck_travel, 15.0);
}

TEST(FloorFitTest, NoFlowNoLimitOnIt) {
  EXPECT_EQ(FitFloor(Healthy(3.0, false), 1.0)->flow_gain, 0.0);
}

}  // namespace
}  // namespace fdi::trainer
