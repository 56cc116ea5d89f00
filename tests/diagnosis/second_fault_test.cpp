#include "diagnosis/decision/second_fault.h"

#include <cmath>
#include <functional>
#include <memory>
#include <tuple>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "diagnosis/decision/valve_engine.h"
#include "tests/diagnosis/linear_plant.h"

namespace fdi::tests {
namespace {

constexpr int kBegin = 100;   // of the first fault
constexpr int kSecond = 700;  // 600 s later

// The linear plant, whose faults say how they fit. f1 adds up with f6 in other
// channels; f3 is left out, so that nothing else explains both.
std::shared_ptr<const ModelSet> FittingPlant(bool judges_fit = true) {
  ModelSet models = LinearPlant();
  std::erase_if(models.observers,
                [](const Observer& o) { return o.fault == 3; });
  models.faults = {1, 6};
  for (Observer& observer : models.observers) {
    for (ChannelObserver& channel : observer.channels) {
      if (judges_fit && observer.fault != 0) {
        channel.fit = {-1.5, 1.5, 3.0};
      }
    }
  }
  return std::make_shared<const ModelSet>(models);
}

constexpr FaultSet kBitF1 = 1;
constexpr FaultSet kBitF6 = 2;

void AddF1(Sample& sample, double s) {
  sample.values[Index(Signal::kX)] -= 20.0 * s;
}

// Runs a plant of which f1 and f6 have these strengths at sample k.
class PlantRun {
 public:
  using Strength = std::function<double(int)>;

  explicit PlantRun(std::shared_ptr<const ModelSet> models = FittingPlant())
      : engine_(std::move(models)) {}

  void To(int end, const Strength& f1, const Strength& f6) {
    for (; k_ < end; ++k_) {
      if (name_) {
        engine_.TakeName(name_(k_));
      }
      Sample sample = PlantSample(static_cast<std::uint64_t>(k_));
      AddF1(sample, f1(k_));
      AddF6(sample, f6(k_));
      noise_.Add(sample);
      last_ = engine_.Step(sample);
      opened_ = opened_ || last_.second.open;
      for (const Transition& transition : last_.Transitions()) {
        closed_ = closed_ || transition.kind == TransitionKind::kClosed;
      }
    }
  }

  // Sets the name that a look gives the episode at sample k.
  void Name(std::function<NameBeside(int)> name) { name_ = std::move(name); }

  const Verdict& last() const { return last_; }
  bool opened() const { return opened_; }
  bool closed() const { return closed_; }

