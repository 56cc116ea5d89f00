#include "diagnosis/observers/fit_window.h"

#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "tests/diagnosis/engine_run.h"

namespace fdi {
namespace {

using tests::AddF6;
using tests::Noise;
using tests::Seen;
using tests::StepRange;

constexpr double kNoReading = std::numeric_limits<double>::quiet_NaN();
constexpr FitBounds kLimits{-1.0, 2.0, 4.0};

FitWindow Filled(const std::vector<double>& values, int length) {
  FitWindow window(length, 1);
  for (const double z : values) {
    window.Push({&z, 1});
  }
  return window;
}

TEST(FitWindowTest, MeanAndMeanSquareAreOfTheLastSamples) {
  const FitWindow window = Filled({9.0, 1.0, -1.0, 2.0, 2.0}, 4);
  EXPECT_TRUE(window.full());
  EXPECT_DOUBLE_EQ(window.mean(0), 1.0);
  EXPECT_DOUBLE_EQ(window.square(0), 2.5);
  // 2.5 of 4 is more than 1 of 2.
  EXPECT_DOUBLE_EQ(window.Excess(0, kLimits), 0.625);
  EXPECT_DOUBLE_EQ(Filled({-2.0, -2.0}, 2).Excess(0, kLimits), 2.0);
}

TEST(FitWindowTest, OutliersCountAsFive) {
  EXPECT_DOUBLE_EQ(Filled({-80.0, 5.0}, 2).mean(0), 0.0);
  EXPECT_DOUBLE_EQ(Filled({-80.0, 5.0}, 2).square(0), 25.0);
}

TEST(AccountedShareTest, TellsAnExplanationFromOneThatOnlyTolerates) {
  const auto share = [](double left) {
    AccountedShare account;
    for (int k = 0; k < 100; ++k) {
      const double noise = k % 2 == 0 ? 1.0 : -1.0;
      account.Push(12.0 + noise, left * 12.0 + noise);
    }
    EXPECT_TRUE(account.tells(20));
    return account.share();
  };
  EXPECT_NEAR(share(0.0), 1.0, 0.01);
  EXPECT_NEAR(share(0.5), 0.75, 0.01);
  EXPECT_NEAR(share(1.0), 0.0, 0.01);
  EXPECT_LT(share(-1.2), 0.0);  // the other sign

  AccountedShare healthy;
  AccountedShare few;
  for (int k = 0; k < 100; ++k) {
    healthy.Push(k % 2 == 0 ? 1.5 : -1.5, 0.0);
    if (k < 10) {
      few.Push(9.0, 9.0);
    }
  }
  EXPECT_FALSE(healthy.tells(20));
  EXPECT_FALSE(few.tells(20));
  // Old samples count no more.
  for (int k = 0; k < 400; ++k) {
    few.Fade(0.99);
    few.Push(9.0, 0.0);
  }
  EXPECT_GT(few.share(), 0.99);
}

TEST(FitWindowTest, AChannelThatSaysTooLittleIsNotJudged) {
  EXPECT_GT(Filled({kNoReading, 5.0, 5.0, kNoReading}, 4).Excess(0, kLimits),
            1.0);
  EXPECT_EQ(
      Filled({kNoReading, 5.0, kNoReading, kNoReading}, 4).Excess(0, kLimits),
      0.0);
  EXPECT_EQ(Filled({5.0, 5.0}, 2).Excess(0, {}), 0.0);
}

// f6 at 1, and the position 1.3 deviations up in the mean: within each
// single reading's membership, and not what f6 does.
void Strange(Sample& sample) {
  AddF6(sample, 1.0);
  sample.values[Index(Signal::kX)] += 1.3 * tests::kNoise;
}

ModelSet Fitted() {
  ModelSet models = tests::LinearPlant();
  models.decision.isolation_samples = 20;
  for (Observer& observer : models.observers) {
    for (ChannelObserver& channel : observer.channels) {
      channel.fit = {-0.8, 0.8, 2.0};
    }
  }
  return models;
}

Seen FollowChange(const ModelSet& models, void (*change)(Sample&)) {
  ValveEngine engine(std::make_shared<const ModelSet>(models));
  Noise noise(5);
  StepRange(engine, 0, 50, [&](Sample& s) { noise.Add(s); });
  return StepRange(engine, 50, 250, [&](Sample& s) {
    noise.Add(s);
    change(s);
  });
}

TEST(FitWindowTest, AFaultThatIsBestButDoesNotFitIsNotNamed) {
  const Seen before = FollowChange(tests::LinearPlant(), Strange);
  EXPECT_EQ(before.last.state, State::kIsolated);
  const Seen seen = FollowChange(Fitted(), Strange);
  EXPECT_EQ(seen.last.state, State::kDetected);
  EXPECT_EQ(seen.last.unknown, Unknown::kOutsideKnown);
  for (const Transition& transition : seen.transitions) {
    EXPECT_EQ(transition.faults, 0U);
  }
}

TEST(FitWindowTest, AFaultThatFitsKeepsItsName) {
  const Seen seen = FollowChange(Fitted(), tests::FullF6);
  EXPECT_EQ(seen.last.state, State::kIsolated);
  EXPECT_EQ(seen.last.isolated, 4U);
}

TEST(FitWindowTest, ANameBeforeTkFitsSoFar) {
  const auto stranger = [](Sample& sample) {
    AddF6(sample, 1.0);
    sample.values[Index(Signal::kX)] += 2.5 * tests::kNoise;
  };
  ModelSet judged = Fitted();
  judged.decision.early_error = 1e-3;
  ModelSet older = tests::LinearPlant();
  older.decision = judged.decision;
  EXPECT_NE(FollowChange(older, stranger).transitions.at(1).faults, 0U);
  const Seen seen = FollowChange(judged, stranger);
  for (const Transition& transition : seen.transitions) {
    EXPECT_EQ(transition.faults, 0U);
  }
}

// As a valve without air, whose X and F are those of evaporation.
TEST(FitWindowTest, AFaultThatMovesAnInputIsNotNamedWhereTheInputIsAsUsual) {
  ModelSet judged = Fitted();
  judged.decision.early_error = 1e-3;
  for (Observer& observer : judged.observers) {
    observer.moved = observer.fault == 6 ? MaskOf(Signal::kT1) : SignalMask{0};
  }
  const Seen seen = FollowChange(judged, [](Sample& sample) {
    AddF6(sample, 1.0);
    sample.Set(Signal::kT1, 20.0);
  });
  for (const Transition& transition : seen.transitions) {
    EXPECT_EQ(transition.faults, 0U);
  }
  EXPECT_EQ(seen.last.unknown, Unknown::kOutsideKnown);
}

// Evaporation moves T1, which is as good as one more sample. Where T1 is off,
// no fault that does not act on it is named, however well it explains X and F.
TEST(FitWindowTest, AnInputThatHasMovedNamesTheFaultThatAlwaysMovesIt) {
  std::vector<std::int64_t> named_ns;
  for (const SignalMask moved : {MaskOf(Signal::kT1), SignalMask{0}}) {
    for (const int fault : {7, 6}) {
      ModelSet judged = Fitted();
      judged.decision.early_error = 1e-3;
      judged.validity.t1 = {15.0, 25.0};
      judged.faults.back() = fault;
      for (Observer& observer : judged.observers) {
        const bool last = observer.fault == 6;
        observer.fault = last ? fault : observer.fault;
        observer.moved = last ? moved : SignalMask{0};
      }
      const Seen seen = FollowChange(judged, [](Sample& sample) {
        AddF6(sample, 1.0);
        sample.Set(Signal::kT1, 60.0);
      });
      EXPECT_EQ(seen.last.isolated, fault == 7 ? 4U : 0U);
      if (fault == 7) {
        ASSERT_GE(seen.transitions.size(), 2U);
        EXPECT_EQ(seen.transitions[1].faults, 4U);
        named_ns.push_back(seen.transitions[1].stamp_ns);
      }
    }
  }
  EXPECT_EQ(named_ns.at(1) - named_ns.at(0), 1000000000);
}

// The name is taken back once the readings have left what the fault does.
TEST(FitWindowTest, ANameThatFitsNoMoreIsTakenBack) {
  ValveEngine engine(std::make_shared<const ModelSet>(Fitted()));
  Noise noise(5);
  StepRange(engine, 0, 50, [&](Sample& s) { noise.Add(s); });
  const Seen named = StepRange(engine, 50, 150, [&](Sample& s) {
    noise.Add(s);
    AddF6(s, 1.0);
  });
  ASSERT_EQ(named.last.isolated, 4U);
  const Seen seen = StepRange(engine, 150, 300, [&](Sample& s) {
    noise.Add(s);
    Strange(s);
  });
  ASSERT_FALSE(seen.transitions.empty());
  EXPECT_EQ(seen.transitions.front().kind, TransitionKind::kReisolated);
  EXPECT_EQ(seen.transitions.front().faults, 0U);
  EXPECT_EQ(seen.last.unknown, Unknown::kOutsideKnown);
}

// The last name, where the command rests and f3 and f6 look alike.
std::string NameAtRest(const ModelSet& models, double x_off) {
  ValveEngine engine(std::make_shared<const ModelSet>(models));
  Noise noise(5);
  FaultSet named = 0;
  for (std::uint64_t k = 0; k < 400; ++k) {
    Sample sample = tests::PlantSample(k, 0.0);
    noise.Add(sample);
    AddF6(sample, k < 50 ? 0.0 : 1.0);
    sample.values[Index(Signal::kX)] += k < 150 ? 0.0 : x_off;
    named = engine.Step(sample).isolated;
    EXPECT_TRUE(k != 149 || named == 6U);
  }
  return FaultSetName(models, named);
}

// Nor does a finding of the floor take its place, which says less.
TEST(FitWindowTest, ASetThatFitsNoMoreStays) {
  ModelSet models = Fitted();
  EXPECT_EQ(NameAtRest(models, 1.3 * tests::kNoise), "f3|f6");
  EXPECT_EQ(NameAtRest(models, 12.0), "f3|f6");
  FloorLimits& floor = models.floor.emplace();
  floor.quick = {1.0, 100.0};
  floor.slow = {0.4, 8.0};
  AddFindings(models);
  EXPECT_EQ(NameAtRest(models, 1.3 * tests::kNoise), "f3|f6");
  EXPECT_EQ(NameAtRest(models, 12.0), "f3|f6");
}

// A fault that fits half of the time is taken back and does not return whenever
// it fits again.
TEST(FitWindowTest, AFaultThatFitsNowAndThenIsNotNamedAgain) {
  ValveEngine engine(std::make_shared<const ModelSet>(Fitted()));
  Noise noise(5);
  StepRange(engine, 0, 50, [&](Sample& s) { noise.Add(s); });
  int k = 0;
  const Seen seen = StepRange(engine, 50, 650, [&](Sample& s) {
    noise.Add(s);
    AddF6(s, 1.0);
    s.values[Index(Signal::kX)] += k++ % 60 < 30 ? 0.0 : 2.0 * tests::kNoise;
  });
  EXPECT_EQ(seen.last.unknown, Unknown::kOutsideKnown);
  int names = 0;
  for (const Transition& transition : seen.transitions) {
    names += transition.faults != 0 ? 1 : 0;
  }
  EXPECT_LE(names, 1);
}

// A fault that has gone fits no more, but what was named was there.
TEST(FitWindowTest, AFaultThatHasGoneKeepsItsName) {
  ModelSet models = Fitted();
  models.decision.clearing_samples = 60;
  ValveEngine engine(std::make_shared<const ModelSet>(models));
  Noise noise(5);
  StepRange(engine, 0, 50, [&](Sample& s) { noise.Add(s); });
  StepRange(engine, 50, 150, [&](Sample& s) {
    noise.Add(s);
    AddF6(s, 1.0);
  });
  const Seen seen =
      StepRange(engine, 150, 400, [&](Sample& s) { noise.Add(s); });
  ASSERT_FALSE(seen.transitions.empty());
  for (const Transition& transition : seen.transitions) {
    EXPECT_EQ(transition.faults, 4U);
  }
  EXPECT_EQ(seen.transitions.back().kind, TransitionKind::kClosed);
}

}  // namespace
}  // namespace fdi
