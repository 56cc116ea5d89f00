#include "trainer/calibration.h"

#include <cmath>
#include <stdexcept>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "diagnosis/observers/residual_windows.h"
#include "tests/trainer/gaussian.h"
#include "trainer/statistics.h"

namespace fdi::trainer {
namespace {

TEST(FiguresTest, VafIsBlindToAnOffsetThatBiasAndMseShow) {
  const std::vector<double> outputs{1.0, 2.0, 3.0, 4.0};
  const std::vector<double> residuals{2.0, 2.0, 2.0, 2.0};
  const ValidationFigures figures = Figures(residuals, outputs);
  EXPECT_DOUBLE_EQ(figures.vaf, 100.0);
  EXPECT_DOUBLE_EQ(figures.bias, 2.0);
  EXPECT_DOUBLE_EQ(figures.mse, 4.0);
  EXPECT_EQ(figures.samples, 4);
}

TEST(FiguresTest, PredictingTheMeanAccountsForNothing) {
  const std::vector<double> outputs{1.0, 2.0, 3.0};
  const std::vector<double> residuals{-1.0, 0.0, 1.0};
  EXPECT_DOUBLE_EQ(Figures(residuals, outputs).vaf, 0.0);
}

TEST(MembershipTest, AcceptsItsOwnResidualsAndHoldsZeroInTheCore) {
  std::vector<double> residuals = GaussianSeries(2000, 1);
  for (double& r : residuals) {
    r += 3.0;
  }
  const Trapezoid membership = FitMembership(residuals);
  EXPECT_EQ(membership(0.0), 1.0);
  double accepted = 0.0;
  for (const double r : residuals) {
    accepted += membership(r) >= 0.7 ? 1.0 : 0.0;
  }
  EXPECT_GT(accepted / 2000.0, 0.98);
  EXPECT_EQ(membership(3.0 + 6.0), 0.0);
  EXPECT_EQ(membership(-3.0), 0.0);
}

TEST(CorrelationTimeTest, MatchesAnAutoregressiveSeries) {
  // x(k+1) = a x(k) + e: τ = (1 + a)/(1 − a).
  const std::vector<double> noise = GaussianSeries(100000, 2);
  for (const double a : {0.0, 0.5, 0.8}) {
    std::vector<double> series(noise.size(), 0.0);
    for (std::size_t k = 1; k < series.size(); ++k) {
      series[k] = a * series[k - 1] + noise[k];
    }
    const double expected = (1.0 + a) / (1.0 - a);
    EXPECT_NEAR(CorrelationTime(series), expected, 0.12 * expected) << a;
  }
}

TEST(TailFitTest, ReachesTheGaussianQuantileWithoutBeingBelowIt) {
  // P(z > 4.75) = 1e-6; 50 000 values reach about 4.1.
  const std::vector<double> series = GaussianSeries(50000, 3);
  const TailThreshold tail = FitTail(series, 1e-6, 1);
  EXPECT_GT(tail.level, 4.6);
  EXPECT_LT(tail.level, 5.8);
}

TEST(TailFitTest, ReachesTheExponentialQuantile) {
  std::vector<double> series = GaussianSeries(50000, 4);
  for (double& value : series) {
    value = -std::log(0.5 * std::erfc(value / std::sqrt(2.0)));
  }
  // P(z > 13.8) = 1e-6; the scale is at its upper bound.
  const double level = FitTail(series, 1e-6, 1).level;
  EXPECT_GT(level, 13.5);
  EXPECT_LT(level, 17.0);
}

TEST(TailFitTest, LevelIsBeyondEverythingSeen) {
  std::vector<double> series = GaussianSeries(1000, 5);
  series[500] = 40.0;
  EXPECT_GT(FitTail(series, 1e-3, 1).level, 40.0);
}

TEST(TailFitTest, NeighbouringExceedancesAreOneCluster) {
  std::vector<double> series(1000, 0.0);
  for (std::size_t k = 0; k < 1000; k += 100) {
    series[k] = 1.0 + 0.001 * static_cast<double>(k);
    series[k + 1] = series[k];
    series[k + 2] = series[k];
    series[k + 3] = series[k];
    series[k + 4] = series[k];
  }
  EXPECT_EQ(FitTail(series, 1e-4, 5).clusters, 10);
}

TEST(TailFitTest, TooFewValuesAreRefused) {
  EXPECT_THROW(FitTail(GaussianSeries(99, 6), 1e-3, 1), std::invalid_argument);
}

// Records of ten blocks, and the day after, that wander by as much as the prior
// says; by three times that it is believed a little too long.
TEST(SlowAllowanceTest, AnotherDayStaysWithinItsShare) {
  constexpr int kRecords = 1000;
  constexpr std::size_t kBlock = 100;
  for (const double stray : {0.2, 0.6}) {
    const std::vector<double> noise =
        GaussianSeries(kRecords * 10 * kBlock, 21);
    const std::vector<double> days = GaussianSeries(kRecords * 11, 22);
    int beyond = 0;
    for (std::size_t i = 0; i < kRecords; ++i) {
      std::vector<double> record;
      for (std::size_t k = 0; k < 10 * kBlock; ++k) {
        record.push_back(stray * days[11 * i + k / kBlock] +
                         noise[10 * kBlock * i + k]);
      }
      const double day = stray * days[11 * i + 10];
      beyond += day > Mean(record) + SlowAllowance({record}, kBlock, 0.2, 0.01);
    }
    EXPECT_GT(beyond, 0) << stray;
    EXPECT_LT(beyond, stray == 0.2 ? 20 : 40) << stray;
  }
}

TEST(SlowAllowanceTest, NarrowsWithHours) {
  double last = 10.0;
  for (const int hours : {1, 3, 12, 48}) {
    const double now =
        SlowAllowance({GaussianSeries(3600 * hours, 23)}, 600, 0.2, 1e-3);
    EXPECT_LT(now, 0.8 * last) << hours;
    last = now;
  }
  EXPECT_LT(last, 0.2);
}

// Allowance for another day in the thresholds of a channel X with a window.
double Slow(const ResidualSeries& residuals) {
  return SlowAllowance(residuals, 600, 0.2, 24.0 * 1e-3 / 5.0);
}

TEST(ThresholdsTest, RatesAndRecordsWithoutATailAreNamed) {
  ModelSet models;
  models.channels = {{"X", Signal::kX, -1.0, 1.0}};
  const auto refusal = [&](std::size_t samples, double rate) -> std::string {
    try {
      FitThresholds({{GaussianSeries(samples, 7)}}, {{}}, rate, models);
    } catch (const std::runtime_error& error) {
      return error.what();
    }
    return "";
  };
  // 0.01 a sample of 1 s, for each of two sides.
  EXPECT_EQ(refusal(1000, 71.0), "");
  EXPECT_NE(refusal(1000, 73.0).find("accepted are up to 72"),
            std::string::npos);
  EXPECT_EQ(refusal(90, 1e-3).find("channel X: "), 0U);
}

TEST(ThresholdsTest, ConsecutiveSamplesAllowALowerThreshold) {
  ModelSet models;
  models.channels = {{"X", Signal::kX, -1.0, 1.0}};
  const std::vector<ResidualSeries> residuals{{GaussianSeries(30000, 7)}};
  models.decision.detection_samples = 1;
  FitThresholds(residuals, {{}}, 1e-3, models);
  const double single = models.channels[0].upper_threshold;
  models.decision.detection_samples = 2;
  FitThresholds(residuals, {{}}, 1e-3, models);
  // One in 1000 h over two sides: 1.4e-7 a sample is 5.1 alone, 3.4 in pairs.
  EXPECT_NEAR(single, 5.4, 0.7);
  EXPECT_NEAR(models.channels[0].upper_threshold, 3.7, 0.5);
  EXPECT_NEAR(models.channels[0].lower_threshold, -3.7, 0.5);
  EXPECT_NEAR(models.threshold_hours, 30000.0 / 3600.0, 1e-9);
}

// Mean and log-deviation of a window of N values of white noise of deviation 1
// scatter by 1/√(2N) each: EWMA of gain 1/N.
TEST(ThresholdsTest, WindowsAreLimitedWellWithinTheSamples) {
  ModelSet models;
  models.channels = {{"X", Signal::kX, -1.0, 1.0}};
  const std::vector<ResidualSeries> residuals{
      {GaussianSeries(60000, 8), GaussianSeries(60000, 9)}};
  FitThresholds(residuals, {{50}}, 1e-3, models);
  ASSERT_EQ(models.channels[0].windows.size(), 1U);
  const WindowLimits& window = models.channels[0].windows[0];
  EXPECT_EQ(window.length, 50);
  const double slow = Slow(residuals[0]);
  EXPECT_NEAR(window.upper_mean - slow, 0.55, 0.15);
  EXPECT_NEAR(window.lower_mean + slow, -0.55, 0.15);
  EXPECT_NEAR(window.upper_log_rms, 0.45, 0.2);
}

// The residual is a quarter of what the command does, and noise; activity
// changes every 300 samples.
TEST(ThresholdsTest, LimitOnEnergyIsConditionedOnTheActivityOfTheCommand) {
  const std::vector<double> noise = GaussianSeries(60000, 11);
  const std::vector<double> moves = GaussianSeries(60000, 12);
  std::vector<double> command;
  std::vector<double> residual;
  for (std::size_t k = 0; k < noise.size(); ++k) {
    command.push_back(60.0 + moves[k] * (k / 300 % 3 == 0 ? 8.0 : 4.0));
    residual.push_back(0.25 * (command[k] - 60.0) + 0.1 * noise[k]);
  }
  ModelSet models;
  models.channels = {{"X", Signal::kX, -1.0, 1.0}};
  FitThresholds({{residual}}, {{60}}, 1e-3, models, {{command}});
  const WindowLimits with = models.channels[0].windows[0];
  EXPECT_NEAR(with.activity_slope, 1.0, 0.05);
  EXPECT_NEAR(std::exp(with.log_activity), 4.0, 1.0);
  models.channels[0].windows.clear();
  FitThresholds({{residual}}, {{60}}, 1e-3, models);
  const WindowLimits without = models.channels[0].windows[0];
  EXPECT_EQ(without.activity_slope, 0.0);
  EXPECT_LT(with.upper_log_rms, without.upper_log_rms - 0.3);
  // Unlike any in training: more active, and as active with twice the
  // residual.
  const auto alarms = [&](double activity, double gain) {
    ResidualWindow window(60);
    ResidualWindow moved(60);
    bool beyond = false;
    for (std::size_t k = 0; k < 3000; ++k) {
      const double move = activity * moves[k];
      window.Push(gain * move + 0.1 * noise[k]);
      moved.Push(60.0 + move);
      beyond = beyond || IsBeyond(with, window, moved);
    }
    return beyond;
  };
  EXPECT_FALSE(alarms(8.0, 0.25));
  EXPECT_FALSE(alarms(13.0, 0.25));
  EXPECT_TRUE(alarms(8.0, 0.5));
}

TEST(ThresholdsTest, WindowsHoldWhereTheCommandStayedInTraining) {
  std::vector<double> command;
  for (int k = 0; k < 30000; ++k) {
    command.push_back(k < 15000 ? 50.0 : 60.0);
  }
  ModelSet models;
  models.channels = {{"X", Signal::kX, -1.0, 1.0}};
  FitThresholds({{GaussianSeries(30000, 14)}}, {{60}}, 1e-3, models,
                {{command}});
  const SignalRange held = models.channels[0].windows[0].command;
  EXPECT_NEAR(held.minimum, 45.0, 0.1);
  EXPECT_NEAR(held.maximum, 65.0, 0.1);
}

TEST(ThresholdsTest, MeansOfInputsHaveRoomForAnotherDay) {
  for (const Signal output : {Signal::kX, Signal::kP2}) {
    ModelSet models;
    models.channels = {{"c", output, -1.0, 1.0}};
    const ResidualSeries residuals{GaussianSeries(30000, 15)};
    FitThresholds({residuals}, {{60}}, 1e-3, models);
    EXPECT_NEAR(models.channels[0].windows[0].upper_mean,
                output == Signal::kX ? 0.55 + Slow(residuals) : 2.0, 0.15);
  }
}

TEST(ThresholdsTest, WindowsOfACommandAtRestHaveNoSlope) {
  ModelSet models;
  models.channels = {{"X", Signal::kX, -1.0, 1.0}};
  const std::vector<double> at_rest(30000, 60.0);
  FitThresholds({{GaussianSeries(30000, 13)}}, {{60}}, 1e-3, models,
                {{at_rest}});
  EXPECT_EQ(models.channels[0].windows[0].activity_slope, 0.0);
}

TEST(ThresholdsTest, WindowThatTheSeriesAreTooShortForGetsNoLimits) {
  ModelSet models;
  models.channels = {{"X", Signal::kX, -1.0, 1.0}};
  FitThresholds({{GaussianSeries(290, 10)}}, {{200}}, 1e-3, models);
  EXPECT_TRUE(models.channels[0].windows.empty());
}

// Four days of a sample a minute: what varies over hours is in the allowance
// for another day, and not once more in the limits on means.
// A few readings may hold the largest errors of one way alone.
TEST(ThresholdsTest, OfThinReadingsTheWiderIsThatOfBothSides) {
  for (const bool thin : {false, true}) {
    ModelSet models;
    models.channels = {{"F", Signal::kF, -1.0, 3.0}};
    models.observers.resize(1);
    models.observers[0].channels.resize(1);
    models.observers[0].channels[0].model.output = Signal::kF;
    const std::size_t samples = thin ? 1499 : 1500;
    BalanceThresholds({{GaussianSeries(samples, 3)}}, models);
    EXPECT_EQ(models.channels[0].lower_threshold, thin ? -3.0 : -1.0);
    EXPECT_EQ(models.channels[0].upper_threshold, 3.0);
  }
}

TEST(ThresholdsTest, WhatVariesSlowlyCountsOnce) {
  constexpr int kRows = 5760;
  const std::vector<double> white = GaussianSeries(kRows, 16);
  std::vector<double> residual;
  for (int k = 0; k < kRows; ++k) {
    residual.push_back(0.3 * white[static_cast<std::size_t>(k)] +
                       std::sin(2.0 * M_PI * k / 2400.0));
  }
  ModelSet models;
  models.sample_period_s = 60.0;
  models.channels = {{"F", Signal::kF, -1.0, 1.0}};
  const auto limit = [&] {
    models.channels[0].windows.clear();
    FitThresholds({{residual}}, {{200}}, 1e-3, models);
    return models.channels[0].windows.at(0).upper_mean;
  };
  const double slow = SlowAllowance({residual}, 600, 0.2, 24.0 * 1e-3 / 5.0);
  const double of_unknown = limit();
  Observer& normal = models.observers.emplace_back();
  normal.channels.resize(1);
  normal.channels[0].model.regressors = {{Signal::kCv, 0}};
  const double commanded = limit();
  EXPECT_GT(of_unknown, 3.5 + slow);
  EXPECT_LT(commanded, 3.0 + slow);
  EXPECT_GT(commanded, 1.3 + slow);  // Seen was 0.9, times 1.5.
}

// 25 minutes hold four windows of 200 s: their tail tells nothing, the noise
// of the samples does. An AR(1) of 0.9 has a correlation time of 19 samples;
// the limit on its mean is 1.25 z σ √(19/400) with z = 5.5 at this rate.
TEST(ThresholdsTest, ShortRecordsBoundWindowsByTheirCorrelation) {
  const std::vector<double> white = GaussianSeries(1500, 10);
  std::vector<double> slow(1, 0.0);
  for (const double e : white) {
    slow.push_back(0.9 * slow.back() + std::sqrt(1.0 - 0.81) * e);
  }
  ModelSet models;
  models.channels = {{"X", Signal::kX, -1.0, 1.0},
                     {"F", Signal::kF, -1.0, 1.0}};
  FitThresholds({{white}, {slow}}, {{200}, {200}}, 1e-3, models);
  ASSERT_EQ(models.channels[0].windows.size(), 1U);
  ASSERT_EQ(models.channels[1].windows.size(), 1U);
  const auto mean = [&](std::size_t c, const std::vector<double>& residuals) {
    // Ten tests share the rate.
    return models.channels[c].windows[0].upper_mean -
           SlowAllowance({residuals}, 600, 0.2, 24.0 * 1e-3 / 10.0);
  };
  EXPECT_NEAR(mean(0, white), 0.5, 0.1);
  EXPECT_NEAR(mean(1, slow), 1.5, 0.4);
  EXPECT_LT(models.channels[0].windows[0].upper_log_rms, std::log(2.0));
}

}  // namespace
}  // namespace fdi::trainer
