#include "diagnosis/decision/floor.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "base/error.h"
#include "diagnosis/decision/valve_engine.h"
#include "diagnosis/model/fault_catalogue.h"
#include "tests/diagnosis/linear_plant.h"

namespace fdi {
namespace {

constexpr double kDp = 900.0;

// The linear plant with a rod that takes 1 to 3 s. F = 100 exp(-2 X) at kDp.
ModelSet FlooredPlant() {
  ModelSet models = tests::LinearPlant();
  FloorLimits& floor = models.floor.emplace();
  floor.quick = {1.0, 100.0};
  floor.slow = {0.4, 8.0};
  floor.flow_gain = 100.0 / std::sqrt(kDp);
  floor.flow_exponent = 2.0;
  floor.dp_level = kDp;
  floor.flow_high = 60.0;
  floor.flow_share = 0.5;
  AddFindings(models);
  return models;
}

// The bits of the findings are counted from the last fault.
TEST(FloorTest, ASetHasAllItsFindingsOnce) {
  ModelSet models = FlooredPlant();
  EXPECT_NO_THROW(Validate(models));
  const int last = models.faults.back();
  models.faults.back() = *(models.faults.end() - 2);
  EXPECT_THROW(Validate(models), DataError);
  models.faults.pop_back();
  EXPECT_THROW(Validate(models), DataError);
  models.faults.push_back(last);
  EXPECT_NO_THROW(Validate(models));
}

TEST(FloorTest, TheTrimOfASetHasAllItsPoints) {
  ModelSet models = FlooredPlant();
  models.floor->flow_shape.assign(FloorLimits::kShapePoints, 0.5);
  EXPECT_NO_THROW(Validate(models));
  models.floor->flow_shape.back() = 1.5;
  EXPECT_THROW(Validate(models), DataError);
  models.floor->flow_shape.pop_back();
  EXPECT_THROW(Validate(models), DataError);
}

struct Valve {
  double cv{50.0};
  double x{50.0};
  std::optional<double> flow{};  // else what the opening passes
  ValveMode mode{ValveMode::kAuto};
  SignalQuality quality{SignalQuality::kGood};  // of X and F
};

Sample ValveAt(int k, const Valve& valve) {
  Sample sample;
  sample.stamp_ns = (k + 1LL) * 1'000'000'000;
  sample.source_id = 7;
  sample.seq = static_cast<std::uint64_t>(k);
  sample.mode = valve.mode;
  sample.Set(Signal::kCv, valve.cv);
  sample.Set(Signal::kX, valve.x);
  sample.Set(Signal::kF,
             valve.flow.value_or(100.0 * std::exp(-0.02 * valve.x)));
  sample.quality[Index(Signal::kX)] = valve.quality;
  sample.quality[Index(Signal::kF)] = valve.quality;
  return sample;
}

// The number of the first sample with a finding, by finding; -1 without.
std::vector<int> FirstFindings(const std::function<Valve(int)>& history,
                               int samples = 200) {
  const ModelSet models = FlooredPlant();
  Floor floor(models);
  const std::size_t offset = models.faults.size() - Floor::kTests;
  std::vector<int> first(Floor::kTests, -1);
  for (int k = 0; k < samples; ++k) {
    floor.Push(ValveAt(k, history(k)));
    for (std::size_t i = 0; i < Floor::kTests; ++i) {
      const bool found = (floor.findings() >> (offset + i) & 1U) != 0;
      first[i] = first[i] < 0 && found ? k : first[i];
    }
  }
  return first;
}

int Of(int finding, const std::vector<int>& first) {
  return first[static_cast<std::size_t>(finding - kTravelDeviation)];
}

const std::vector<int> kNothing(Floor::kTests, -1);

// The flow past a rod at x [%], up to the end of the meter; little where it
// shuts.
double Passes(double x) {
  return x > 95.0 ? 5.0 : std::min(100.0 * std::exp(-0.02 * x), 60.0);
}

// From stop to stop, as fast as any command, the rod as slow as it may be.
TEST(FloorTest, CommandedTravelIsNoFinding) {
  for (const bool slow : {false, true}) {
    double x = 50.0;
    EXPECT_EQ(FirstFindings([&](int k) {
                const double cv =
                    std::vector{0.0, 100.0, 30.0,
                                80.0}[static_cast<std::size_t>(k / 50 % 4)];
                x = NextRodPosition(slow ? FloorLimits::Rod{0.4, 8.0}
                                         : FloorLimits::Rod{1.0, 100.0},
                                    x, cv);
                // A reading that is off by 6 % and noisy is still healthy.
                return Valve{cv, x + 5.0 + 0.1 * (k % 3), Passes(x)};
              }),
              kNothing);
  }
}

// The rod stays `off` from where it is commanded: the limit is 10.
TEST(FloorTest, AShareAboveOneIsAFinding) {
  for (const double off : {2.0, 8.0, 9.9, 10.2, 15.0, 40.0}) {
    const ModelSet models = FlooredPlant();
    Floor floor(models);
    double share = 0.0;
    for (int k = 0; k < 60; ++k) {
      const double x = k < 30 ? 50.0 : 50.0 + off;
      // A reading that repeats would be a finding without a share.
      floor.Push(ValveAt(
          k, {.x = x, .flow = 100.0 * std::exp(-0.02 * x) + 0.01 * (k % 7)}));
      EXPECT_EQ(floor.share() > 1.0, floor.findings() != 0) << off << " " << k;
      share = floor.share();
    }
    EXPECT_GE(share, off / models.floor->deviation - 1e-9) << off;
    floor.Restart();
    EXPECT_EQ(floor.share(), 0.0);
  }
}

// Nor is a rod that follows a step at once and comes back slowly, or the
// reverse.
TEST(FloorTest, ARodMayMoveFasterOneWay) {
  for (const bool closes_fast : {false, true}) {
    double x = 50.0;
    EXPECT_EQ(FirstFindings([&](int k) {
                const double cv =
                    k % 40 < 3 ? (closes_fast ? 95.0 : 5.0) : 50.0;
                x = NextRodPosition((cv > x) == closes_fast
                                        ? FloorLimits::Rod{1.0, 100.0}
                                        : FloorLimits::Rod{0.4, 8.0},
                                    x, cv);
                return Valve{cv, x, Passes(x)};
              }),
              kNothing)
        << closes_fast;
  }
}

// A step that is taken back does not excuse where the rod is long after it.
TEST(FloorTest, TheRangeAfterAStepThatIsTakenBackEnds) {
  EXPECT_NE(FirstFindings([](int k) {
              const double x = k < 23 ? 50.0 : 90.0;
              return Valve{k >= 20 && k < 23 ? 90.0 : 50.0, x, Passes(x)};
            }),
            kNothing);
}

// Nor is a rod that rests at its stop until its chamber is filled.
TEST(FloorTest, BreakawayFromAStopIsNoFinding) {
  for (const int start : {0, 60}) {
    double x = 0.0;
    EXPECT_EQ(FirstFindings([&](int k) {
                const double cv = k < start ? 0.0 : 90.0;
                x = k < start + 4 ? 0.0 : NextRodPosition({0.4, 12.0}, x, cv);
                return Valve{cv, x, Passes(x)};
              }),
              kNothing)
        << start;
  }
}

// The rod leaves a command that wanders by 8 %, as a noisy loop's does.
TEST(FloorTest, NoLaterThanThePositionersAlert) {
  for (const double rate : {0.5, 2.0, 5.0, 60.0}) {
    int run = 0;
    int alert = -1;
    const auto history = [&](int k) {
      Valve valve;
      valve.cv = 50.0 + 8.0 * std::sin(2.1 * k) * std::cos(0.37 * k);
      valve.x = k < 60 ? valve.cv : std::max(50.0 - rate * (k - 60), 0.0);
      run = std::abs(valve.cv - valve.x) > 20.0 ? run + 1 : 0;
      alert = alert < 0 && run >= 5 ? k : alert;
      return valve;
    };
    const int found = Of(kTravelDeviation, FirstFindings(history));
    ASSERT_GE(alert, 60);
    EXPECT_GE(found, 60);
    EXPECT_LE(found, alert) << rate;
  }
}

TEST(FloorTest, StreamThatBeginsWithTheFaultIsNoExcuse) {
  // The rod lies at its stop before the first sample.
  const int found = Of(kTravelDeviation, FirstFindings([](int) {
                         return Valve{60.0, 0.3};
                       }));
  EXPECT_GT(found, 0);
  EXPECT_LE(found, 15);
}

TEST(FloorTest, FlowThroughAShutValve) {
  const auto shut = [](double flow) {
    return FirstFindings([flow](int) { return Valve{100.0, 100.0, flow}; });
  };
  EXPECT_EQ(shut(5.0), kNothing);
  EXPECT_EQ(Of(kShutFlow, shut(8.0)), 9);
}

// The first opening of an equal percentage trim passes its whole rangeability.
TEST(FloorTest, AStartIsNoLeakOfTheSeat) {
  const auto at = [](double x, double flow) {
    return FirstFindings([=](int k) {
      return Valve{99.0, x + 0.01 * (k % 2), flow + 0.1 * (k % 2)};
    });
  };
  EXPECT_EQ(at(98.8, 8.0), kNothing);
  EXPECT_EQ(Of(kShutFlow, at(98.8, 20.0)), 9);
  EXPECT_EQ(Of(kShutFlow, at(100.0, 8.0)), 9);
}

TEST(FloorTest, FlowThatNoOpeningPasses) {
  const auto at = [](double flow) {
    return FirstFindings([flow](int k) {
      return Valve{70.0, 70.0, flow + 0.1 * (k % 2)};
    });
  };
  // 24.7 at X; 1.5 times that at 65 %, and a tenth of 60.
  EXPECT_EQ(at(46.0), kNothing);
  EXPECT_EQ(Of(kExcessFlow, at(48.0)), 9);
}

TEST(FloorTest, LessFlowThanTheOpeningPasses) {
  const auto at = [](double x, double flow) {
    return FirstFindings([=](int k) {
      return Valve{x, x, flow + 0.1 * (k % 2)};
    });
  };
  // 27.3 at 65 %; half of that, less a tenth of 60.
  EXPECT_EQ(at(60.0, 8.0), kNothing);
  EXPECT_EQ(Of(kLowFlow, at(60.0, 7.0)), 9);
  // Wide open it passes no less than the record has shown: 30 less 6.
  EXPECT_EQ(at(0.0, 25.0), kNothing);
  EXPECT_EQ(Of(kLowFlow, at(0.0, 23.0)), 9);
  // Shut it passes nothing, whatever the straight line says.
  EXPECT_EQ(at(99.5, 0.0), kNothing);
  // A rod that does not follow may be anywhere.
  EXPECT_EQ(Of(kLowFlow, FirstFindings([](int k) {
                 return Valve{80.0, 30.0, 0.1 * (k % 2)};
               })),
            -1);
}

TEST(FloorTest, FlowThatWentWithThePressureIsLostUnlessTheValveIsParked) {
  const auto first = [](double at) {
    const ModelSet models = FlooredPlant();
    Floor floor(models);
    for (int k = 0; k < 100; ++k) {
      Sample sample = ValveAt(k, {at, at, 0.0});
      sample.Set(Signal::kP1, 2600.0);
      sample.Set(Signal::kP2, 2600.0);
      floor.Push(sample);
    }
    return FaultSetName(models, floor.findings());
  };
  EXPECT_EQ(first(40.0), "low_flow");
  EXPECT_EQ(first(0.0), "unknown");
}

// Sets without a flow have one finding less.
TEST(FloorTest, WithoutAShareNothingTestsForTooLittleFlow) {
  ModelSet models = FlooredPlant();
  models.floor->flow_share = 0.0;
  EXPECT_THROW(Validate(models), DataError);
  models.faults.pop_back();
  EXPECT_NO_THROW(Validate(models));
  Floor floor(models);
  for (int k = 0; k < 100; ++k) {
    floor.Push(ValveAt(k, {40.0, 40.0, 0.0}));
    EXPECT_EQ(floor.findings(), 0U);
  }
}

TEST(FloorTest, ReadingsThatRepeatWhileTheyShouldMove) {
  const auto sine = [](int k) {
    return 50.0 + 20.0 * std::sin(2.0 * std::numbers::pi * k / 60.0);
  };
  const auto stuck = [&](bool position, bool flow) {
    return FirstFindings([&, position, flow](int k) {
      Valve valve{sine(k), sine(k)};
      valve.x = position ? 50.0 : valve.x;
      if (flow) {
        valve.flow = 36.0;
      }
      return valve;
    });
  };
  EXPECT_EQ(stuck(false, false), kNothing);
  EXPECT_GT(Of(kPositionStuck, stuck(true, false)), 0);
  EXPECT_LE(Of(kPositionStuck, stuck(true, false)), 20);
  EXPECT_GT(Of(kFlowStuck, stuck(false, true)), 0);
  // A rod that rests, and one at its stop, repeat themselves.
  EXPECT_EQ(FirstFindings([](int) { return Valve{}; }), kNothing);
  EXPECT_EQ(FirstFindings([](int k) {
              return Valve{k % 2 == 0 ? -3.0 : 1.0, 0.0, 100.0};
            })[kPositionStuck - kTravelDeviation],
            -1);
}

// By exception there is no reading while a rod stays within the dead band. What
// stands there for one that is missing is not the silence of a transmitter.
TEST(FloorTest, SilenceWhileItShouldMoveIsARepeat) {
  const auto first = [](int finding, double x_moves, double f_moves,
                        bool bridged, int every = ReadEvery::kOnChange) {
    ModelSet models = FlooredPlant();
    models.every.x = every;
    Floor floor(models);
    for (int k = 0; k < 200; ++k) {
      const double cv = k < 40 ? 50.0 : 70.0;
      const double line = std::min(1.0, std::max(0, k - 40) / 20.0);
      Sample sample = ValveAt(
          k, {cv, 50.0 + x_moves * line, Passes(50.0 + f_moves * line)});
      for (const Signal signal : {Signal::kX, Signal::kF}) {
        const bool told = k < 40 || (signal == Signal::kX && x_moves > 10.0);
        sample.quality[Index(signal)] =
            told ? SignalQuality::kGood : SignalQuality::kUncertain;
      }
      floor.Push(sample, bridged ? SignalMask{0} : sample.uncertain());
      const FaultSet bit = FaultSet{1} << FaultIndex(models, finding);
      if ((floor.findings() & bit) != 0) {
        return k;
      }
    }
    return -1;
  };
  EXPECT_GT(first(kPositionStuck, 0.0, 0.0, false), 40);
  EXPECT_LE(first(kPositionStuck, 0.0, 0.0, false), 50);
  const int new_to_it = first(kPositionStuck, 0.0, 0.0, false, 0);
  EXPECT_GE(new_to_it, 59) << "the record has not shown how long is usual";
  EXPECT_LE(new_to_it, 60);
  EXPECT_GT(first(kPositionStuck, 0.9, 0.0, false), 40) << "drawn as a line";
  EXPECT_EQ(first(kPositionStuck, 20.0, 20.0, false), -1);
  EXPECT_EQ(first(kPositionStuck, 0.0, 0.0, true), -1);
  EXPECT_GT(first(kFlowStuck, 20.0, 0.0, false), 50);
  EXPECT_EQ(first(kFlowStuck, 20.0, 20.0, false), -1);
  EXPECT_EQ(first(kFlowStuck, 20.0, 0.0, true), -1);
}

// Nothing is measured for longer than nothing may be known, but silence is
// known.
TEST(FloorTest, ARodThatIsSilentOpensAnEpisode) {
  ModelSet models = FlooredPlant();
  models.floor->flow_gain = 0.0;  // Here is another flow.
  ValveEngine engine(std::make_shared<const ModelSet>(models));
  constexpr int kNever = 1000;
  bool open = false;
  int detected = kNever;
  FaultSet name = 0;
  for (int k = 0; k < 400; ++k) {
    Sample sample =
        tests::PlantSample(static_cast<std::uint64_t>(k), k < 200 ? 2.0 : 0.0);
    if (k >= 300) {
      sample.Set(Signal::kCv, 70.0);
    }
    if (k >= 200) {
      sample.quality[Index(Signal::kX)] = SignalQuality::kUncertain;
      sample.quality[Index(Signal::kF)] = SignalQuality::kUncertain;
    }
    const Verdict& verdict = engine.Step(sample);
    open = open || engine.episode_open();
    name = name != 0 ? name : verdict.isolated;
    EXPECT_FALSE(open && k <= 300) << k;
    EXPECT_TRUE(open || k < 310) << k;
    // Nothing is known of a valve without readings, until one was due.
    EXPECT_EQ(verdict.quality == Quality::kBadInput, k >= 260 && !open) << k;
    // The first reading that is far off is held out, like any other.
    EXPECT_EQ(std::isnan(verdict.residuals[0]), k >= 200 && k <= detected + 1);
    detected = open && detected == kNever ? k : detected;
  }
  EXPECT_EQ(FaultSetName(engine.models(), name), "x_stuck");
}

// Nobody knows yet whether values that repeat are readings. One that stands
// while the rod should travel is.
TEST(FloorTest, WhatShouldHaveMovedIsKnown) {
  ModelSet models = FlooredPlant();
  models.floor->flow_gain = 0.0;
  ValveEngine engine(std::make_shared<const ModelSet>(models));
  Unseen unseen;
  unseen.unknown = true;
  int found = 0;
  for (int k = 0; k < 300; ++k) {
    Sample sample =
        tests::PlantSample(static_cast<std::uint64_t>(k), k < 200 ? 2.0 : 20.0);
    sample.Set(Signal::kX, 50.0);
    engine.Allow(unseen);
    const Verdict& verdict = engine.Step(sample);
    found += engine.episode_open() ? 1 : 0;
    EXPECT_EQ(verdict.quality, found > 0 ? Quality::kLive : Quality::kSettling)
        << k;
  }
  EXPECT_GT(found, 50);
}

// The silence is that of a valve at rest: whatever was found before, nothing is
// known of it by now.
TEST(FloorTest, AnEarlierFindingIsNoReading) {
  ModelSet models = FlooredPlant();
  models.floor->flow_gain = 0.0;
  ValveEngine engine(std::make_shared<const ModelSet>(models));
  for (int k = 0; k < 300; ++k) {
    Sample sample =
        tests::PlantSample(static_cast<std::uint64_t>(k), k < 200 ? 2.0 : 0.0);
    if (k >= 150) {
      sample.Set(Signal::kX, sample[Signal::kX] + 30.0);
    }
    if (k >= 200) {
      sample.quality[Index(Signal::kX)] = SignalQuality::kUncertain;
      sample.quality[Index(Signal::kF)] = SignalQuality::kUncertain;
    }
    const Verdict& verdict = engine.Step(sample);
    EXPECT_EQ(verdict.quality == Quality::kBadInput, k >= 260) << k;
  }
  EXPECT_TRUE(engine.episode_open());
}

// A valve without a position transmitter: its rod is somewhere in the range
// that it may have.
TEST(FloorTest, TestsTheFlowWithoutAPosition) {
  const ModelSet models = FlooredPlant();
  const auto first = [&](double cv, double flow, int moving) {
    Floor floor(models);
    for (int k = 0; k < 100; ++k) {
      Sample sample = ValveAt(k, {cv, 0.0, flow + 0.1 * (k % 2)});
      sample.Set(Signal::kCv, cv + (k % 40 < 20 ? 0.0 : moving));
      sample.values[Index(Signal::kF)] = moving > 0 ? flow : sample[Signal::kF];
      sample.present =
          static_cast<SignalMask>(MaskOf(Signal::kCv) | MaskOf(Signal::kF));
      floor.Push(sample);
      if (floor.findings() != 0) {
        return std::pair(
            k, floor.findings() >> (models.faults.size() - Floor::kTests));
      }
    }
    return std::pair(-1, FaultSet{0});
  };
  const auto bit = [](int finding) {
    return FaultSet{1} << (finding - kTravelDeviation);
  };
  EXPECT_EQ(first(70.0, 46.0, 0).first, -1);
  EXPECT_EQ(first(70.0, 48.0, 0), std::pair(9, bit(kExcessFlow)));
  EXPECT_EQ(first(100.0, 8.0, 0), std::pair(9, bit(kShutFlow)));
  EXPECT_EQ(first(40.0, 30.0, 30).second, bit(kFlowStuck));
}

TEST(FloorTest, HoldsInAutoOnlyAndNeverWithoutLimits) {
  EXPECT_EQ(FirstFindings([](int) {
              return Valve{90.0, 10.0, 100.0, ValveMode::kManual};
            }),
            kNothing);
  const ModelSet models = tests::LinearPlant();
  Floor floor(models);
  for (int k = 0; k < 100; ++k) {
    floor.Push(ValveAt(k, {90.0, 10.0}));
    EXPECT_EQ(floor.findings(), 0U);
  }
}

// Onboarded without P1 and P2, the gain is that of F; with the readings of a
// valve that has them, the opening would seem to pass thirty times as much.
TEST(FloorTest, SignalsThatTheSetWasNotTrainedWithDoNotCount) {
  for (const bool trained : {false, true}) {
    ModelSet models = FlooredPlant();
    models.floor->flow_gain = 100.0;
    models.floor->dp_level = 1.0;
    models.floor->flow_high = 200.0;
    if (trained) {
      models.validity.dp = {800.0, 1000.0};
    }
    ValveEngine engine(std::make_shared<const ModelSet>(models));
    for (std::uint64_t k = 0; k < 100; ++k) {
      Sample sample = tests::PlantSample(k);
      sample.Set(Signal::kP1, 3500.0);
      sample.Set(Signal::kP2, 2600.0);
      engine.Step(sample);
    }
    EXPECT_EQ(engine.episode_open(), trained);
  }
}

TEST(FloorTest, WhatIsUncertainIsNotTested) {
  const auto found = [](SignalQuality quality) {
    return FirstFindings([=](int) {
      return Valve{99.0, 10.0, 99.0, ValveMode::kAuto, quality};
    });
  };
  EXPECT_NE(found(SignalQuality::kGood), kNothing);
  EXPECT_EQ(found(SignalQuality::kUncertain), kNothing);
}

struct Followed {
  std::vector<Transition> transitions;
  std::vector<Quality> qualities;
};

Followed Engine(const ModelSet& models, int samples,
                const std::function<Valve(int)>& history) {
  ValveEngine engine(std::make_shared<const ModelSet>(models));
  Followed followed;
  for (int k = 0; k < samples; ++k) {
    const Verdict& verdict = engine.Step(ValveAt(k, history(k)));
    followed.qualities.push_back(verdict.quality);
    for (const Transition& transition : verdict.Transitions()) {
      followed.transitions.push_back(transition);
    }
  }
  return followed;
}

// Before the observers have settled, and at commands that none was trained on.
TEST(FloorTest, OpensAnEpisodeBeforeTheObserversMay) {
  ModelSet models = FlooredPlant();
  models.validity.cv = {0.0, 55.0};
  models.decision.settling_samples = 30;
  const Followed seen = Engine(models, 100, [](int) {
    return Valve{80.0, 20.0};
  });
  ASSERT_GE(seen.transitions.size(), 2U);
  EXPECT_EQ(seen.transitions[0].kind, TransitionKind::kDetected);
  EXPECT_LT(seen.transitions[0].stamp_ns, 20'000'000'000);
  EXPECT_EQ(seen.transitions[1].kind, TransitionKind::kIsolated);
  EXPECT_EQ(FaultSetName(models, seen.transitions[1].faults),
            "travel_deviation");
  EXPECT_EQ(seen.qualities.back(), Quality::kLive);
}

// The flow is lost while the valve stands wide open, where nothing was trained;
// or a stream begins like that.
TEST(FloorTest, LostFlowOpensAnEpisodeAtTheEndOfTheTravel) {
  ModelSet models = FlooredPlant();
  models.validity.cv = {40.0, 60.0};
  for (const int lost : {0, 200}) {
    const Followed seen = Engine(models, 300, [&](int k) {
      const double wave = 0.02 * (k % 2);
      return Valve{wave, wave, k >= lost ? wave : 100.0 - wave};
    });
    ASSERT_GE(seen.transitions.size(), 2U) << lost;
    EXPECT_EQ(seen.transitions[1].kind, TransitionKind::kIsolated);
    EXPECT_LE(seen.transitions[1].stamp_ns, (lost + 60) * 1'000'000'000LL);
    EXPECT_EQ(FaultSetName(models, seen.transitions[1].faults), "low_flow");
  }
}

// With a leak f5 of two strengths, the whole flow at the larger one.
ModelSet LeakyPlant() {
  ModelSet models = tests::LinearPlant();
  for (const double s : {0.3, 1.0}) {
    models.observers.push_back(
        {"f5",
         5,
         s,
         {tests::LinearModel(Signal::kX, 1.0, 0.0),
          tests::LinearModel(Signal::kF, s - 1.0, 100.0 * (1.0 - s))}});
  }
  models.faults = {1, 3, 5, 6};
  models.decision.isolation_samples = 20;
  models.decision.early_error = 1e-3;
  models.floor = FlooredPlant().floor;
  for (Observer& observer : models.observers) {
    for (ChannelObserver& channel : observer.channels) {
      channel.fit = {-0.8, 0.8, 2.0};
    }
  }
  AddFindings(models);
  return models;
}

// The names of 600 samples, from the 60th on with a share of the flow lost.
std::vector<std::string> NamesOfLoss(double (*lost)(int)) {
  const ModelSet models = LeakyPlant();
  ValveEngine engine(std::make_shared<const ModelSet>(models));
  tests::Noise noise(5);
  std::vector<std::string> names;
  for (int k = 0; k < 660; ++k) {
    Sample sample = tests::PlantSample(static_cast<std::uint64_t>(k));
    const double share = k < 60 ? 0.0 : lost(k - 60);
    sample.Set(Signal::kF, sample[Signal::kF] * (1.0 - share));
    noise.Add(sample);
    for (const Transition& transition : engine.Step(sample).Transitions()) {
      names.push_back(FaultSetName(models, transition.faults));
    }
  }
  return names;
}

// A leak that takes all of the flow explains what is seen, and would be named
// within seconds: before the floor has found the loss.
TEST(FloorTest, LostFlowIsNeverAFaultOfTheValveAlone) {
  const std::vector<std::string> names =
      NamesOfLoss([](int k) { return k < 600 ? 0.99 : 1.0; });
  EXPECT_EQ(std::ranges::count(names, "f5"), 0);
  ASSERT_FALSE(names.empty());
  EXPECT_EQ(names.back(), "f5|low_flow");
}

// One that was named long before it took so much is enough.
TEST(FloorTest, AFaultThatHasGrownExplainsTheLoss) {
  const std::vector<std::string> names =
      NamesOfLoss([](int k) { return k / 600.0; });
  ASSERT_FALSE(names.empty());
  EXPECT_EQ(names.back(), "f5");
  EXPECT_EQ(std::ranges::count(names, "f5|low_flow"), 0);
}

// The fault moves the command, by more than any step in training and out of
// the trained range: f6 is named all the same. Sets without a floor wait
// outside.
TEST(FloorTest, AbnormalValveStaysJudgedWhateverItsCommandDoes) {
  for (const bool floored : {false, true}) {
    ModelSet models = floored ? FlooredPlant() : tests::LinearPlant();
    models.validity.cv = {40.0, 60.0};
    models.validity.cv_step = 10.0;
    const Followed seen = Engine(models, 200, [](int k) {
      const double wave = 3.0 * std::sin(0.3 * k);
      const double cv = (k > 100 ? 75.0 : 50.0) + wave;
      return Valve{cv, cv, 100.0 - cv + (k >= 100 ? 20.0 : 0.0)};
    });
    const bool named =
        std::ranges::any_of(seen.transitions, [&](const Transition& t) {
          return FaultSetName(models, t.faults).find("f6") != std::string::npos;
        });
    EXPECT_EQ(named, floored);
    EXPECT_EQ(seen.qualities.back(),
              floored ? Quality::kLive : Quality::kUncovered);
  }
}

// Without a deviation the region holds as it does without a floor.
TEST(FloorTest, HealthyValveThatLeavesItsRegionIsUncovered) {
  ModelSet models = FlooredPlant();
  models.validity.cv = {40.0, 60.0};
  const Followed seen = Engine(models, 200, [](int k) {
    const double cv = k >= 100 ? 75.0 : 50.0;
    return Valve{cv, cv, 100.0 - cv};
  });
  EXPECT_TRUE(seen.transitions.empty());
  EXPECT_EQ(seen.qualities[99], Quality::kLive);
  EXPECT_EQ(seen.qualities[100], Quality::kUncovered);
}

// Six faults that predict the same.
TEST(FloorTest, MoreThanFourFaultsAreNoName) {
  for (const int faults : {4, 6}) {
    ModelSet models = FlooredPlant();
    models.floor->flow_gain = 0.0;
    models.observers.resize(1);
    models.faults.clear();
    for (int fault = 1; fault <= faults; ++fault) {
      models.observers.push_back(tests::F6(1.0));
      models.observers.back().fault = fault;
      models.faults.push_back(fault);
    }
    AddFindings(models);
    const Followed seen = Engine(models, 200, [](int k) {
      const double cv = 50.0 + 20.0 * std::sin(0.15 * k);
      return Valve{cv, cv, 100.0 - cv + (k >= 100 ? 20.0 : 0.0)};
    });
    ASSERT_FALSE(seen.transitions.empty());
    EXPECT_EQ(seen.transitions.back().kind, faults == 4
                                                ? TransitionKind::kIsolated
                                                : TransitionKind::kDetected);
  }
}

}  // namespace
}  // namespace fdi
