// A fault that was labelled on a valve is an observer of its own from then on.
#include "trainer/learning/taught_observers.h"

#include <memory>
#include <string>
#include <vector>

#include <gmock/gmock.h>

#include "base/error.h"
#include "diagnosis/decision/look_answer.h"
#include "diagnosis/model/taught.h"
#include "diagnosis/model/verdict.h"
#include "storage/models/model_codec.h"
#include "tests/diagnosis/linear_plant.h"
#include "trainer/evaluation.h"

namespace fdi::trainer {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr int kBefore = 100;  // samples before the fault

// f18 does what f6 does.
ModelSet Parent() {
  ModelSet models = tests::LinearPlant();
  models.name = "LV1";
  models.preset = "onboard";
  for (const double strength : {0.5, 1.0}) {
    Observer twin = tests::F6(strength);
    twin.name = "f18";
    twin.fault = 18;
    models.observers.push_back(twin);
  }
  models.faults.push_back(18);
  return models;
}

// F rises by `rise` · (1 + bend (CV - 50)) in the end; with f6 and f18 it does
// not depend on CV.
std::vector<Sample> Samples(int count, unsigned seed, double rise,
                            double bend = 0.0) {
  tests::Noise noise(seed);
  std::vector<Sample> samples;
  for (int k = 0; k < count; ++k) {
    Sample sample = tests::PlantSample(static_cast<std::uint64_t>(k));
    if (k >= kBefore) {
      sample.values[Index(Signal::kF)] +=
          rise * (1.0 + bend * (sample[Signal::kCv] - 50.0));
    }
    noise.Add(sample);
    samples.push_back(sample);
  }
  return samples;
}

Lesson LessonOf(const std::vector<Sample>& samples, int fault,
                double strength) {
  return {fault,
          strength,
          {{"episode", {samples.begin() + kBefore, samples.end()}}}};
}

std::vector<int> Named(const ModelSet& models,
                       const std::vector<Sample>& samples) {
  TrainingRun run;
  for (const Sample& sample : samples) {
    run.samples.push_back({sample, FaultTruth{}});
  }
  return ScoreRun(std::make_shared<const ModelSet>(models), run)
      .back()
      .isolated;
}

ModelSet TaughtF6() {
  const ModelSet parent = Parent();
  return WithTaught(parent,
                    {Teach(parent, LessonOf(Samples(400, 1, 12.0), 6, 0.6))});
}

TEST(TaughtObserversTest, WhatWasOneOfSeveralIsNamedAloneTheNextTime) {
  const std::vector<Sample> again = Samples(400, 2, 12.0);
  ASSERT_THAT(Named(Parent(), again), ElementsAre(6, 18));

  EXPECT_THAT(Named(TaughtF6(), again), ElementsAre(6));
  // A little stronger, as the next time may be.
  EXPECT_THAT(Named(TaughtF6(), Samples(400, 3, 13.0)), ElementsAre(6));
}

TEST(TaughtObserversTest, OtherNamesStay) {
  const ModelSet taught = TaughtF6();
  EXPECT_THAT(Named(taught, Samples(kBefore, 4, 0.0)), IsEmpty());
  // Episodes of other strengths than the labelled one.
  EXPECT_THAT(Named(taught, Samples(400, 5, 19.0)), ElementsAre(6, 18));
  EXPECT_THAT(Named(taught, Samples(400, 6, 16.0, 0.02)), ElementsAre(3));
}

TEST(TaughtObserversTest, AllElseOfTheParentStaysBitForBit) {
  ModelSet taught = TaughtF6();
  ASSERT_TRUE(IsTaught(taught.observers.back()));
  EXPECT_EQ(taught.observers.back().name, "f6 0.60 taught");
  taught.observers.pop_back();
  EXPECT_EQ(storage::EncodeModelSet(taught), storage::EncodeModelSet(Parent()));
}

// On this valve the flow rises with the command, which no observer of the
// parent says of any fault.
TEST(TaughtObserversTest, LearnsWhatTheFaultDoesToThisValve) {
  const ModelSet parent = Parent();
  const std::vector<Sample> again = Samples(500, 8, 12.0, -0.02);
  ASSERT_THAT(Named(parent, again), testing::Not(ElementsAre(6)));

  const TaughtObserver one =
      Teach(parent, LessonOf(Samples(500, 7, 12.0, -0.02), 6, 0.6));

  EXPECT_GT(one.gain_over_former, 100.0);
  EXPECT_THAT(Named(WithTaught(parent, {one}), again), ElementsAre(6));
}

TEST(TaughtObserversTest, AFaultThatTheParentDoesNotKnowIsAdded) {
  const ModelSet parent = Parent();
  const TaughtObserver one =
      Teach(parent, LessonOf(Samples(400, 1, -9.0), 2, 0.4));
  EXPECT_EQ(one.adapted_from, "");
  const ModelSet taught = WithTaught(parent, {one});
  EXPECT_THAT(taught.faults, ElementsAre(1, 2, 3, 6, 18));
  EXPECT_THAT(Named(taught, Samples(400, 2, -9.0)), ElementsAre(2));
  EXPECT_THAT(Named(taught, Samples(400, 2, 12.0)), ElementsAre(6, 18));
}

std::string RefusalOf(const Lesson& lesson) {
  try {
    Teach(Parent(), lesson);
  } catch (const DataError& error) {
    return error.what();
  }
  return "";
}

TEST(TaughtObserversTest, TooLittleTeachesNothingAndTheNumbersSayWhy) {
  EXPECT_THAT(RefusalOf(LessonOf(Samples(kBefore + 40, 1, 12.0), 6, 0.6)),
              AllOf(HasSubstr("f6: 24 samples"), HasSubstr("needed are 50")));
  EXPECT_THAT(RefusalOf(LessonOf(Samples(400, 1, 0.02), 6, 0.05)),
              AllOf(HasSubstr("within the noise"), HasSubstr("300 samples"),
                    HasSubstr("needed is 9")));
}

TEST(TaughtObserversTest, LessonsOfOneFaultAndStrengthAreOne) {
  const std::vector<Sample> samples = Samples(400, 1, 12.0);
  const std::vector<Lesson> lessons =
      JoinLessons({LessonOf(samples, 6, 0.6), LessonOf(samples, 6, 0.62),
                   LessonOf(samples, 6, 0.9), LessonOf(samples, 3, 0.6)});
  ASSERT_EQ(lessons.size(), 3U);
  EXPECT_EQ(lessons.front().stretches.size(), 2U);
}

// The physics leaves f6 and f18; the observers have met f6 on this valve.
TEST(TaughtNamesTest, StandForTheSetOfThePhysicsThatHoldsThem) {
  const ModelSet models = TaughtF6();
  Verdict engine;
  engine.isolated = FaultSet{1} << FaultIndex(models, 6);
  engine.strengths[static_cast<std::size_t>(FaultIndex(models, 6))] = 0.66;
  LookAnswer answer;
  answer.outcome = LookOutcome::kNamed;
  answer.faults = {{.fault = 6}, {.fault = 18}};
  EXPECT_THAT(*NamesBeside(engine, models, answer), ElementsAre(6));

  // Not where they say more than what was taught, at another strength, or
  // something that the physics excludes.
  Verdict stronger = engine;
  stronger.strengths[static_cast<std::size_t>(FaultIndex(models, 6))] = 0.9;
  EXPECT_THAT(*NamesBeside(stronger, models, answer), ElementsAre(6, 18));
  Verdict several = engine;
  several.isolated |= FaultSet{1} << FaultIndex(models, 3);
  EXPECT_THAT(*NamesBeside(several, models, answer), ElementsAre(6, 18));
  answer.faults = {{.fault = 1}};
  EXPECT_THAT(*NamesBeside(engine, models, answer), ElementsAre(1));

  // Where no hypothesis follows the record, what was seen before does.
  answer.outcome = LookOutcome::kNoneFits;
  EXPECT_FALSE(NamesBeside(engine, models, answer).has_value());
}

}  // namespace
}  // namespace fdi::trainer
