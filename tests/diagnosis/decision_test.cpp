#include "diagnosis/decision/decision.h"

#include <cmath>
#include <memory>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "diagnosis/decision/look_answer.h"
#include "tests/monitor/linear_models.h"

namespace fdi {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

constexpr FaultSet kBitOfF1 = 0b01;
constexpr FaultSet kBitOfF7 = 0b10;
constexpr std::uint64_t kFaultBegins = 60;

// Finds f1 at half its strength in every window, far ahead of no fault.
class FindsF1 final : public LookSimulation {
 public:
  FindsF1() : LookSimulation({}) {}
  double HealthyFlow(const InputRow& /*input*/,
                     double /*x_pct*/) const override {
    return 1.0;
  }
  SecondLook Look(const LookWindow& window,
                  const std::stop_token& /*stop*/) const override {
    SecondLook look;
    look.ranked.resize(3);
    look.ranked[2].fault = 2;
    look.ranked[2].distance = 3900.0;
    look.ranked[0].fault = 1;
    look.ranked[0].strength = 0.5;
    look.ranked[1].distance = 100.0;
    look.misfit = 1.0;
    look.readings = 100.0;
    look.best.resize(window.rows.size());
    return look;
  }
  StrengthLook Strengths(const LookWindow& /*window*/,
                         const std::vector<Explanation>& known,
                         const std::stop_token& /*stop*/) const override {
    return {known, 1.0};
  }
  double Misfit(const LookWindow& /*window*/) const override { return 1.0; }
};

// A valve that the observers see with f7 from kFaultBegins on.
class DecisionTest : public testing::Test {
 protected:
  // Samples [next_, end).
  void Feed(std::uint64_t end, double offset) {
    for (; next_ < end; ++next_) {
      const Verdict& verdict =
          decision_.Step(monitor::PlantSample(next_, offset));
      for (const Transition& t : verdict.Transitions()) {
        kinds_.push_back(t.kind);
        last_ = t;
      }
      for (LookTask& task : decision_.TakeDue()) {
        due_.push_back(task);
        if (auto answer = TakeLook(*decision_.simulation(), task);
            answer && answers_) {
          decision_.Answer(task, std::move(*answer));
        }
      }
    }
  }
  void FeedF7(std::uint64_t end) { Feed(end, monitor::kF7Offset); }

