#include "diagnosis/loop/audit.h"

#include <cmath>
#include <iostream>
#include <limits>
#include <numbers>
#include <random>
#include <tuple>
#include <utility>

#include <gtest/gtest.h>

#include "diagnosis/loop/play.h"
#include "tests/diagnosis/loop/closed_loop.h"

namespace fdi::loop {
namespace {

constexpr int kLoops = 80;

// Share of `loop` with this verdict, over seeds 1, 2, ...; NUL: nobody says
// what the service is.
double ShareOf(Verdict verdict, const ClosedLoop& loop, char service) {
  int found = 0;
  for (std::uint64_t seed = 1; seed <= kLoops; ++seed) {
    Window window = Simulate(loop, seed);
    window.integrating.reset();
    SetService(service, window);
    found += AuditWindow(window).verdict == verdict ? 1 : 0;
  }
  return static_cast<double>(found) / kLoops;
}

double StictionShare(const ClosedLoop& loop, char service) {
  return ShareOf(Verdict::kStiction, loop, service);
}

bool Says(const Finding& finding, std::string_view words) {
  return finding.reason.find(words) != std::string_view::npos;
}

constexpr std::array kSound{LoopState::kHealthy, LoopState::kSluggish,
                            LoopState::kTight, LoopState::kExternalSine};

TEST(AuditTest, CallsFewSoundFlowLoopsSticky) {
  for (const LoopState state : kSound) {
    for (const bool steps : {false, true}) {
      for (const double noise : {0.02, 0.1}) {
        ClosedLoop loop;
        loop.state = state;
        loop.noise = noise;
        loop.steps = steps;
        const double share = StictionShare(loop, 'F');
        const double unsaid = StictionShare(loop, '\0');
        EXPECT_LE(share, 0.05);
        EXPECT_LE(unsaid, 0.02);
        std::cout << "state " << static_cast<int>(state) << ", noise " << noise
                  << (steps ? ", steps" : "") << ": " << share << ", unsaid "
                  << unsaid << '\n';
      }
    }
  }
}

TEST(AuditTest, FindsBandsFromTwoPercentWithSetPointSteps) {
  for (const double band : {2.0, 3.0, 4.0}) {
    for (const double noise : {0.02, 0.1}) {
      ClosedLoop loop;
      loop.state = LoopState::kSticky;
      loop.band = band;
      loop.noise = noise;
      loop.steps = true;
      const double with = StictionShare(loop, 'F');
      const double unsaid = StictionShare(loop, '\0');
      loop.steps = false;
      const double without = StictionShare(loop, 'F');
      std::cout << "band " << band << ", noise " << noise << ": " << with
                << " with steps, unsaid " << unsaid << "; " << without
                << " without, unsaid " << StictionShare(loop, '\0') << '\n';
      EXPECT_GE(without, 0.1);
      EXPECT_GE(with, 0.6);
      EXPECT_GE(unsaid, 0.6);
    }
  }
}

TEST(AuditTest, CallsNoLevelLoopSticky) {
  for (const LoopState state : kSound) {
    for (const bool steps : {false, true}) {
      ClosedLoop loop;
      loop.state = state;
      loop.level = true;
      loop.steps = steps;
      EXPECT_EQ(StictionShare(loop, 'L'), 0.0) << static_cast<int>(state);
      // Nor where nobody says that it is one.
      const double unsaid = StictionShare(loop, '\0');
      std::cout << "level unsaid, state " << static_cast<int>(state)
                << (steps ? ", steps: " : ": ") << unsaid << '\n';
      EXPECT_LE(unsaid, 0.05) << static_cast<int>(state);
    }
  }
}

// Under a slow load PV - SP goes with dOP/dt, which looks like a play.
TEST(AuditTest, CallsNoTemperatureUnderASlowLoadStickyOrDead) {
  for (const LoopState state :
       {LoopState::kHealthy, LoopState::kSluggish, LoopState::kTight}) {
    ClosedLoop loop;
    loop.state = state;
    loop.slow = true;
    loop.period_s = 60.0;
    loop.samples = 360;
    int as_any = 0;
    for (std::uint64_t seed = 1; seed <= 100; ++seed) {
      Window window = Simulate(loop, seed);
      as_any += AuditWindow(window).verdict == Verdict::kStiction ? 1 : 0;
      SetService('T', window);
      const Verdict verdict = AuditWindow(window).verdict;
      EXPECT_NE(verdict, Verdict::kStiction) << seed;
      EXPECT_NE(verdict, Verdict::kNoResponse) << seed;
    }
    EXPECT_LE(as_any, 3) << static_cast<int>(state);
    std::cout << "state " << static_cast<int>(state)
              << ", if nobody says that it is slow: " << as_any << " of 100\n";
  }
}

// A pressure may be as slow as a temperature; only a flow is known to be quick.
TEST(AuditTest, CallsNoPressureUnderASlowLoadSticky) {
  for (const LoopState state :
       {LoopState::kHealthy, LoopState::kSluggish, LoopState::kTight}) {
    ClosedLoop loop;
    loop.state = state;
    loop.slow = true;
    loop.period_s = 60.0;
    loop.samples = 360;
    EXPECT_LE(StictionShare(loop, 'P'), 0.03) << static_cast<int>(state);
  }
}

// One that is known as a flow and read too seldom is not told to measure one.
TEST(AuditTest, AdvisesASlowlyReadFlowToBeReadFaster) {
  ClosedLoop loop;
  loop.slow = true;
  loop.period_s = 60.0;
  loop.samples = 360;
  std::array<int, 2> late{};
  for (std::uint64_t seed = 1; seed <= 100; ++seed) {
    for (const bool told : {false, true}) {
      Window window = Simulate(loop, seed);
      SetService(told ? 'F' : '\0', window);
      const Audit audit = AuditWindow(window);
      if (audit.verdict == Verdict::kUndetermined && Says(audit, "late")) {
        ++late[told ? 1 : 0];
        EXPECT_NE(Says(audit, "a flow"), told) << audit.reason;
        EXPECT_EQ(Says(audit, "20 s"), told) << audit.reason;
      }
    }
  }
  EXPECT_GT(late[0], 0);
  EXPECT_GT(late[1], 0);
}

// At its closed end OP stands, too, where a valve is not needed, so that fewer
// are seen there, and of levels, which run away at their own pace, none.
TEST(AuditTest, SeesMostStuckValves) {
  for (const auto& [service, slow] :
       {std::pair{'F', false}, {'P', false}, {'T', true}, {'L', false}}) {
    ClosedLoop loop;
    loop.state = LoopState::kStuck;
    loop.slow = slow;
    loop.level = service == 'L';
    loop.period_s = slow ? 60.0 : 10.0;
    loop.samples = slow ? 360 : 720;
    std::array<int, 2> found{};
    std::array<int, 2> all{};
    for (std::uint64_t seed = 1; seed <= 2 * kLoops; ++seed) {
      Window window = Simulate(loop, seed);
      window.integrating.reset();
      SetService(service, window);
      const std::size_t open = window.op.back() > 50.0 ? 1 : 0;
      const Verdict verdict = AuditWindow(window).verdict;
      ++all[open];
      found[open] += verdict == Verdict::kNoResponse ? 1 : 0;
    }
    std::cout << "stuck " << service << ": " << found[1] << " of " << all[1]
              << " at the open end, " << found[0] << " of " << all[0] << '\n';
    EXPECT_GE(found[1], 0.85 * all[1]) << service;
    if (service == 'L') {
      EXPECT_EQ(found[0], 0);
    } else {
      EXPECT_GE(found[0], 0.75 * all[0]) << service;
    }
  }
}

TEST(AuditTest, IsSureOnlyWherePredictionAgreesAndPvIsNotLate) {
  ClosedLoop loop;
  loop.state = LoopState::kSticky;
  loop.band = 3.0;
  loop.steps = true;
  int late = 0;
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    Window window = Simulate(loop, seed);
    SetService(seed % 2 == 0 ? 'F' : 'P', window);
    const Audit audit = AuditWindow(window);
    if (audit.verdict == Verdict::kStiction) {
      const Evidence& e = audit.evidence;
      EXPECT_EQ(audit.sure, e.prediction_gain > 3.0 && !e.late);
      EXPECT_EQ(Says(audit, "hardly"), e.prediction_gain <= 3.0);
      EXPECT_EQ(Says(audit, "late"), e.prediction_gain > 3.0 && e.late);
      EXPECT_GT(e.prediction_gain, 0.0);
      EXPECT_FALSE(e.late && seed % 2 == 0);
      late += e.late ? 1 : 0;
    }
  }
  EXPECT_GT(late, 0);
}

TEST(AuditTest, ReadsStictionOffThePosition) {
  ClosedLoop loop;
  loop.level = true;
  Window window = Simulate(loop, 3);
  window.x = window.op;
  EXPECT_EQ(AuditWindow(window).verdict, Verdict::kUndetermined);
  const auto [low, high] = std::ranges::minmax_element(window.op);
  const double band = 0.5 * (*high - *low);
  window.x = PlayOf(window.op, band, window.op[0]);
  const Audit audit = AuditWindow(window);
  EXPECT_EQ(audit.verdict, Verdict::kStiction);
  EXPECT_TRUE(audit.sure);
  EXPECT_NEAR(audit.evidence.fit->band, band, 0.05 * (*high - *low));
  window.x.assign(window.x.size(), 40.0);
  EXPECT_EQ(AuditWindow(window).verdict, Verdict::kNoResponse);
}

// With the noise of its reading; a position of the wrong sense moves.
TEST(AuditTest, SeesThatThePositionStands) {
  ClosedLoop loop;
  loop.state = LoopState::kExternalSine;
  loop.steps = true;
  Window window = Simulate(loop, 3);
  std::mt19937_64 random(1);
  std::normal_distribution<double> noise(40.0, 0.3);
  window.x.resize(window.op.size());
  for (std::size_t k = 0; k < window.x.size(); ++k) {
    window.x[k] = 100.0 - window.op[k] + noise(random);
  }
  EXPECT_EQ(AuditValve(window).verdict, Verdict::kUndetermined);
  std::ranges::generate(window.x, [&] { return noise(random); });
  const Audit audit = AuditValve(window);
  ASSERT_GT(audit.evidence.op_range, 5.0);
  EXPECT_EQ(audit.verdict, Verdict::kNoResponse);
  EXPECT_TRUE(audit.sure);
}

// A rod behind a noisy OP, each second: friction holds it until OP is 6 % away.
TEST(AuditTest, SeesAPositionThatStandsAgainAndAgain) {
  std::mt19937_64 random(1);
  std::normal_distribution<double> noise(0.0, 1.0);
  Window sound;
  double wander = 0.0;
  double x = 50.0;
  for (int k = 0; k < 3600; ++k) {
    wander = 0.97 * wander + 0.8 * noise(random);
    sound.op.push_back(50.0 + wander + 2.0 * noise(random));
    x += 0.5 * (sound.op.back() - x);
    sound.x.push_back(x + 0.05 * noise(random));
  }
  sound.pv = sound.x;
  EXPECT_EQ(AuditWindow(sound).verdict, Verdict::kUndetermined);
  Window sticky = sound;
  x = 50.0;
  for (std::size_t k = 0; k < sticky.x.size(); ++k) {
    x += std::abs(sticky.op[k] - x) > 6.0 ? sticky.op[k] - x : 0.0;
    sticky.x[k] = x + 0.05 * noise(random);
  }
  const Audit audit = AuditWindow(sticky);
  EXPECT_EQ(audit.verdict, Verdict::kStiction);
  EXPECT_TRUE(audit.sure);
  EXPECT_GE(audit.evidence.standing.times, 5U);
  ASSERT_TRUE(audit.evidence.band());
  EXPECT_GE(audit.evidence.band()->width, 2.0);
  // A stop holds it, too, but always at one place.
  Window stopped = sound;
  for (double& position : stopped.x) {
    position = std::min(position, 51.0 + 0.05 * noise(random));
  }
  EXPECT_EQ(AuditWindow(stopped).evidence.standing.times, 0U);
  // Readings that were held in the record prove nothing.
  Window held = sound;
  for (std::size_t k = 0; k < held.x.size(); ++k) {
    held.x[k] = sound.x[k - k % 8];
  }
  EXPECT_EQ(AuditWindow(held).evidence.standing.times, 0U);
}

// A blocked valve leaves its controller at the end of its range: the command
// lacks an answer there, and not room.
TEST(AuditTest, SeesThatOpStaysAtAnEndThoughThePositionFollowed) {
  ClosedLoop loop;
  Window window = Simulate(loop, 3);
  window.x = window.op;
  const auto late = static_cast<std::ptrdiff_t>(window.op.size() / 2);
  for (const auto& [end, x, verdict] :
       {std::tuple{100.0, 90.0, Verdict::kSaturated},
        {100.0, 0.0, Verdict::kNoResponse},
        {0.0, 10.0, Verdict::kSaturated},
        {0.0, 80.0, Verdict::kNoResponse}}) {
    std::fill(window.op.begin() + late, window.op.end(), end);
    std::fill(window.x.begin() + late, window.x.end(), x);
    EXPECT_EQ(AuditWindow(window).verdict, verdict) << end << ' ' << x;
  }
  // One that is read in the other sense is where OP is.
  std::fill(window.x.begin() + late, window.x.end(), 0.0);
  for (double& position : window.x) {
    position = 100.0 - position;
  }
  EXPECT_NE(AuditWindow(window).verdict, Verdict::kNoResponse);
}

Window Ramp() {
  Window window;
  window.period_s = 10.0;
  for (int k = 0; k < 400; ++k) {
    window.op.push_back(20.0 + 0.1 * k);
    window.pv.push_back(30.0 + 0.001 * std::sin(k));
    window.sp.push_back(35.0);
  }
  return window;
}

TEST(AuditTest, SeesThatNothingAnswers) {
  EXPECT_EQ(AuditWindow(Ramp()).verdict, Verdict::kNoResponse);
  Window dead = Ramp();
  dead.sp.clear();
  dead.pv.assign(dead.pv.size(), 3.5e-44);
  EXPECT_EQ(AuditWindow(dead).verdict, Verdict::kNoResponse);
}

// OP winds up and reaches no end until SP steps back.
TEST(AuditTest, SeesAStuckValveUnderASetPointStep) {
  Window window = Ramp();
  for (std::size_t k = 0; k < window.op.size(); ++k) {
    const auto wound =
        static_cast<double>(std::clamp<std::size_t>(k, 200, 260));
    window.op[k] = 40.0 + (wound - 200.0) / 3.0;
    window.sp[k] = k >= 200 && k < 260 ? 35.0 : 30.0;
  }
  EXPECT_EQ(AuditWindow(window).verdict, Verdict::kNoResponse);
}

TEST(AuditTest, SeesAValveThatDoesNothingThoughAskedToOpen) {
  Window window = Ramp();
  for (std::size_t k = 0; k < window.op.size(); ++k) {
    window.op[k] = 100.0;
    window.pv[k] = 30.0 + 0.1 * std::sin(static_cast<double>(k));
  }
  const Audit audit = AuditWindow(window);
  EXPECT_EQ(audit.verdict, Verdict::kNoResponse);
  EXPECT_TRUE(audit.sure);
  EXPECT_TRUE(Says(audit, "open end")) << audit.reason;
  window.open_op = 0.0;  // It is asked to close.
  EXPECT_EQ(AuditWindow(window).verdict, Verdict::kUndetermined);
  window.open_op = 100.0;
  for (std::size_t k = 0; k < window.op.size(); ++k) {
    window.pv[k] += 0.004 * static_cast<double>(k);  // It comes nearer.
  }
  EXPECT_EQ(AuditWindow(window).verdict, Verdict::kUndetermined);
}

TEST(AuditTest, SeesADeadTemperatureLoopThatWindsUp) {
  Window window = Ramp();
  for (std::size_t k = 0; k < window.op.size(); ++k) {
    window.op[k] = std::min(100.0, 20.0 + 0.25 * static_cast<double>(k));
  }
  SetService('T', window);
  EXPECT_EQ(AuditWindow(window).verdict, Verdict::kNoResponse);
}

// A loop that heats up at full output answers, each time anew, and so does one
// that follows its set point behind a lag.
TEST(AuditTest, AnAnswerAtTheOpenEndIsOne) {
  Window heating = Ramp();
  Window following = heating;
  for (std::size_t k = 0; k < heating.op.size(); ++k) {
    const bool heats = k % 60 < 30;
    heating.op[k] = heats ? 100.0 : 20.0;
    heating.sp[k] = 90.0;
    heating.pv[k] = heats ? 20.0 + 2.0 * static_cast<double>(k % 60) : 80.0;
    following.op[k] = 100.0;
    following.pv[k] = 30.0 + 0.1 * static_cast<double>(k);
    following.sp[k] = following.pv[k] + 5.0;
  }
  EXPECT_NE(AuditWindow(heating).verdict, Verdict::kNoResponse);
  EXPECT_NE(AuditWindow(following).verdict, Verdict::kNoResponse);
}

// A heater at full output answers after its dead time.
TEST(AuditTest, ASlowAnswerAfterADeadTimeIsOne) {
  for (const double dead : {0.0, 0.2, 0.3, 0.4}) {
    for (const double order : {1.0, 2.0}) {
      Window window = Ramp();
      const auto n = static_cast<double>(window.op.size());
      for (std::size_t k = 0; k < window.op.size(); ++k) {
        const double t = std::max(0.0, static_cast<double>(k) / n - dead);
        window.op[k] = 100.0;
        window.sp[k] = 90.0;
        window.pv[k] += 14.0 * std::pow(t / (1.0 - dead), order);
      }
      EXPECT_NE(AuditWindow(window).verdict, Verdict::kNoResponse)
          << "dead time " << dead << ", order " << order;
    }
  }
}

// A load brings PV nearer now and then; what follows OP slowly does so
// steadily.
TEST(AuditTest, ALoadIsNoAnswer) {
  Window window = Ramp();
  for (std::size_t k = 0; k < window.op.size(); ++k) {
    const auto t = static_cast<double>(k);
    window.op[k] = 100.0;
    window.pv[k] = 30.0 + 0.5 * std::sin(0.025 * t - 1.0);
  }
  EXPECT_EQ(AuditWindow(window).verdict, Verdict::kNoResponse);
  for (std::size_t k = 0; k < window.op.size(); ++k) {
    window.pv[k] = 30.0 + 0.002 * static_cast<double>(k);
  }
  EXPECT_NE(AuditWindow(window).verdict, Verdict::kNoResponse);
}

// One that is not needed closes, too; but PV is at SP until then.
TEST(AuditTest, SeesAValveThatDoesNothingThoughAskedToClose) {
  Window window = Ramp();
  for (std::size_t k = 0; k < window.op.size(); ++k) {
    const auto t = static_cast<double>(k);
    window.op[k] = std::max(0.0, 60.0 - t);
    window.pv[k] = 40.0 + 0.5 * std::sin(0.1 * t);
  }
  SetService('F', window);
  const Audit audit = AuditWindow(window);
  EXPECT_EQ(audit.verdict, Verdict::kNoResponse);
  EXPECT_TRUE(Says(audit, "closed end")) << audit.reason;
  // A controller that is mostly P closes a sound valve so under a falling load.
  EXPECT_FALSE(audit.sure);
  for (std::size_t k = 0; k < 60; ++k) {
    window.pv[k] = 35.0 + 0.5 * std::sin(0.1 * static_cast<double>(k));
  }
  EXPECT_EQ(AuditWindow(window).verdict, Verdict::kSaturated);
  // Or it has been closed all the time.
  std::ranges::fill(window.op, 0.0);
  EXPECT_NE(AuditWindow(window).verdict, Verdict::kNoResponse);
}

// PV is back where it was, at SP, when OP has met the load.
TEST(AuditTest, ALoadThatStepsIsNoRunWithoutAnAnswer) {
  Window window = Ramp();
  for (std::size_t k = 0; k < window.op.size(); ++k) {
    const double t = static_cast<double>(k % 200) / 20.0;
    const double way = k < 200 ? 1.0 : -1.0;
    window.op[k] = 50.0 + way * (10.0 * (1.0 - std::exp(-t)) - 5.0);
    window.pv[k] = 35.0 - way * 4.0 * t * std::exp(-t);
  }
  EXPECT_NE(AuditWindow(window).verdict, Verdict::kNoResponse);
  // Nor where PV is on its way to SP yet.
  std::ranges::fill(window.sp, 38.0);
  EXPECT_NE(AuditWindow(window).verdict, Verdict::kNoResponse);
}

// The position follows, so the valve is not stuck, whatever PV does.
TEST(AuditTest, APositionAtItsEndRefutesAStuckValve) {
  Window window = Ramp();
  for (std::size_t k = 0; k < window.op.size(); ++k) {
    window.op[k] = 100.0;
    window.pv[k] = 30.0 + 0.1 * std::sin(static_cast<double>(k));
  }
  EXPECT_EQ(AuditValve(window).verdict, Verdict::kNoResponse);
  window.x = window.op;
  EXPECT_NE(AuditValve(window).verdict, Verdict::kNoResponse);
}

TEST(AuditTest, SeesAFrozenReading) {
  Window window = Simulate({}, 5);
  for (std::size_t k = 200; k < 520; ++k) {
    window.pv[k] = window.pv[199];
    window.op[k] = 50.0 + (k % 7 < 3 ? 2.0 : -2.0);
  }
  EXPECT_EQ(AuditWindow(window).verdict, Verdict::kFrozen);
}

TEST(AuditTest, SeesSaturationAndCoarseReadings) {
  Window window = Simulate({}, 5);
  Window full = window;
  for (std::size_t k = 100; k < 150; ++k) {
    full.op[k] = 100.0;
  }
  EXPECT_EQ(AuditWindow(full).verdict, Verdict::kSaturated);
  for (double& pv : window.pv) {
    pv = std::round(pv * 5.0) / 5.0;
  }
  EXPECT_EQ(AuditWindow(window).verdict, Verdict::kQuantised);
}

TEST(AuditTest, SeesThatOpAndPvAreExchanged) {
  Window window = Simulate({}, 5);
  for (double& sp : window.sp) {
    sp *= 3.0;
  }
  for (double& pv : window.pv) {
    pv *= 3.0;
  }
  EXPECT_FALSE(AuditWindow(window).evidence.exchanged);
  std::swap(window.op, window.pv);
  const Audit audit = AuditWindow(window);
  EXPECT_TRUE(audit.evidence.exchanged);
  EXPECT_EQ(audit.verdict, Verdict::kUndetermined);
}

TEST(AuditTest, KnowsNoEndsOfAnOutputThatIsNoPercentage) {
  Window window = Simulate({}, 5);
  for (double& op : window.op) {
    op *= 8.0;  // A master's, in the unit of its slave's set point.
  }
  EXPECT_FALSE(IsPercent(window.op));
  EXPECT_EQ(AuditWindow(window).evidence.at_limit, 0.0);
}

Window Oscillating(double phase, double op_shift = 0.0) {
  Window window;
  window.period_s = 10.0;
  window.gain_sign = 1;
  for (int k = 0; k < 720; ++k) {
    const double angle = 2.0 * std::numbers::pi * k / 24.0;
    window.op.push_back(50.0 + op_shift + 2.0 * std::sin(angle));
    window.pv.push_back(50.0 + std::sin(angle + phase) +
                        1e-3 * std::sin(13.0 * k * k));
    window.sp.push_back(50.0);
  }
  return window;
}

TEST(AuditTest, TellsTuningFromADisturbance) {
  const Audit tuning = AuditWindow(Oscillating(-0.2));
  EXPECT_EQ(tuning.verdict, Verdict::kTuning);
  EXPECT_NEAR(tuning.evidence.oscillation->period, 24.0, 0.1);
  const Audit external = AuditWindow(Oscillating(std::numbers::pi));
  EXPECT_EQ(external.verdict, Verdict::kExternal);
}

// Steps of OP each 100 samples, with a little noise between; X follows, rings
// out, and has noise. With a `swing` it goes on, with a period of 12 samples.
Window Positioned(double swing, double noise) {
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  Window window;
  for (int k = 0; k < 1200; ++k) {
    const double op =
        50.0 + 4.0 * (k / 100 % 2) + k / 400 + 0.02 * normal(random);
    const double angle = 2.0 * std::numbers::pi * k / 12.0;
    const double ringing = 3.0 * std::exp(-(k % 100) / 8.0);
    window.op.push_back(op);
    window.x.push_back(op + (swing + ringing) * std::sin(angle) +
                       noise * normal(random));
    window.pv.push_back(window.x.back() + noise * normal(random));
  }
  return window;
}

TEST(AuditTest, SeesAPositionerThatHunts) {
  for (const double noise : {0.02, 0.2}) {
    const Audit audit = AuditWindow(Positioned(1.5, noise));
    EXPECT_EQ(audit.verdict, Verdict::kHunting) << noise;
    EXPECT_GT(audit.evidence.hunts, 0.9);
    EXPECT_EQ(AuditValve(Positioned(1.5, noise)).verdict, Verdict::kHunting);
  }
}

TEST(AuditTest, NoiseAndTheAnswerToAStepAreNoHunting) {
  for (const double noise : {0.02, 0.2, 1.0}) {
    EXPECT_EQ(AuditWindow(Positioned(0.0, noise)).evidence.hunts, 0.0) << noise;
  }
}

// OP and X of a sound valve at a nearly constant command, as records have them.
struct Quiet {
  const char* name;
  double (*op)(int k);
  double slow;  // Size of correlated noise of X, with 20 samples of memory.
};

TEST(AuditTest, WhatIsHeldCompressedOrSlowIsNoHunting) {
  const auto sine = [](int k) { return 50.0 + 0.24 * std::sin(0.2094 * k); };
  const Quiet records[] = {
      {"X follows a small sine of OP", sine, 0.0},
      {"OP is held for 60 samples",
       [](int k) { return 50.0 + std::sin(0.02 * (k - k % 60)); }, 0.0},
      {"OP is compressed to one value", [](int) { return 50.0; }, 0.4},
      {"X wanders at an OP with noise",
       [](int k) { return 50.0 + 0.02 * std::sin(13.0 * k * k); }, 0.4}};
  for (const Quiet& record : records) {
    for (unsigned seed = 1; seed <= 200; ++seed) {
      std::mt19937 random(seed);
      std::normal_distribution<double> normal;
      Window window;
      window.period_s = 4.0;
      double slow = 0.0;
      for (int k = 0; k < 1200; ++k) {
        slow = 0.95 * slow + std::sqrt(1.0 - 0.95 * 0.95) * normal(random);
        window.op.push_back(record.op(k));
        window.x.push_back(
            (record.slow > 0.0 ? record.op(k) : 50.0 + std::sin(0.02 * k)) +
            record.slow * slow + 0.06 * normal(random));
        window.pv.push_back(window.x.back());
      }
      if (record.op == +sine) {
        for (int k = 0; k < 1200; ++k) {
          window.x[static_cast<std::size_t>(k)] =
              sine(k) + 0.06 * normal(random);
        }
      }
      EXPECT_NE(AuditWindow(window).verdict, Verdict::kHunting)
          << record.name << ", seed " << seed;
    }
  }
}

TEST(AuditTest, AnswersUndeterminedForTooLittle) {
  Window window = Simulate({}, 1);
  for (auto series : {&Window::op, &Window::pv, &Window::sp}) {
    (window.*series).resize(kMinSamples - 1);
  }
  EXPECT_EQ(AuditWindow(window).verdict, Verdict::kUndetermined);
  Window still = Simulate({}, 1);
  still.op.assign(still.op.size(), 50.0);
  EXPECT_EQ(AuditWindow(still).verdict, Verdict::kUndetermined);
}

TEST(AuditTest, RefusesWhatIsNoWindow) {
  Window window = Simulate({}, 1);
  window.pv.pop_back();
  EXPECT_THROW(AuditWindow(window), std::invalid_argument);
  window = Simulate({}, 1);
  window.op[3] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(AuditWindow(window), std::invalid_argument);
  window = Simulate({}, 1);
  window.period_s = 0.0;
  EXPECT_THROW(AuditWindow(window), std::invalid_argument);
}

// A gas drum's pressure is an integral, a pipe's is not.
TEST(ServiceTest, OnlyLevelsAndFlowsTellWhetherPvIsAnIntegral) {
  for (const auto& [service, integrating] :
       {std::pair<char, std::optional<bool>>{'L', true},
        {'F', false},
        {'P', std::nullopt},
        {'T', std::nullopt}}) {
    Window window;
    SetService(service, window);
    EXPECT_EQ(window.integrating, integrating) << service;
    EXPECT_EQ(window.lags, service == 'T');
  }
}

TEST(ServiceTest, IsTheFirstLetterOfATag) {
  EXPECT_EQ(ServiceOf("20LIC101_0405"), 'L');
  EXPECT_EQ(ServiceOf("LV-101"), 'L');
  EXPECT_EQ(ServiceOf("boiler level 2"), 'L');
  EXPECT_EQ(ServiceOf("FV101"), 'F');
  EXPECT_EQ(ServiceOf("V1"), '\0');
}

TEST(ServiceTest, AFlowIsKnownByTheTagOfItsControllerNotOfItsValve) {
  EXPECT_EQ(ServiceOf("FIC101", true), 'F');
  EXPECT_EQ(ServiceOf("20FV101", true), '\0');
  EXPECT_EQ(ServiceOf("LV101", true), 'L');
}

}  // namespace
}  // namespace fdi::loop