 private:
  ValveEngine engine_;
  std::function<NameBeside(int)> name_;
  Noise noise_{3};
  Verdict last_;
  int k_{0};
  bool opened_{false};
  bool closed_{false};
};

PlantRun::Strength From(int begin, double strength, int until = 1 << 30) {
  return [=](int k) { return k >= begin && k < until ? strength : 0.0; };
}

double None(int /*k*/) {
  return 0.0;
}

TEST(StandingEffectTest, EffectsOnRodAndFlowMultiply) {
  ModelSet plant = LinearPlant();
  for (Observer& observer : plant.observers) {
    if (observer.fault == 3) {
      observer.channels[0] = LinearModel(Signal::kX, 0.8, 0.0);
    }
  }
  const auto models = std::make_shared<const ModelSet>(plant);
  const auto observers = std::make_shared<const ObserverPlan>(*models);
  const FaultPlan plan(observers);
  ObserverBank bank(observers);
  ObserverBank composed(observers);
  const Sample sample = PlantSample(0);  // CV 50: X 50, F 50
  bank.Initialise(sample);
  bank.Step(sample);
  for (const auto& [fault, x, f] :
       {std::tuple{2, 50.0, 55.0}, std::tuple{0, 45.0, 50.0}}) {
    const StrengthPath* path = nullptr;
    for (const StrengthPath& p : plan.paths()) {
      path = p.fault_index == static_cast<std::size_t>(fault) ? &p : path;
    }
    ComposeBank(bank, plan, {path, 0.25}, composed);
    // Observers: normal, f1 .5 and 1, f3 .5 and 1, f6 .5 and 1.
    EXPECT_NEAR(composed.prediction(0, 0), x, 1e-9);
    EXPECT_NEAR(composed.prediction(0, 1), f, 1e-9);
    EXPECT_NEAR(composed.residual(0, 1), 50.0 - f, 1e-9);
    EXPECT_NEAR(composed.prediction(4, 1), 70.0 * f / 50.0, 1e-9) << "f3";
    EXPECT_NEAR(composed.prediction(4, 0), 40.0 * x / 50.0, 1e-9) << "f3";
    EXPECT_NEAR(composed.prediction(2, 0), 30.0, 1e-9)
        << "f1 beside f6 takes as much, and beside itself is alone";
    EXPECT_EQ(composed.extrapolation(0, 1) > 0.0, fault == 2)
        << "what the effect may be off by";
  }
}

TEST(SecondFaultTest, ASecondFaultGetsItsOwnNameAndTheFirstKeepsIts) {
  PlantRun run;
  run.To(kSecond, From(kBegin, 0.5), None);
  ASSERT_EQ(run.last().isolated, kBitF1);
  EXPECT_FALSE(run.opened());
  run.To(kSecond + 120, From(kBegin, 0.5), From(kSecond, 0.5));
  const SecondFault& second = run.last().second;
  EXPECT_EQ(run.last().isolated, kBitF1);
  EXPECT_TRUE(second.open);
  EXPECT_EQ(second.standing, kBitF1);
  EXPECT_EQ(second.faults, kBitF6);
  EXPECT_NEAR(second.strength, 0.5, 0.05);
  EXPECT_NEAR(run.last().strengths[0], 0.5, 0.05);
  EXPECT_NEAR(static_cast<double>(second.detection_stamp_ns) * 1e-9,
              kSecond + 1, 3.0);
  EXPECT_FALSE(run.closed());
}

TEST(SecondFaultTest, WhereTheSecondOneEndsTheFirstIsLeft) {
  PlantRun run;
  run.To(1400, From(kBegin, 0.5), From(kSecond, 0.5, 1000));
  EXPECT_TRUE(run.opened());
  EXPECT_FALSE(run.last().second.open);
  EXPECT_EQ(run.last().isolated, kBitF1);
  EXPECT_FALSE(run.closed());
}

TEST(SecondFaultTest, WhereTheFirstEndsTheSecondOneIsAnEpisode) {
  PlantRun run;
  run.To(1400, From(kBegin, 0.5, 1000), From(kSecond, 0.5));
  EXPECT_TRUE(run.opened());
  EXPECT_TRUE(run.closed());
  EXPECT_EQ(run.last().isolated, kBitF6);
  EXPECT_FALSE(run.last().second.open);
}

TEST(SecondFaultTest, AFaultThatGrowsIsNoSecondOne) {
  for (const PlantRun::Strength& grows :
       {PlantRun::Strength([](int k) { return k < 800 ? 0.5 : 0.9; }),
        PlantRun::Strength([](int k) { return std::min(1.0, k / 1500.0); })}) {
    PlantRun run;
    run.To(1700, None, grows);
    EXPECT_EQ(run.last().isolated, kBitF6);
    EXPECT_FALSE(run.opened());
  }
}

// Before a fault is settled, what comes is not told apart from it.
TEST(SecondFaultTest, NothingIsSecondToAFaultThatIsNotSettled) {
  PlantRun run;
  run.To(500, From(kBegin, 0.5), From(kBegin + 200, 0.5));
  EXPECT_FALSE(run.opened());
}

// f7, which no observer tells from f1.
constexpr FaultSet kBitF7 = 4;

std::shared_ptr<const ModelSet> PlantWithTwin() {
  ModelSet models = *FittingPlant();
  const std::vector<Observer> observers = models.observers;
  for (Observer twin : observers) {
    if (twin.fault == 1) {
      twin.name = "f7";
      twin.fault = 7;
      models.observers.push_back(twin);
    }
  }
  models.faults = {1, 6, 7};
  return std::make_shared<const ModelSet>(models);
}

// f1 and f7, or f7 and f1, likeliest first.
NameBeside BothOf(bool f7_first) {
  return {kBitF1 | kBitF7,
          {{{f7_first ? 2U : 0U, 0.5}, {f7_first ? 0U : 2U, 0.5}}}};
}

NameBeside OneOf(std::size_t bit) {
  return {FaultSet{1} << bit, {{{bit, 0.5}}}};
}

TEST(SecondFaultTest, ANameWhoseFaultsChangePlacesStands) {
  PlantRun run(PlantWithTwin());
  run.Name([](int k) { return BothOf(k / 100 % 2 == 0); });
  run.To(kSecond + 120, From(kBegin, 0.5), From(kSecond, 0.5));
  const SecondFault& second = run.last().second;
  EXPECT_TRUE(second.open);
  EXPECT_EQ(second.standing, kBitF1 | kBitF7);
  EXPECT_EQ(second.faults, kBitF6);
}

TEST(SecondFaultTest, WhatIsLeftOfANameHasBeenWatchedAllAlong) {
  PlantRun run(PlantWithTwin());
  run.Name([](int k) {
    const bool back = k >= 350 && k < 400;
    return k < 300 || back ? BothOf(false) : OneOf(k < 600 ? 0 : 2);
  });
  run.To(kSecond + 120, From(kBegin, 0.5), From(kSecond, 0.5));
  const SecondFault& second = run.last().second;
  EXPECT_TRUE(second.open);
  EXPECT_EQ(second.standing, kBitF7);
  EXPECT_EQ(second.standing_bit, 2U);
  EXPECT_EQ(second.faults, kBitF6);
}

TEST(SecondFaultTest, ANameThatIsNewSettlesAnew) {
  PlantRun run(PlantWithTwin());
  run.Name([](int k) { return OneOf(k < 600 ? 0 : 2); });
  run.To(kSecond + 120, From(kBegin, 0.5), From(kSecond, 0.5));
  EXPECT_FALSE(run.opened());
}

TEST(SecondFaultTest, NothingIsSecondWhereFitIsNotJudged) {
  PlantRun run(FittingPlant(false));
  run.To(kSecond + 120, From(kBegin, 0.5), From(kSecond, 0.5));
  EXPECT_FALSE(run.opened());
}

}  // namespace
}  // namespace fdi::tests