  Decision decision_{EngineParts(monitor::SharedLinearModels()),
                     std::make_shared<const FindsF1>()};
  std::vector<TransitionKind> kinds_;
  std::vector<LookTask> due_;
  Transition last_;
  bool answers_{true};
  std::uint64_t next_{0};
};

TEST_F(DecisionTest, TheObserversNameAnEpisodeUntilALookDoes) {
  using enum TransitionKind;
  Feed(kFaultBegins, 0.0);
  EXPECT_THAT(kinds_, IsEmpty());
  FeedF7(kFaultBegins + 35);
  EXPECT_THAT(kinds_, ElementsAre(kDetected, kIsolated));
  EXPECT_EQ(decision_.verdict().isolated, kBitOfF7);
  EXPECT_EQ(decision_.names().now().source, NameSource::kObservers);

  FeedF7(kFaultBegins + 80);
  EXPECT_EQ(decision_.verdict().isolated, kBitOfF1);
  EXPECT_EQ(decision_.engine().isolated, kBitOfF7) << "it is not changed";
  EXPECT_EQ(last_.kind, kReisolated);
  EXPECT_EQ(last_.layer, Layer::kPhysics);
  EXPECT_EQ(last_.strength, 0.5);
  const auto look = decision_.TakeLook();
  ASSERT_TRUE(look);
  // The mean square error of 1 by f1, and 3900 / 100 readings more by f2.
  EXPECT_EQ(look->rival, (LookRival{2, 40.0}));
  EXPECT_THAT(look->observers, ElementsAre(7));

  Feed(kFaultBegins + 200, 0.0);
  EXPECT_EQ(last_.kind, kClosed);
  EXPECT_EQ(last_.faults, kBitOfF1);
  EXPECT_FALSE(decision_.episode_open());
}

TEST_F(DecisionTest, AnEndFromOutsideHasTheNameAndForgetsTheLooks) {
  Feed(kFaultBegins, 0.0);
  EXPECT_FALSE(decision_.End(EndReason::kStreamEnded));
  FeedF7(kFaultBegins + 80);
  const auto closed = decision_.End(EndReason::kStreamEnded);
  ASSERT_TRUE(closed);
  EXPECT_EQ(closed->faults, kBitOfF1);
  EXPECT_EQ(closed->reason, EndReason::kStreamEnded);
  EXPECT_FALSE(decision_.verdict().detected);

  answers_ = false;
  ASSERT_FALSE(due_.empty());
  decision_.Answer(due_.back(),
                   *TakeLook(*decision_.simulation(), due_.back()));
  FeedF7(kFaultBegins + 200);
  EXPECT_EQ(decision_.verdict().isolated, kBitOfF7) << "of another episode";
}

// X is 20 % wrong once, and one sample has none; a look sees neither.
TEST_F(DecisionTest, ALookTakesNoWrongReadingAndKeepsItsRowsOverMissingOnes) {
  Feed(30, 0.0);
  Feed(31, 20.0);
  for (const std::uint64_t k : {40, 50}) {
    Feed(k, 0.0);
    Sample sample = monitor::PlantSample(next_++);
    sample.present =
        static_cast<SignalMask>(sample.present & ~MaskOf(Signal::kX));
    decision_.Step(sample);
  }
  Feed(kFaultBegins, 0.0);
  FeedF7(kFaultBegins + 80);
  ASSERT_FALSE(due_.empty());
  const std::vector<RecordRow>& rows = due_.front().window.rows;
  ASSERT_GT(rows.size(), kFaultBegins);
  for (std::size_t k = 0; k < kFaultBegins; ++k) {
    EXPECT_EQ(rows[k].x_measured, k != 30 && k != 40 && k != 50) << k;
    EXPECT_LT(std::abs(rows[k].x_pct - rows[k].input.cv_pct), 10.0) << k;
  }
}

TEST_F(DecisionTest, AnAnswerMayComeManySamplesLater) {
  answers_ = false;
  Feed(kFaultBegins, 0.0);
  FeedF7(kFaultBegins + 120);
  EXPECT_EQ(decision_.verdict().isolated, kBitOfF7);
  const LookTask& task = due_.back();
  ASSERT_FALSE(task.early());
  decision_.Answer(task, *TakeLook(*decision_.simulation(), task));
  EXPECT_EQ(decision_.verdict().isolated, kBitOfF7) << "not between samples";
  FeedF7(kFaultBegins + 121);
  EXPECT_EQ(decision_.verdict().isolated, kBitOfF1);
}

TEST_F(DecisionTest, ANameOfAnEarlierSessionIsAnInput) {
  OpenEpisode left;
  left.isolated = true;
  left.faults = kBitOfF1;
  left.layer = Layer::kPhysics;
  answers_ = false;
  decision_.Inherit(&left);
  Feed(kFaultBegins, 0.0);
  FeedF7(kFaultBegins + 35);
  EXPECT_EQ(decision_.verdict().isolated, kBitOfF1);
  EXPECT_THAT(kinds_, ElementsAre(TransitionKind::kDetected))
      << "it was announced by that session";
}

TEST_F(DecisionTest, AnotherSetEndsTheEpisodeWithTheNameOfTheOldOne) {
  Feed(kFaultBegins, 0.0);
  FeedF7(kFaultBegins + 80);
  const auto closed =
      decision_.Adopt(EngineParts(monitor::SharedLinearModels(0x99)), nullptr);
  ASSERT_TRUE(closed);
  EXPECT_EQ(closed->reason, EndReason::kModelChanged);
  EXPECT_EQ(closed->faults, kBitOfF1);
  due_.clear();
  FeedF7(kFaultBegins + 200);
  EXPECT_THAT(due_, IsEmpty()) << "nothing to look with";
}

}  // namespace
}  // namespace fdi
