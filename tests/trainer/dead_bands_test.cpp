#include "trainer/dead_bands.h"

#include <cmath>

#include <gtest/gtest.h>

#include "diagnosis/model/model_set.h"
#include "tests/trainer/gaussian.h"

namespace fdi::trainer {
namespace {

// Each signal is told when it has changed by more than its dead band [%]. The
// flow is 60 exp(-3 X), of which 1 % of X changes 3 %.
Condition ToldOnChange(double of_cv, double of_x) {
  const std::vector<double> noise = GaussianSeries(12000, 5);
  Stretch stretch{"r", {}};
  double cv = 60.0;
  double x = 60.0;
  double at = 60.0;
  for (std::size_t k = 0; k < 6000; ++k) {
    at += 0.02 * (60.0 - at) + 0.2 * noise[2 * k];
    cv = std::abs(at - cv) > of_cv ? at : cv;
    const bool is_new = std::abs(at - x) > of_x;
    x = is_new ? at : x;
    Sample sample;
    sample.stamp_ns = static_cast<std::int64_t>(k + 1) * 1'000'000'000;
    sample.Set(Signal::kCv, cv);
    sample.Set(Signal::kX, x);
    sample.Set(Signal::kF, 60.0 * std::exp(-0.03 * x));
    sample.quality[Index(Signal::kX)] =
        is_new ? SignalQuality::kGood : SignalQuality::kUncertain;
    stretch.samples.push_back(sample);
  }
  Condition normal;
  normal.training = {stretch};
  normal.validation = {{"r", {}}};
  return normal;
}

ModelSet TightLimits(bool told) {
  ModelSet models;
  models.every.x = told ? ReadEvery::kOnChange : 0;
  FloorLimits& floor = models.floor.emplace();
  floor.flow_gain = 60.0;
  floor.flow_exponent = 3.0;
  floor.dp_level = 1.0;
  for (const Signal output : {Signal::kX, Signal::kF}) {
    models.channels.push_back(
        {"", output, -0.1, 0.1, {{30, -0.05, 0.05, -4.0}}});
  }
  return models;
}

TEST(DeadBandsTest, NoLimitIsWithinTheDeadBandOfWhatAModelReads) {
  ModelSet models = TightLimits(true);
  CoverDeadBands(ToldOnChange(0.5, 0.8), models);
  const ChannelSpec& x = models.channels[0];
  EXPECT_NEAR(x.upper_threshold, 0.53, 0.04);
  EXPECT_EQ(x.lower_threshold, -x.upper_threshold);
  EXPECT_EQ(x.windows[0].upper_mean, x.upper_threshold);
  EXPECT_EQ(x.windows[0].lower_mean, x.lower_threshold);
  EXPECT_NEAR(x.windows[0].upper_log_rms, std::log(x.upper_threshold), 1e-9);
  // 0.83 % of the rod at some 11 of 60.
  EXPECT_NEAR(models.channels[1].upper_threshold, 0.03 * 0.83 * 11.0, 0.04);
}

TEST(DeadBandsTest, WiderLimitsAndThoseOfWhatIsReadEachTimeStay) {
  for (const bool told : {false, true}) {
    ModelSet models = TightLimits(told);
    for (ChannelSpec& channel : models.channels) {
      channel.upper_threshold = told ? 2.0 : 0.1;
    }
    CoverDeadBands(ToldOnChange(0.5, 0.8), models);
    EXPECT_EQ(models.channels[0].upper_threshold, told ? 2.0 : 0.1);
    EXPECT_EQ(models.channels[0].lower_threshold < -0.1, told);
  }
}

// Whoever moves it by hand moves it by more.
TEST(DeadBandsTest, StepsOfTheCommandAreNoDeadBand) {
  ModelSet models = TightLimits(true);
  CoverDeadBands(ToldOnChange(1.5, 0.3), models);
  EXPECT_EQ(models.channels[0].upper_threshold, 1.0);
}

}  // namespace
}  // namespace fdi::trainer
