#include "diagnosis/loop/loop_watch.h"

#include <cmath>
#include <set>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "diagnosis/model/fault_catalogue.h"
#include "tests/diagnosis/loop/closed_loop.h"

namespace fdi {
namespace {

using loop::ClosedLoop;
using loop::LoopState;
using testing::ElementsAre;
using testing::IsEmpty;

constexpr std::int64_t kSecond = 1'000'000'000;
constexpr std::int64_t kStart = 1'700'000'000 * kSecond;

// The severity of a dead band from 1 and from 3 % on.
std::shared_ptr<const SeverityCatalogue> Severities() {
  return std::make_shared<const SeverityCatalogue>(
      SeverityCatalogue{{kStiction,
                         {{0.0, Severity::kLow},
                          {0.01, Severity::kMedium},
                          {0.03, Severity::kHigh}}}});
}

class LoopWatchTest : public testing::Test {
 protected:
  // The loop's samples in % of closing: F falls with CV.
  void Feed(const loop::Window& loop, bool with_x = false) {
    for (std::size_t k = 0; k < loop.op.size(); ++k) {
      Sample sample = At(seq_ + 1, 100.0 - loop.op[k], loop.pv[k]);
      if (with_x) {
        sample.Set(Signal::kX, 100.0 - loop.x[k]);
      }
      Give(sample);
    }
  }
  // The next sample of all that have come.
  static Sample At(std::uint64_t seq, double cv, double f) {
    Sample sample;
    sample.seq = seq;
    sample.source_id = 7;
    sample.stamp_ns = kStart + static_cast<std::int64_t>(seq) * 10 * kSecond;
    sample.Set(Signal::kCv, cv);
    sample.Set(Signal::kF, f);
    return sample;
  }
  const Verdict& Give(const Sample& sample, double period_s = 10.0) {
    seq_ = sample.seq;
    const Verdict& verdict = watch_.Step(sample, period_s);
    for (const Transition& transition : verdict.Transitions()) {
      told_.push_back(transition);
    }
    normal_ += watch_.found_normal() ? 1 : 0;
    if (auto window = watch_.TakeWindow()) {
      ++audits_;
      watch_.Enter(AuditValve(std::move(*window)));
    }
    return verdict;
  }
  std::vector<TransitionKind> Kinds() const {
    std::vector<TransitionKind> kinds;
    for (const Transition& transition : told_) {
      kinds.push_back(transition.kind);
    }
    return kinds;
  }
  void Again() {
    watch_ = LoopWatch(0, Severities());
    told_.clear();
    audits_ = normal_ = 0;
    seq_ = 0;
  }

  LoopWatch watch_{0, Severities()};
  std::vector<Transition> told_;
  std::uint64_t seq_{0};
  int audits_{0};
  int normal_{0};
};

ClosedLoop Sticky() {
  return {.state = LoopState::kSticky,
          .band = 4.0,
          .noise = 0.02,
          .steps = true,
          .samples = 1100};
}

TEST_F(LoopWatchTest, StickyLoopsHaveAnEpisodeAndSoundOnesHaveNone) {
  int sticky = 0;
  int others = 0;
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    Again();
    Feed(loop::Simulate(Sticky(), seed));
    if (!told_.empty()) {
      ++sticky;
      ASSERT_THAT(Kinds(), ElementsAre(TransitionKind::kDetected,
                                       TransitionKind::kIsolated))
          << seed;
      EXPECT_EQ(watch_.verdict().isolated, 1U);
      EXPECT_EQ(told_[1].layer, Layer::kAudit);
      EXPECT_EQ(told_[1].severity, told_[1].strength >= 0.03
                                       ? Severity::kHigh
                                       : Severity::kMedium);
      EXPECT_GT(told_[1].strength, 0.02);
      EXPECT_LT(told_[1].strength, 0.05);
      EXPECT_LE(told_[1].lowest, told_[1].strength);
      // Known by the first of three windows.
      EXPECT_EQ(told_[0].stamp_ns - told_[0].detection_stamp_ns,
                (2 * 1200 + 10) * kSecond);
    }
    Again();
    Feed(loop::Simulate({.steps = true, .samples = 1100}, seed));
    others += told_.empty() ? 0 : 1;
    EXPECT_EQ(normal_, 1) << seed;
    EXPECT_EQ(watch_.verdict().quality, Quality::kLive);
    EXPECT_EQ(watch_.verdict().state, State::kNormal);
  }
  EXPECT_GE(sticky, 8);
  EXPECT_EQ(others, 0);
}

// A loop whose PV is a pressure in bar or a level in m, beside an F that only
// the noise of a pump moves.
class LoopWatchPvTest : public LoopWatchTest {
 protected:
  void FeedPv(const loop::Window& loop) {
    for (std::size_t k = 0; k < loop.op.size(); ++k) {
      Sample sample = At(seq_ + 1, 100.0 - loop.op[k],
                         7.0 + 0.01 * static_cast<double>(k * k % 23));
      sample.Set(Signal::kPv, 0.2 * loop.pv[k]);
      sample.Set(Signal::kSp, 0.2 * loop.sp[k]);
      Give(sample);
    }
  }
};

TEST_F(LoopWatchPvTest, AStickyPressureLoopIsFoundAndASoundOneIsNot) {
  int sticky = 0;
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    Again();
    FeedPv(loop::Simulate(Sticky(), seed));
    sticky += watch_.verdict().isolated == 1U ? 1 : 0;
    Again();
    FeedPv(loop::Simulate({.steps = true, .samples = 1100}, seed));
    EXPECT_THAT(told_, IsEmpty()) << seed;
    EXPECT_EQ(normal_, 1) << seed;
  }
  EXPECT_GE(sticky, 6);
}

