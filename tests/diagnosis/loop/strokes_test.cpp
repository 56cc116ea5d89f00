#include "diagnosis/loop/strokes.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <random>
#include <utility>

#include <gtest/gtest.h>

namespace fdi::loop {
namespace {

// A rod with a lag and friction that is moved by the pressure of a spring
// actuator, a sample a second: Ps leads X by `friction_kpa` in the direction
// in which it moves.
struct Rod {
  double lag_s{3.0};
  double friction_kpa{10.0};
  double spring{1.0};     // [kPa/%]
  double longest{100.0};  // X goes no farther [%].
};

StrokeRecord Moved(const std::vector<double>& cv, const Rod& rod) {
  StrokeRecord record;
  record.cv = cv;
  double x = cv.front();
  double way = 1.0;
  for (const double command : cv) {
    const double before = x;
    x += (std::min(command, rod.longest) - x) / (1.0 + rod.lag_s);
    way = std::abs(x - before) > 1e-6 ? std::copysign(1.0, x - before) : way;
    record.x.push_back(x);
    record.ps.push_back(40.0 + rod.spring * x + way * rod.friction_kpa);
  }
  return record;
}

// Levels of a minute each.
std::vector<double> Levels(std::initializer_list<double> levels) {
  std::vector<double> cv;
  for (const double level : levels) {
    cv.insert(cv.end(), 60, level);
  }
  return cv;
}

std::vector<double> Ramp(double from, double to, int samples) {
  std::vector<double> cv;
  for (int k = 1; k <= samples; ++k) {
    cv.push_back(from + (to - from) * k / samples);
  }
  return cv;
}

TEST(StrokesTest, APartialStrokeHasItsTimes) {
  const auto strokes = FindStrokes(Moved(Levels({50, 40, 50}), {}));

  ASSERT_EQ(strokes.size(), 1U);
  const Stroke& stroke = strokes[0];
  EXPECT_FALSE(stroke.full());
  EXPECT_NEAR(stroke.travel(), 10.0, 1e-9);
  EXPECT_EQ(stroke.rising.moves, 1);
  EXPECT_EQ(stroke.falling.moves, 1);
  // (3/4)^k: 63.2 % after 3.5 steps, of which the first is sample 0.
  EXPECT_NEAR(*stroke.falling.t63_s, 2.47, 0.1);
  EXPECT_NEAR(*stroke.falling.t86_s, 5.95, 0.1);
  EXPECT_NEAR(*stroke.falling.overshoot_pct, 0.0, 1e-3);
  EXPECT_FALSE(stroke.falling.breakaway_pct);
  EXPECT_FALSE(stroke.signature);  // Ten per cent are no signature.
}

TEST(StrokesTest, AFullStrokeHasTheSignatureOfItsActuator) {
  std::vector<double> cv(60, 0.0);
  for (const auto& part : {Ramp(0, 100, 100), std::vector<double>(30, 100.0),
                           Ramp(100, 0, 100), std::vector<double>(30, 0.0)}) {
    cv.insert(cv.end(), part.begin(), part.end());
  }
  StrokeRecord record =
      Moved(cv, {.lag_s = 1.0, .friction_kpa = 7.0, .spring = 1.2});
  EXPECT_TRUE(FindStrokes(record).empty());  // A ramp, perhaps in AUTO.

  record.automatic.assign(cv.size(), false);
  const auto strokes = FindStrokes(record);

  ASSERT_EQ(strokes.size(), 1U);
  EXPECT_TRUE(strokes[0].full());
  ASSERT_TRUE(strokes[0].signature);
  EXPECT_NEAR(strokes[0].signature->friction_kpa, 7.0, 0.05);
  EXPECT_NEAR(strokes[0].signature->spring_kpa_per_pct, 1.2, 0.01);
  EXPECT_NEAR(strokes[0].signature->at_0_kpa, 40.0, 0.5);
  EXPECT_NEAR(strokes[0].signature->at_100_kpa, 160.0, 0.5);
  // At 1 %/s, a lag of 1 s is 1 % behind at last; 0.5 % after 1 to 2 s.
  EXPECT_NEAR(*strokes[0].rising.breakaway_pct, 1.0, 1.0);
  EXPECT_FALSE(strokes[0].rising.t63_s);
}

TEST(StrokesTest, StepsThatDoNotComeBackAreATestOnlyOutsideAuto) {
  StrokeRecord record = Moved(Levels({50, 60, 70}), {});
  EXPECT_TRUE(FindStrokes(record).empty());
  record.automatic.assign(record.cv.size(), true);
  EXPECT_TRUE(FindStrokes(record).empty());

  record.automatic.assign(record.cv.size(), false);
  const auto strokes = FindStrokes(record);
  ASSERT_EQ(strokes.size(), 1U);
  EXPECT_EQ(strokes[0].rising.moves, 2);
}

TEST(StrokesTest, AControllerMakesNoTest) {
  std::mt19937 random(1);
  std::normal_distribution<double> noise(0.0, 0.3);
  std::vector<double> cv;
  for (int k = 0; k < 7200; ++k) {
    cv.push_back(50.0 + 20.0 * std::sin(0.01 * k) + noise(random));
  }
  EXPECT_TRUE(FindStrokes(Moved(cv, {})).empty());
}

TEST(StrokesTest, WhatIsWorseThanTheLastTimeIsSaid) {
  const std::vector<double> cv = Levels({0, 25, 50, 75, 100, 75, 50, 25, 0});
  const auto test = [&](const Rod& rod) {
    return FindStrokes(Moved(cv, rod)).at(0);
  };
  const Stroke last = test({});
  ASSERT_TRUE(AreAlike(last, test({.lag_s = 9.0})));
  EXPECT_FALSE(AreAlike(last, FindStrokes(Moved(Levels({50, 40, 50}), {}))[0]));

  EXPECT_TRUE(Worse(last, test({}), 1.0).empty());
  EXPECT_TRUE(Worse(last, test({.lag_s = 3.5}), 1.0).empty());
  const auto slow = Worse(last, test({.lag_s = 9.0}), 1.0);
  ASSERT_FALSE(slow.empty());
  EXPECT_EQ(slow[0].rfind("CV rising: T63 8.4 s after 2.5 s", 0), 0U)
      << slow[0];
  const auto rubs = Worse(last, test({.friction_kpa = 25.0}), 1.0);
  EXPECT_EQ(std::ranges::count(rubs, "friction 25.0 kPa after 10.0 kPa"), 1);
  const auto stuck = Worse(last, test({.longest = 60.0}), 1.0);
  EXPECT_EQ(
      std::ranges::count(stuck, "CV rising: X does not follow 1 of 4 moves"),
      1);
  EXPECT_EQ(std::ranges::count(stuck, "upper end of X at 60.0 % after 100.0 %"),
            1);
}

// The samples one by one.
std::vector<TimedStroke> Watched(const StrokeRecord& record,
                                 std::size_t max_samples, std::size_t& kept) {
  StrokeFinder finder(record.period_s, max_samples);
  std::vector<TimedStroke> found;
  for (std::size_t k = 0; k < record.cv.size(); ++k) {
    StrokeFinder::Reading reading{static_cast<std::int64_t>(k), record.cv[k],
                                  record.x[k]};
    reading.ps = record.ps.empty() ? reading.ps : record.ps[k];
    reading.automatic = record.automatic[k];
    finder.Push(reading, found);
    kept = std::max(kept, finder.kept());
  }
  finder.Finish(found);
  return found;
}

// Holds of all lengths, steps, ramps, noise of a controller and changes of mode
// in any order.
StrokeRecord AnyRecord(std::mt19937& random, double period_s) {
  const auto between = [&random](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  std::vector<double> cv{50.0};
  std::vector<bool> automatic{true};
  const double levels[] = {0.0, 40.0, 50.0, 53.0, 60.0, 100.0};
  bool mode = between(0, 1) < 0.5;
  while (cv.size() < 3000) {
    const auto samples = static_cast<int>(between(1, 400) * between(0, 1));
    const double to = levels[random() % 6];
    const double from = cv.back();
    const auto kind = random() % 8;
    for (int k = 1; k <= samples; ++k) {
      cv.push_back(kind == 0   ? from + (to - from) * k / samples
                   : kind == 1 ? from + between(-0.3, 0.3)
                   : kind == 2 ? from
                   : kind == 3 ? to + between(-0.06, 0.06)
                               : to);
      automatic.push_back(mode);
    }
    mode = between(0, 1) < 0.15 ? !mode : mode;
  }
  StrokeRecord record = Moved(cv, {.lag_s = 1.5});
  record.automatic = automatic;
  record.period_s = period_s;
  return record;
}

TEST(StrokeFinderTest, FindsSampleBySampleWhatTheWholeRecordHas) {
  std::mt19937 random(7);
  std::size_t tests = 0;
  std::size_t kept = 0;
  for (int i = 0; i < 200; ++i) {
    StrokeRecord record = AnyRecord(random, i % 3 == 0 ? 3.0 : 1.0);
    record.ps.resize(i % 2 == 0 ? record.ps.size() : 0);
    std::vector<Stroke> whole = FindStrokes(record);
    tests += whole.size();

    const auto found = Watched(record, record.cv.size(), kept);

    ASSERT_EQ(found.size(), whole.size()) << i;
    for (std::size_t k = 0; k < whole.size(); ++k) {
      EXPECT_EQ(found[k].start_ns, static_cast<std::int64_t>(whole[k].begin));
      // All of it was measured where Ps is: the signature is of the test alone.
      whole[k].end -= std::exchange(whole[k].begin, 0);
      EXPECT_EQ(found[k].stroke, whole[k]) << i << ": " << k;
    }
  }
  EXPECT_GT(tests, 200U);
}

TEST(StrokeFinderTest, KeepsLittleUnlessThereIsATest) {
  std::mt19937 random(8);
  std::normal_distribution<double> noise(0.0, 0.3);
  std::size_t kept = 0;
  for (const double sd : {0.0, 1.0}) {
    StrokeRecord record;
    for (int k = 0; k < 20'000; ++k) {
      record.cv.push_back(50.0 + 20.0 * std::sin(0.01 * k) * sd +
                          sd * noise(random));
      record.x.push_back(50.0);
      record.automatic.push_back(true);
    }
    Watched(record, 3600, kept);
  }
  EXPECT_LT(kept, 40U);
  // On and off for ever: the oldest part is told, and goes.
  std::vector<double> cv;
  for (int k = 0; k < 20'000; ++k) {
    cv.push_back(k / 60 % 2 == 0 ? 0.0 : 100.0);
  }
  StrokeRecord record = Moved(cv, {});
  record.automatic.assign(cv.size(), true);
  EXPECT_EQ(Watched(record, 3600, kept).size(), 6U);
  EXPECT_EQ(kept, 3600U);
}

}  // namespace
}  // namespace fdi::loop
