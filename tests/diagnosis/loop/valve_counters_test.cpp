#include "diagnosis/loop/valve_counters.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <random>

#include <gtest/gtest.h>

namespace fdi::loop {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
constexpr std::int64_t kHourMs = 3'600'000;

class ValveCountersTest : public testing::Test {
 protected:
  // `seconds` samples a second apart.
  void Run(int seconds, const std::function<double(int)>& cv,
           const std::function<double(double)>& valve) {
    for (int k = 0; k < seconds; ++k) {
      const double command = cv(k);
      counters_.Push({command, valve(command), 1.0, true}, counts_);
    }
  }
  double Of(Figure figure) const {
    return FigureOf(figure, counts_, kHourMs).value_or(kNone);
  }

  ValveCounters counters_;
  ValveCounts counts_;
};

// A triangle between 40 and 60 % at 0.1 %/s.
double CommandOfTriangle(int k) {
  const double phase = std::fmod(0.1 * k, 40.0);
  return 40.0 + (phase < 20.0 ? phase : 40.0 - phase);
}

std::function<double(double)> PlayOfWidth(double width, double start) {
  return [width, p = start](double cv) mutable {
    p = std::clamp(p, cv - 0.5 * width, cv + 0.5 * width);
    return p;
  };
}

TEST_F(ValveCountersTest, APlayHasItsWidthAsDeadBandAndAsErrorBand) {
  Run(4000, CommandOfTriangle, PlayOfWidth(1.5, 39.25));

  EXPECT_EQ(counts_.turns, 19);
  EXPECT_NEAR(Of(Figure::kDeadBand), 1.5, 1e-3);
  EXPECT_NEAR(Of(Figure::kErrorBand), 1.5, 5e-3);
  EXPECT_EQ(counts_.slips, 0);
  EXPECT_EQ(counts_.steps, 0);
}

// The noise of CV chose the samples in which it seemed to rise, of which X - CV
// is low because X does not follow noise: 3 to 7 % of error band in every loop.
TEST_F(ValveCountersTest, ANoisyCommandIsNoRamp) {
  std::mt19937 random(1);
  std::normal_distribution<double> noise(0.0, 3.0);
  double x = 50.0;
  Run(
      4000,
      [&](int k) { return 50.0 + 10.0 * std::sin(0.005 * k) + noise(random); },
      [&](double cv) { return x += 0.3 * (cv - x); });

  EXPECT_EQ(counts_.opening + counts_.closing, 0);
  EXPECT_TRUE(std::isnan(Of(Figure::kErrorBand)));
}

TEST_F(ValveCountersTest, AValveThatFollowsHasNeither) {
  std::mt19937 random(1);
  std::normal_distribution<double> noise(0.0, 0.05);
  Run(4000, CommandOfTriangle, [&](double cv) { return cv + noise(random); });

  EXPECT_LT(Of(Figure::kDeadBand), 0.1);
  EXPECT_NEAR(Of(Figure::kErrorBand), 0.0, 0.02);
  EXPECT_EQ(counts_.slips, 0);
}

// Stuck until CV is 1.2 % off, then at once on CV: the jumps of stiction.
TEST_F(ValveCountersTest, ARodThatSticksAndLetsGoJumps) {
  Run(4000, CommandOfTriangle, [x = 40.0](double cv) mutable {
    if (std::abs(cv - x) >= 1.2 - 1e-9) {
      x = cv;
    }
    return x;
  });

  EXPECT_NEAR(static_cast<double>(counts_.slips), 400.0 / 1.2, 25.0);
  EXPECT_NEAR(Of(Figure::kSlipJump), 1.2, 1e-3);
}

// Among many samples some stand by chance, and the next one is elsewhere.
TEST_F(ValveCountersTest, NoiseOfXIsNoSlip) {
  std::mt19937 random(1);
  std::normal_distribution<double> noise(0.0, 0.7);
  Run(4000, CommandOfTriangle, [&](double cv) { return cv + noise(random); });

  EXPECT_EQ(counts_.slips, 0);
}

TEST_F(ValveCountersTest, TravelWithoutADeadBandCountsAllThatXMoves) {
  for (const double x : {50.0, 50.4, 49.7, 50.1}) {
    counters_.Push({50.0, x, 1.0, true}, counts_);
  }
  EXPECT_EQ(counts_.path, 400 + 700 + 400);
}

TEST_F(ValveCountersTest, WithoutXTheTravelIsThatOfCvAndNothingElseIsTold) {
  Run(4000, CommandOfTriangle, [](double) { return kNone; });

  EXPECT_NEAR(static_cast<double>(counts_.path) * ValveCounts::kQuantum, 399.9,
              1e-6);
  for (const Figure figure : {Figure::kSlipJump, Figure::kDeadBand,
                              Figure::kErrorBand, Figure::kT63}) {
    EXPECT_FALSE(FigureOf(figure, counts_, kHourMs)) << FigureName(figure);
  }
}

TEST_F(ValveCountersTest, TimeInAutomaticAndWithCvAtAnEnd) {
  const auto push = [this](double cv, bool automatic) {
    counters_.Push({cv, kNone, 2.0, automatic}, counts_);
  };
  push(0.5, true);
  push(0.6, false);
  push(99.5, true);
  push(kNone, false);

  EXPECT_EQ(counts_.auto_ms, 4000);
  EXPECT_EQ(counts_.limit_ms, 4000);
  EXPECT_NEAR(*FigureOf(Figure::kAtLimit, counts_, 8000), 50.0, 1e-9);
  EXPECT_FALSE(FigureOf(Figure::kAtLimit, ValveCounts{}, 0));
}

// A first-order rod with T = 4 s and gain 0.95 behind 3 s of dead time.
TEST_F(ValveCountersTest, AStepTellsItsTimesItsOvershootAndItsGain) {
  double x = 40.0;
  for (int k = 0; k < 100; ++k) {
    const double end = 40.0 + 9.5;
    x = k < 23 ? 40.0 : end - 9.5 * std::exp(-(k - 23) / 4.0);
    counters_.Push({k < 20 ? 40.0 : 50.0, x, 1.0, true}, counts_);
  }

  ASSERT_EQ(counts_.steps, 1);
  EXPECT_NEAR(Of(Figure::kDelay), 3.0, 0.15);
  EXPECT_NEAR(Of(Figure::kT63), 3.0 + 4.0, 0.1);
  EXPECT_NEAR(Of(Figure::kT86), 3.0 + 8.0, 0.1);
  EXPECT_NEAR(Of(Figure::kOvershoot), 0.0, 0.01);
  EXPECT_NEAR(Of(Figure::kTravelGain), 0.95, 2e-3);
}

TEST_F(ValveCountersTest, OvershootIsOfTheRealisedStep) {
  for (int k = 0; k < 60; ++k) {
    const double x = k < 20 ? 60.0 : k < 22 ? 48.5 : 50.0;
    counters_.Push({k < 20 ? 60.0 : 50.0, x, 1.0, true}, counts_);
    if (k == 40) {  // Over before CV goes elsewhere.
      EXPECT_EQ(counts_.steps, 0);
    }
  }
  counters_.Push({70.0, 50.0, 1.0, true}, counts_);

  ASSERT_EQ(counts_.steps, 1);
  EXPECT_NEAR(Of(Figure::kOvershoot), 15.0, 0.01);
}

TEST_F(ValveCountersTest, NoStepIfCvDoesNotStayOrXDoesNotFollow) {
  const auto run = [this](const std::function<double(int)>& cv,
                          const std::function<double(int)>& x) {
    for (int k = 0; k < 120; ++k) {
      counters_.Push({cv(k), x(k), 1.0, true}, counts_);
    }
    counters_.Restart();
  };
  // Moves on after 5 s; had not stood before; does not move the rod.
  run([](int k) { return k < 20 ? 40.0 : 50.0 + (k - 20) / 5; },
      [](int k) { return k < 20 ? 40.0 : 50.0; });
  run([](int k) { return k % 5 == 0 ? 45.0 : 40.0; }, [](int) { return 40.0; });
  run([](int k) { return k < 20 ? 40.0 : 50.0; }, [](int) { return 40.0; });

  EXPECT_EQ(counts_.steps, 0);
}

TEST_F(ValveCountersTest, ARestartComparesNothingWithWhatWasBefore) {
  counters_.Push({20.0, 20.0, 1.0, true}, counts_);
  counters_.Restart();
  counters_.Push({80.0, 80.0, 1.0, true}, counts_);

  EXPECT_EQ(counts_.path, 0);
  EXPECT_EQ(counts_.slips, 0);
}

// Neither is a reading that was lost: X is there again somewhere else.
TEST_F(ValveCountersTest, AReadingThatIsMissingBreaksTheComparison) {
  for (const double x : {20.0, 20.0, kNone, 80.0, 80.0}) {
    counters_.Push({50.0, x, 1.0, true}, counts_);
  }
  EXPECT_EQ(counts_.slips, 0);
  EXPECT_EQ(counts_.path, 0);
}

TEST(ValveCountsTest, PartsAddUp) {
  ValveCounts a;
  std::int64_t number = 1;
  for (const auto count : kValveCounts) {
    a.*count = number++;
  }
  ValveCounts sum = a;
  sum.Add(a);
  number = 1;
  for (const auto count : kValveCounts) {
    EXPECT_EQ(sum.*count, 2 * number++);
  }
}

}  // namespace
}  // namespace fdi::loop
