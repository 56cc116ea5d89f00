#include "diagnosis/decision/episode_name.h"

#include <memory>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "diagnosis/model/fault_catalogue.h"
#include "tests/monitor/linear_models.h"

namespace fdi {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using Kind = TransitionKind;

constexpr FaultSet kFault1 = 0b001;
constexpr FaultSet kFault7 = 0b010;
constexpr FaultSet kFinding = 0b100;

// f1, f7 and a finding of the floor. A fault is medium, from 0.25 on high, from
// 0.6 on critical.
class EpisodeNameTest : public testing::Test {
 protected:
  static std::shared_ptr<const ModelSet> Models() {
    ModelSet models = monitor::LinearModels();
    models.faults.push_back(kFirstFinding);
    return std::make_shared<const ModelSet>(std::move(models));
  }
  static std::shared_ptr<const SeverityCatalogue> Severities() {
    const SeverityBands bands{{0.0, Severity::kMedium},
                              {0.25, Severity::kHigh},
                              {0.6, Severity::kCritical}};
    return std::make_shared<const SeverityCatalogue>(
        SeverityCatalogue{{1, bands},
                          {7, bands},
                          {kFirstFinding, {{0.0, Severity::kLow}}},
                          {0, {{0.0, Severity::kMedium}}}});
  }

  // The next sample: what the engine isolates from it on, and its transitions.
  const Verdict& Step(FaultSet isolated, std::vector<Kind> kinds = {},
                      Intake intake = Intake::kAccepted) {
    Verdict& v = engine_;
    v.stamp_ns += intake == Intake::kAccepted ? 1'000'000'000 : 0;
    v.intake = intake;
    v.isolated = isolated;
    v.transition_count = 0;
    for (const Kind kind : kinds) {
      Transition& t =
          v.transitions[static_cast<std::size_t>(v.transition_count++)];
      t = {};
      t.kind = kind;
      t.stamp_ns = v.stamp_ns;
      t.detection_stamp_ns = 7;
      t.faults = kind == Kind::kDetected ? 0 : isolated;
      v.detected = kind != Kind::kCleared && kind != Kind::kClosed;
    }
    v.state = !v.detected     ? State::kNormal
              : isolated != 0 ? State::kIsolated
                              : State::kDetected;
    name_.Step({v, look_, can_look_, on_top_});
    Note();
    return name_.verdict();
  }

  void Note() {
    for (const Transition& t : name_.verdict().Transitions()) {
      kinds_.push_back(t.kind);
      names_.push_back(t.faults);
      last_ = t;
    }
  }

  void Follow(int fault, double strength, double half) {
    std::vector<StrengthPoint> points(1);
    points[0].fault = fault;
    points[0].strength = strength;
    points[0].lowest = strength - half;
    points[0].highest = strength + half;
    Step(engine_.isolated);
    name_.Follow(points);
    kinds_.clear();
    names_.clear();
    Note();
    point_ = points[0];
  }

  OpenEpisode Left(FaultSet faults, Layer layer = Layer::kObservers) const {
    OpenEpisode left;
    left.episode_id = 5;
    left.isolated = true;
    left.faults = faults;
    left.layer = layer;
    left.candidates = {{7, 0.9, 0.7, true}};
    left.severity = Severity::kCritical;
    return left;
  }