// The integral of a valve lags as a play does, and PV cannot tell the two
// apart: of a sound one nothing is said, and of a sticky one no more.
TEST_F(LoopWatchPvTest, ALevelIsNeverCalledSticky) {
  for (const bool known : {false, true}) {
    for (const std::uint64_t seed : {1, 3, 14, 20, 27, 31}) {
      for (const LoopState state : {LoopState::kHealthy, LoopState::kSticky}) {
        Again();
        watch_ = LoopWatch(0, Severities(), known ? 'L' : '\0');
        FeedPv(loop::Simulate({.state = state,
                               .level = true,
                               .band = 3.0,
                               .noise = 0.02,
                               .steps = true,
                               .samples = 1100},
                              seed));
        EXPECT_EQ(audits_, 4) << seed;
        EXPECT_EQ(watch_.verdict().isolated & 1U, 0U) << seed;
        EXPECT_TRUE(told_.empty() || state == LoopState::kSticky) << seed;
      }
    }
  }
}

TEST_F(LoopWatchPvTest, TheServiceOfALoopSaysWhatItsPvIs) {
  for (const auto& [service, integrating] :
       {std::pair<char, std::optional<bool>>{'F', false},
        {'L', true},
        {'\0', std::nullopt}}) {
    LoopWatch watch(0, Severities(), service);
    for (std::uint64_t k = 1; k <= LoopWatch::kPoints; ++k) {
      Sample sample = At(k, 50.0, 5.0);
      sample.Set(Signal::kPv, 3.1);
      sample.Set(Signal::kSp, 3.6);
      watch.Step(sample, 10.0);
    }
    const auto window = watch.TakeWindow();
    ASSERT_TRUE(window);
    EXPECT_EQ(window->integrating, integrating) << service;
  }
}

// With SP the error is known: a PV that keeps its distance does not answer,
// although its readings differ.
TEST_F(LoopWatchPvTest, AnOpThatWindsUpHasNoResponse) {
  for (int k = 0; k < 1100; ++k) {
    Sample sample = At(seq_ + 1, 50.0 + std::abs(k % 200 - 100) * 0.3, 5.0);
    sample.Set(Signal::kPv, 3.1 + 0.001 * ((k * 37) % 29));
    sample.Set(Signal::kSp, 3.6);
    Give(sample);
  }
  EXPECT_THAT(Kinds(), ElementsAre(TransitionKind::kDetected,
                                   TransitionKind::kIsolated));
  EXPECT_EQ(watch_.verdict().isolated, 0b10U);
}

