#include "console/plant_feed.h"

#include <gtest/gtest.h>

namespace fdi::console {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

class PlantFeedTest : public testing::Test {
 protected:
  static constexpr std::uint64_t kA = 1;
  static constexpr std::uint64_t kB = 2;

  idl::Reception From(std::uint64_t participant) const {
    idl::Reception reception;
    reception.participant_id = participant;
    reception.received_ns = (now_ - start_).count();
    return reception;
  }
  void Status(std::uint64_t participant) {
    idl::MonitorStatusMessage status;
    status.monitor = participant == kA ? "room:1" : "room:2";
    feed_.Add(status, From(participant), now_);
  }
  void Vector(std::uint64_t participant, std::uint64_t seq,
              const std::string& valve = "V1", std::uint64_t hash = 0) {
    idl::DecisionMessage message;
    message.valve_id = valve;
    message.model_hash = hash;
    message.channel_count = hash == 0 ? 0 : 1;
    message.verdict.source_id = 7;
    message.verdict.seq = seq;
    message.verdict.stamp_ns = static_cast<std::int64_t>(seq) * 1'000'000'000;
    feed_.Add(message, From(participant), now_);
  }
  void Pass(PlantFeed::Clock::duration time) {
    now_ += time;
    feed_.Poll(now_);
  }
  ValveState Valve(const std::string& id = "V1") const {
    return board_.Trend(id).value().now;
  }

  const PlantFeed::Clock::time_point start_{seconds(1000)};
  PlantFeed::Clock::time_point now_{start_};
  LiveBoard board_;
  PlantFeed feed_{board_};
};

TEST_F(PlantFeedTest, SinceWhenAValveIsNotJudgedIsToldByItsMonitor) {
  Status(kA);
  Vector(kA, 1);
  idl::ValveStateMessage state;
  state.valve_id = "V1";
  state.unjudged_ns = 5;
  state.why = "UNCOVERED cv";
  feed_.Add(state, From(kA), now_);
  EXPECT_EQ(Valve().unjudged_ns, 5);
  EXPECT_EQ(Valve().why, "UNCOVERED cv");
  state.unjudged_ns = 0;
  state.why = "";
  feed_.Add(state, From(kA), now_);
  EXPECT_EQ(Valve().unjudged_ns, 0);
}

TEST_F(PlantFeedTest, ASilentMonitorIsToldFromASilentValve) {
  Status(kA);
  Status(kB);
  Vector(kA, 1);
  Vector(kB, 1, "V2");
  for (int i = 0; i < 4; ++i) {
    Pass(milliseconds(500));
    Status(kB);
  }
  const ValveState of_a = Valve();
  EXPECT_EQ(of_a.silence, monitor::Silence::kMonitor);
  EXPECT_EQ(of_a.monitor, "room:1");
  EXPECT_EQ(of_a.heard_ns, 0);
  EXPECT_EQ(Valve("V2").silence, monitor::Silence::kNone) << "not yet";

  for (int i = 0; i < 4; ++i) {
    Pass(milliseconds(500));
    Status(kB);
  }
  EXPECT_EQ(Valve("V2").silence, monitor::Silence::kStale);
  const auto lines = feed_.monitors();
  ASSERT_EQ(lines.size(), 2U);
  EXPECT_TRUE(lines[0].silent);
  EXPECT_FALSE(lines[1].silent);

  Vector(kA, 2);
  Vector(kB, 2, "V2");
  Pass(milliseconds(50));
  EXPECT_EQ(Valve().silence, monitor::Silence::kNone);
  EXPECT_EQ(Valve("V2").silence, monitor::Silence::kNone);
}

TEST_F(PlantFeedTest, AValveFollowsTheMonitorThatTakesItOver) {
  Status(kA);
  Status(kB);
  Vector(kA, 1);
  Vector(kA, 2);

  Pass(milliseconds(1000));
  Status(kB);
  Vector(kB, 2);  // Judged there, too.
  Pass(milliseconds(1000));
  EXPECT_EQ(Valve().silence, monitor::Silence::kNone);
  Vector(kB, 3);
  Pass(milliseconds(10));
  EXPECT_EQ(Valve().monitor, "room:2");
  EXPECT_EQ(feed_.monitors()[0].valves, 0U);
  EXPECT_EQ(feed_.monitors()[1].valves, 1U);
  EXPECT_EQ(board_.Trend("V1")->points.size(), 3U);
}

TEST_F(PlantFeedTest, AMonitorWithoutValvesIsForgottenAfterAMinute) {
  Status(kA);
  Status(kB);
  Vector(kB, 1);
  Pass(seconds(59));
  EXPECT_EQ(feed_.monitors().size(), 2U);
  Pass(seconds(2));
  ASSERT_EQ(feed_.monitors().size(), 1U);
  EXPECT_EQ(feed_.monitors()[0].name, "room:2");
  EXPECT_EQ(Valve().silence, monitor::Silence::kMonitor);
}

TEST_F(PlantFeedTest, TrendsHaveTheirNamesFromTheModelSet) {
  idl::ModelSetInfoMessage info;
  info.model_set = "paper";
  info.version = 2;
  info.model_hash = 9;
  info.sample_period_s = 2.0;
  info.isolation_threshold = 0.8;
  info.channels.resize(1);
  info.channels[0].name = std::string("X");
  info.faults = {1, 7};
  const auto facts = feed_.Add(info);
  EXPECT_EQ(facts->model_set, "paper@2");
  EXPECT_EQ(facts->isolation_threshold, 0.8);
  EXPECT_EQ(facts->faults, (std::vector<std::string>{"f1", "f7"}));
  EXPECT_EQ(feed_.Add(info), facts) << "announced by another monitor";

  Status(kA);
  Vector(kA, 1, "V1", 9);
  EXPECT_EQ(Valve().models, facts);
  EXPECT_EQ(board_.Trend("V1")->points.front().residuals.size(), 1U);
  for (int i = 0; i < 5; ++i) {
    Pass(seconds(1));
    Status(kA);
  }
  EXPECT_EQ(Valve().silence, monitor::Silence::kNone)
      << "three periods are 6 s";
}

// A valve that was taken out of service, and a monitor that nobody will start
// again; one that is there again is new.
TEST_F(PlantFeedTest, WhatIsSilentForLongIsForgotten) {
  Status(kA);
  Vector(kA, 1);
  Vector(kA, 1, "V2");
  Pass(PlantFeed::kForgetValve);
  EXPECT_EQ(Valve().silence, monitor::Silence::kMonitor);
  ASSERT_EQ(feed_.monitors().size(), 1U);
  Vector(kB, 2, "V2");
  Pass(seconds(1));
  EXPECT_FALSE(board_.Trend("V1"));
  EXPECT_TRUE(board_.Trend("V2"));
  EXPECT_TRUE(feed_.monitors().empty()) << "room:2 has sent no status";
  Vector(kA, 1);
  EXPECT_EQ(Valve().silence, monitor::Silence::kNone);
}

}  // namespace
}  // namespace fdi::console