  std::shared_ptr<const ModelSet> models_{Models()};
  EpisodeName name_{models_, Severities()};
  Verdict engine_;
  std::optional<EpisodeName::Look> look_;
  std::optional<EpisodeName::Look> on_top_;
  bool can_look_{false};
  std::vector<Kind> kinds_;
  std::vector<FaultSet> names_;
  Transition last_;
  StrengthPoint point_;
};

TEST_F(EpisodeNameTest, TheFloorNamesItUntilTheObserversDo) {
  engine_.strengths[1] = 0.3;
  Step(0, {Kind::kDetected});
  EXPECT_EQ(name_.now().source, NameSource::kNone);
  Step(kFinding, {Kind::kIsolated});
  EXPECT_EQ(name_.now().source, NameSource::kFloor);
  EXPECT_EQ(name_.now().severity, Severity::kLow);
  Step(kFault7, {Kind::kReisolated});
  EXPECT_EQ(name_.now().source, NameSource::kObservers);
  EXPECT_EQ(name_.now().severity, Severity::kHigh);

  EXPECT_THAT(kinds_,
              ElementsAre(Kind::kDetected, Kind::kIsolated, Kind::kReisolated));
  EXPECT_THAT(names_, ElementsAre(0U, kFinding, kFault7));
  EXPECT_EQ(last_.strength, 0.3);
  EXPECT_EQ(last_.severity, Severity::kHigh);
  EXPECT_EQ(last_.detection_stamp_ns, 7);
}

TEST_F(EpisodeNameTest, ALookOutranksTheObserversToTheEnd) {
  Step(0, {Kind::kDetected});
  Step(kFault7, {Kind::kIsolated});
  look_ = EpisodeName::Look{{{0, {-0.7, -0.8, -0.6}}}, false};
  EXPECT_EQ(Step(kFault7).isolated, kFault1);
  EXPECT_EQ(name_.now().source, NameSource::kLook);
  EXPECT_EQ(last_.kind, Kind::kReisolated);
  EXPECT_EQ(last_.layer, Layer::kPhysics);
  EXPECT_EQ(last_.lowest, -0.8);
  EXPECT_EQ(last_.severity, Severity::kCritical);
  Step(kFault7 | kFault1, {Kind::kReisolated});
  look_.reset();
  Step(kFault7, {Kind::kCleared, Kind::kClosed});

  EXPECT_THAT(names_, ElementsAre(0U, kFault7, kFault1, kFault1, kFault1))
      << "the observers named it";
}

TEST_F(EpisodeNameTest, ALookThatNothingFitsSaysUnknown) {
  Step(0, {Kind::kDetected});
  Step(kFault7, {Kind::kIsolated});
  look_ = EpisodeName::Look{{}, true};
  const Verdict& verdict = Step(kFault7);
  EXPECT_EQ(verdict.state, State::kDetected);
  EXPECT_EQ(verdict.unknown, Unknown::kOutsideKnown);
  EXPECT_EQ(last_.kind, Kind::kReisolated);
  EXPECT_EQ(last_.faults, 0U);
}

TEST_F(EpisodeNameTest, AnInheritedNameStandsUntilTheObserversNameAFault) {
  const OpenEpisode left = Left(kFault7);
  name_.Inherit(&left);
  Step(0, {Kind::kDetected});
  EXPECT_EQ(name_.now().source, NameSource::kRestart);
  EXPECT_EQ(name_.now().severity, Severity::kCritical);
  EXPECT_EQ(name_.now().strength().strength, 0.7);
  EXPECT_EQ(Step(kFinding, {Kind::kIsolated}).isolated, kFault7);
  Step(kFault7, {Kind::kReisolated});
  EXPECT_EQ(name_.now().source, NameSource::kObservers);
  EXPECT_THAT(kinds_, ElementsAre(Kind::kDetected)) << "it was announced";

  Step(kFault1, {Kind::kReisolated});
  Step(kFinding, {Kind::kReisolated});
  EXPECT_THAT(names_, ElementsAre(0U, kFault1, kFinding));
  EXPECT_EQ(last_.kind, Kind::kReisolated);
}

TEST_F(EpisodeNameTest, WhatIsOnTopOfAnInheritedNameStandsAsLongAsThat) {
  OpenEpisode left = Left(kFault7);
  left.second.open = true;
  left.second.faults = kFault1;
  name_.Inherit(&left);
  EXPECT_EQ(Step(0, {Kind::kDetected}).second.faults, kFault1);
  EXPECT_EQ(Step(0).second.faults, kFault1);
  EXPECT_THAT(kinds_, ElementsAre(Kind::kDetected)) << "it was announced";

  EXPECT_FALSE(Step(kFault7, {Kind::kIsolated}).second.open);
  EXPECT_THAT(kinds_, ElementsAre(Kind::kDetected, Kind::kSecond));
  EXPECT_FALSE(last_.second.open);
  EXPECT_EQ(last_.faults, kFault7);
}

TEST_F(EpisodeNameTest, TwoInheritedFaultsAreNotRenamedAsAThird) {
  OpenEpisode left = Left(kFault7);
  left.second.open = true;  // Its name is not known.
  name_.Inherit(&left);
  Step(0, {Kind::kDetected});
  EXPECT_EQ(Step(kFault1, {Kind::kIsolated}).isolated, kFault7);
  for (const std::vector<NamedFault>& faults :
       {std::vector<NamedFault>{{0, {0.1, 0.0, 0.2}}}, {}}) {
    look_ = EpisodeName::Look{faults, faults.empty()};
    EXPECT_EQ(Step(kFault1).isolated, kFault7);
    EXPECT_TRUE(name_.verdict().second.open);
  }
  look_ = EpisodeName::Look{{{1, {0.5, 0.4, 0.6}}}, false};
  EXPECT_EQ(Step(kFault1).isolated, kFault7);
  EXPECT_FALSE(name_.verdict().second.open);
}

TEST_F(EpisodeNameTest, AnInheritedNameEndsTheEpisodeIfNothingReplacesIt) {
  const OpenEpisode left = Left(kFault7);
  for (const bool outside : {false, true}) {
    names_.clear();
    name_.Inherit(&left);
    Step(0, {Kind::kDetected});
    Step(kFinding, {Kind::kIsolated});
    if (outside) {
      Transition closed;
      closed.faults = kFinding;
      EXPECT_EQ(name_.End(closed).faults, kFault7);
      engine_.detected = false;
    } else {
      Step(kFinding, {Kind::kCleared, Kind::kClosed});
      EXPECT_THAT(names_, ElementsAre(0U, kFault7, kFault7));
    }
  }
}

TEST_F(EpisodeNameTest, AnInheritedLookWaitsForALookWhereThereAreAny) {
  const OpenEpisode left = Left(kFault7, Layer::kPhysics);
  for (const bool can_look : {false, true}) {
    can_look_ = can_look;
    look_.reset();
    name_.Inherit(&left);
    Step(0, {Kind::kDetected});
    EXPECT_EQ(Step(kFault1, {Kind::kIsolated}).isolated,
              can_look ? kFault7 : kFault1);
    look_ = EpisodeName::Look{{{0, {0.1, 0.0, 0.2}}}, false};
    EXPECT_EQ(Step(0).isolated, kFault1);
    Step(0, {Kind::kCleared, Kind::kClosed});
  }
}

TEST_F(EpisodeNameTest, AnInheritedLookDoesNotWaitForEver) {
  const OpenEpisode left = Left(kFault7, Layer::kPhysics);
  can_look_ = true;
  name_.Inherit(&left);
  Step(0, {Kind::kDetected});
  Step(kFault1, {Kind::kIsolated});
  for (int k = 3; k <= 600; ++k) {
    ASSERT_EQ(Step(kFault1).isolated, kFault7) << k;
  }
  EXPECT_EQ(Step(kFault1).isolated, kFault1);
  EXPECT_EQ(name_.now().source, NameSource::kObservers);
}

TEST_F(EpisodeNameTest, AFaultThatGetsMoreSevereIsAnnouncedOnce) {
  engine_.strengths[1] = 0.025;
  Step(0, {Kind::kDetected});
  Step(kFault7, {Kind::kIsolated});
  EXPECT_EQ(name_.now().severity, Severity::kMedium);
  Follow(7, 0.2, 0.01);
  EXPECT_THAT(kinds_, IsEmpty());
  EXPECT_EQ(name_.verdict().strengths[1], 0.2);
  Follow(7, 0.27, 0.05);  // It may still be less than 0.25.
  EXPECT_THAT(kinds_, IsEmpty());
  EXPECT_EQ(point_.severity, Severity::kMedium);

  Follow(7, 0.99, 0.01);
  EXPECT_THAT(kinds_, ElementsAre(Kind::kChanged));
  EXPECT_EQ(last_.faults, kFault7);
  EXPECT_EQ(last_.severity, Severity::kCritical);
  EXPECT_EQ(last_.strength, 0.99);
  EXPECT_EQ(last_.highest, 1.0);
  EXPECT_EQ(point_.severity, Severity::kCritical);

  Follow(7, 0.1, 0.01);
  EXPECT_EQ(name_.now().severity, Severity::kMedium);
  Follow(7, 0.7, 0.01);
  EXPECT_THAT(kinds_, IsEmpty()) << "it was critical before";
  EXPECT_EQ(name_.now().severity, Severity::kCritical);
}

TEST_F(EpisodeNameTest, ASecondFaultIsAnnouncedAndNoLookAtBothRenames) {
  Step(0, {Kind::kDetected});
  Step(kFault1, {Kind::kIsolated});
  kinds_.clear();
  engine_.second.doubt = true;
  engine_.second.standing = kFault1;
  look_ = EpisodeName::Look{{{1, {0.3, 0.2, 0.4}}}, false};
  EXPECT_EQ(Step(kFault1).isolated, kFault1) << "it may be a look at both";
  EXPECT_THAT(kinds_, IsEmpty());
  engine_.second.doubt = false;
  engine_.second.open = true;
  engine_.second.faults = kFault7;
  EXPECT_EQ(Step(kFault1).isolated, kFault1);
  EXPECT_THAT(kinds_, ElementsAre(Kind::kSecond));
  EXPECT_EQ(last_.faults, kFault1);
  EXPECT_EQ(last_.second.faults, kFault7);
  kinds_.clear();
  Step(kFault1);
  EXPECT_THAT(kinds_, IsEmpty());

  engine_.second = {};
  EXPECT_EQ(Step(kFault1).isolated, kFault7) << "looks are heard again";
  EXPECT_THAT(kinds_, ElementsAre(Kind::kReisolated, Kind::kSecond));
  EXPECT_FALSE(last_.second.open);
  EXPECT_EQ(name_.beside().faults, kFault7);
  EXPECT_EQ(name_.beside().likely[0].strength, 0.3);
}

TEST_F(EpisodeNameTest, TheEngineIsToldEachFaultOfALookLikeliestFirst) {
  Step(0, {Kind::kDetected});
  look_ =
      EpisodeName::Look{{{1, {0.3, 0.2, 0.4}}, {0, {-0.5, -0.6, -0.4}}}, false};
  Step(kFault1);
  EXPECT_EQ(name_.beside().faults, kFault1 | kFault7);
  EXPECT_EQ(name_.beside().likely[0].bit, 1U);
  EXPECT_EQ(name_.beside().likely[0].strength, 0.3);
  EXPECT_EQ(name_.beside().likely[1].bit, 0U);
  EXPECT_EQ(name_.beside().likely[1].strength, -0.5);
}

TEST_F(EpisodeNameTest, ALookAtWhatIsOnTopNamesIt) {
  Step(0, {Kind::kDetected});
  Step(kFault1, {Kind::kIsolated});
  engine_.second.open = true;
  engine_.second.standing = kFault1;
  Step(kFault1);
  EXPECT_EQ(last_.second.faults, 0U) << "more than one fault";
  kinds_.clear();
  on_top_ = EpisodeName::Look{{{1, {0.3, 0.2, 0.4}}}, false};
  EXPECT_EQ(Step(kFault1).isolated, kFault1);
  EXPECT_THAT(kinds_, ElementsAre(Kind::kSecond));
  EXPECT_EQ(last_.second.faults, kFault7);
  EXPECT_EQ(last_.second.strength, 0.3);
  // None that it knows fits on top of f1, whatever the observers say.
  engine_.second.faults = kFault7;
  on_top_ = EpisodeName::Look{{}, true};
  EXPECT_EQ(Step(kFault1).second.faults, 0U);
  engine_.second.open = false;
  EXPECT_FALSE(Step(kFault1).second.open) << "it is the engine that sees it";
}

TEST_F(EpisodeNameTest, TheGravestOfASetCountsAtItsOwnStrength) {
  engine_.fault_factors[0] = 0.9;
  engine_.fault_factors[1] = 0.8;
  engine_.strengths[0] = 0.1;
  engine_.strengths[1] = 0.3;
  Step(0, {Kind::kDetected});
  Step(kFault1 | kFault7, {Kind::kIsolated});
  EXPECT_EQ(last_.strength, 0.1) << "the likeliest one is f1";
  EXPECT_EQ(last_.severity, Severity::kHigh);
  Follow(7, 0.8, 0.01);
  EXPECT_THAT(kinds_, ElementsAre(Kind::kChanged));
  EXPECT_EQ(point_.severity, std::nullopt) << "f1 has the strength of the name";
}

TEST_F(EpisodeNameTest, ALateSampleDatesNoChange) {
  Step(0, {Kind::kDetected});
  look_ = EpisodeName::Look{{{1, {0.1, 0.0, 0.2}}}, false};
  EXPECT_EQ(Step(0, {}, Intake::kLate).isolated, 0U);
  EXPECT_THAT(kinds_, ElementsAre(Kind::kDetected));
  EXPECT_EQ(Step(0).isolated, kFault7);
  EXPECT_THAT(kinds_, ElementsAre(Kind::kDetected, Kind::kIsolated));
}

TEST_F(EpisodeNameTest, FromANewSourceOneSampleEndsAnEpisodeAndBeginsOne) {
  Step(0, {Kind::kDetected});
  Step(kFault7, {Kind::kIsolated});
  Step(kFault1, {Kind::kClosed, Kind::kDetected, Kind::kIsolated});
  EXPECT_THAT(kinds_,
              ElementsAre(Kind::kDetected, Kind::kIsolated, Kind::kClosed,
                          Kind::kDetected, Kind::kIsolated));
  EXPECT_THAT(names_, ElementsAre(0U, kFault7, kFault7, 0U, kFault1));
}

}  // namespace
}  // namespace fdi