TEST_F(LoopWatchPvTest, PvWithItsSetPointIsPartOfTheEvidence) {
  for (std::uint64_t k = 1; k <= 30; ++k) {
    Sample sample = At(k, 50.0, 5.0);
    sample.Set(Signal::kSp, 101325.2);  // Beside a PV alone in its unit.
    if (k > 10) {
      sample.Set(Signal::kPv, 101325.0 + 0.1 * static_cast<double>(k));
    }
    EXPECT_EQ(Give(sample).intake, Intake::kAccepted);
  }
  const std::vector<Sample> points = watch_.Points();
  ASSERT_EQ(points.size(), 30U);
  EXPECT_EQ(points.back().present, MaskOf(Signal::kCv) | MaskOf(Signal::kF) |
                                       MaskOf(Signal::kPv) |
                                       MaskOf(Signal::kSp));
  EXPECT_EQ(points.back()[Signal::kPv], 101328.0);
  EXPECT_EQ(points.back()[Signal::kSp], 101325.2);
  EXPECT_TRUE(std::isnan(points.front()[Signal::kPv]));
  EXPECT_TRUE(std::isnan(points.front()[Signal::kSp]));
  // A loop without PV keeps no set point.
  Sample plain = At(31, 50.0, 5.0);
  plain.Set(Signal::kSp, 50.0);
  EXPECT_FALSE(LoopWatch::Reduced(plain).Has(Signal::kSp));
}

// A PV alone is enough; one that is missing now and then is not.
TEST_F(LoopWatchPvTest, WithoutFAndXThePvIsTheLoop) {
  const auto feed = [&](bool gaps) {
    const loop::Window loop = loop::Simulate(Sticky(), 2);
    for (std::size_t k = 0; k < loop.op.size(); ++k) {
      Sample sample = At(seq_ + 1, 100.0 - loop.op[k], 0.0);
      sample.present = MaskOf(Signal::kCv);
      if (!gaps || k % 50 != 0) {
        sample.Set(Signal::kPv, loop.pv[k]);
        sample.Set(Signal::kSp, loop.sp[k]);
      }
      Give(sample);
    }
  };
  feed(false);
  EXPECT_EQ(audits_, 4);
  EXPECT_EQ(watch_.verdict().isolated, 1U);
  Again();
  feed(true);
  EXPECT_EQ(audits_, 0);
}

// Windows of two hours, one each twenty minutes.
TEST_F(LoopWatchTest, NothingIsSaidBeforeTheFirstWindowIsFull) {
  for (std::uint64_t k = 1; k < LoopWatch::kPoints; ++k) {
    EXPECT_EQ(
        Give(At(k, 50.0 + 0.01 * static_cast<double>(k % 9), 5.0)).quality,
        Quality::kUnassigned);
  }
  EXPECT_EQ(watch_.models(), nullptr);
  for (std::uint64_t k = LoopWatch::kPoints; k < 1000; ++k) {
    Give(At(k, 50.0 + 0.01 * static_cast<double>(k % 9), 5.0));
  }
  EXPECT_EQ(audits_, 3);
  ASSERT_NE(watch_.models(), nullptr);
  EXPECT_EQ(watch_.models()->name, "audit");
  EXPECT_EQ(watch_.verdict().quality, Quality::kLive);
  // F stands, and so nearly does CV.
  EXPECT_TRUE(told_.empty());
}

// F that repeats itself while CV moves; a name of three windows.
class LoopWatchEpisodeTest : public LoopWatchTest {
 protected:
  LoopWatchEpisodeTest() { Dead(1000); }
  // F stands while CV goes up and down.
  void Dead(int samples) {
    for (int k = 0; k < samples; ++k) {
      Give(At(seq_ + 1, 50.0 + std::abs(k % 80 - 40), 5.0));
    }
  }
};

TEST_F(LoopWatchEpisodeTest, ALoopThatDoesNotAnswerSaysSo) {
  ASSERT_THAT(Kinds(), ElementsAre(TransitionKind::kDetected,
                                   TransitionKind::kIsolated));
  EXPECT_EQ(watch_.models()->faults.at(1), kNoResponse);
  EXPECT_EQ(watch_.verdict().isolated, 0b10U);
  EXPECT_EQ(watch_.verdict().fault_factors[1], 1.0);  // Sure.
  EXPECT_NEAR(watch_.verdict().strengths[1], 0.4, 0.01);
  EXPECT_EQ(told_[1].stamp_ns - told_[0].stamp_ns, 10 * kSecond);
  EXPECT_EQ(told_[1].detection_stamp_ns, told_[0].detection_stamp_ns);
}

TEST_F(LoopWatchEpisodeTest, ItEndsWhenWindowsInWhichOpMovesFindNothing) {
  told_.clear();
  Feed(loop::Simulate({.steps = true, .samples = 1400}, 3));
  ASSERT_FALSE(told_.empty());
  EXPECT_EQ(told_.back().kind, TransitionKind::kClosed);
  EXPECT_EQ(told_.back().reason, EndReason::kCleared);
  EXPECT_EQ(told_[told_.size() - 2].kind, TransitionKind::kCleared);
  EXPECT_FALSE(watch_.episode_open());
  EXPECT_EQ(watch_.verdict().isolated, 0U);
}

TEST_F(LoopWatchEpisodeTest, ManualBeginsANewWindowAndEndsNothing) {
  told_.clear();
  Sample sample = At(seq_ + 1, 50.0, 5.0);
  sample.mode = ValveMode::kManual;
  EXPECT_EQ(Give(sample).quality, Quality::kInhibited);
  Dead(100);
  EXPECT_EQ(watch_.verdict().quality, Quality::kSettling);
  EXPECT_TRUE(watch_.episode_open());
  EXPECT_THAT(told_, IsEmpty());
  audits_ = 0;
  Dead(618);
  EXPECT_EQ(audits_, 0);
  Dead(60);
  EXPECT_GE(audits_, 1);
}

TEST_F(LoopWatchEpisodeTest, AReadingThatIsMissingIsBadInput) {
  Sample sample = At(seq_ + 1, 50.0, 5.0);
  sample.quality[Index(Signal::kF)] = SignalQuality::kBad;
  EXPECT_EQ(Give(sample).quality, Quality::kBadInput);
  EXPECT_TRUE(watch_.episode_open());
}

TEST_F(LoopWatchEpisodeTest, AnEndFromOutsideClosesIt) {
  const auto closed = watch_.End(EndReason::kStreamEnded);
  ASSERT_TRUE(closed);
  EXPECT_EQ(closed->kind, TransitionKind::kClosed);
  EXPECT_EQ(closed->reason, EndReason::kStreamEnded);
  EXPECT_EQ(closed->faults, 0b10U);
  EXPECT_FALSE(watch_.episode_open());
  EXPECT_FALSE(watch_.End(EndReason::kStreamEnded));
}

// A dead band that grows from 2 to 4 % of the span: the same episode, told
// anew.
TEST_F(LoopWatchTest, AFindingThatGetsMoreSevereIsToldAgain) {
  double x = 50.0;
  for (int k = 0; k < 2400; ++k) {
    const double cv = 50.0 + 8.0 * std::sin(0.02 * k) + std::sin(0.13 * k);
    const double side = k < 1000 ? 1.0 : 2.0;
    x = std::clamp(x, cv - side, cv + side);
    Sample sample = At(seq_ + 1, cv, 100.0 - x);
    sample.Set(Signal::kX, x);
    Give(sample);
  }
  EXPECT_THAT(Kinds(),
              ElementsAre(TransitionKind::kDetected, TransitionKind::kIsolated,
                          TransitionKind::kChanged));
  EXPECT_EQ(told_[1].severity, Severity::kMedium);
  EXPECT_EQ(told_[2].severity, Severity::kHigh);
  EXPECT_EQ(told_[2].faults, 1U);
}

TEST_F(LoopWatchEpisodeTest, RepeatedAndLateSamplesAreNoPoints) {
  const std::int64_t stamp = watch_.verdict().stamp_ns;
  EXPECT_EQ(Give(At(1000, 50.0, 5.0)).intake, Intake::kRepeat);
  EXPECT_EQ(watch_.Step(At(998, 50.0, 5.0), 10.0).intake, Intake::kLate);
  EXPECT_FALSE(watch_.at_point());
  EXPECT_EQ(watch_.verdict().stamp_ns, stamp);
  EXPECT_EQ(watch_.verdict().transition_count, 0);
}

TEST_F(LoopWatchEpisodeTest, TheWindowIsTheEvidence) {
  const std::vector<Sample> points = watch_.Points();
  ASSERT_EQ(points.size(), LoopWatch::kPoints);
  EXPECT_EQ(points.back().stamp_ns, At(1000, 0.0, 0.0).stamp_ns);
  EXPECT_EQ(points.front().stamp_ns, At(281, 0.0, 0.0).stamp_ns);
  EXPECT_EQ(points.front()[Signal::kF], 5.0);
  EXPECT_EQ(points.front().present, MaskOf(Signal::kCv) | MaskOf(Signal::kF));
}

// At 1 Hz one of ten samples is a point; a gap begins a new window.
TEST_F(LoopWatchTest, APointIsTakenEachTenSeconds) {
  int points = 0;
  const auto give = [&](int from_s, int to_s) {
    for (int s = from_s; s < to_s; ++s) {
      Sample sample = At(seq_ + 1, 50.0, 5.0);
      // Stamps shiver by up to 0.2 s.
      sample.stamp_ns =
          kStart + s * kSecond + (s % 3 - 1) * std::int64_t{200'000'000};
      Give(sample, 1.0);
      points += watch_.at_point() ? 1 : 0;
    }
  };
  give(0, 1000);
  EXPECT_EQ(points, 100);
  EXPECT_EQ(watch_.Points().size(), 100U);
  give(1015, 1100);  // Two points are missing, which is no gap.
  EXPECT_EQ(watch_.Points().size(), 109U);
  give(1200, 1300);
  EXPECT_EQ(watch_.Points().size(), 10U);
}

// A play of the rod, at a flow that follows the rod: read off X.
TEST_F(LoopWatchTest, WhereXIsMeasuredItIsReadOffX) {
  loop::Window loop;
  double x = 50.0;
  for (int k = 0; k < 1100; ++k) {
    loop.op.push_back(50.0 + 5.0 * std::sin(0.02 * k) + std::sin(0.13 * k));
    x = std::clamp(x, loop.op.back() - 1.0, loop.op.back() + 1.0);
    loop.x.push_back(x);
    loop.pv.push_back(x + 0.5 * std::sin(0.31 * k));
  }
  Feed(loop, true);
  ASSERT_EQ(told_.size(), 2U);
  EXPECT_EQ(watch_.verdict().isolated, 1U);
  EXPECT_NEAR(told_[1].strength, 0.02, 0.004);
}

// It ends when X rests, too, though OP does not move.
TEST_F(LoopWatchTest, APositionerThatHuntsHasAnEpisodeUntilItRests) {
  const auto feed = [&](double swing) {
    loop::Window loop;
    for (int k = 0; k < 1100; ++k) {
      loop.op.push_back(50.0 + 0.05 * std::sin(13.0 * k * k));
      loop.x.push_back(50.0 + swing * std::sin(0.5 * k) +
                       0.02 * std::sin(7.0 * k * k));
      loop.pv.push_back(loop.x.back());
    }
    Feed(loop, true);
  };
  feed(1.5);
  ASSERT_THAT(Kinds(), ElementsAre(TransitionKind::kDetected,
                                   TransitionKind::kIsolated));
  EXPECT_EQ(watch_.models()->faults.at(6), kPositionerHunts);
  EXPECT_EQ(watch_.verdict().isolated, 1U << 6U);
  EXPECT_GT(watch_.verdict().strengths[6], 0.9);
  feed(0.0);
  EXPECT_EQ(told_.back().reason, EndReason::kCleared);
}

TEST(AuditModelsTest, TheHashTellsTheInterval) {
  const auto models = AuditModels(60.0);
  EXPECT_EQ(models->sample_period_s, 60.0);
  const auto again = AuditModels(models->content_hash);
  ASSERT_NE(again, nullptr);
  EXPECT_EQ(again->sample_period_s, 60.0);
  EXPECT_EQ(again->faults, models->faults);
  EXPECT_NE(AuditModels(10.0)->content_hash, models->content_hash);
  EXPECT_EQ(AuditModels(std::uint64_t{0}), nullptr);
  EXPECT_EQ(AuditModels(~std::uint64_t{0}), nullptr);
  // Each finding of an audit is one of the set, and has a bit of its own.
  std::set<int> findings;
  for (std::size_t v = 0; v < loop::kVerdictCount; ++v) {
    findings.insert(FindingOf(static_cast<loop::Verdict>(v)));
  }
  findings.erase(0);
  EXPECT_EQ(std::vector(findings.begin(), findings.end()), models->faults);
}

}  // namespace
}  // namespace fdi
