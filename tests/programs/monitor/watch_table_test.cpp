// What `fdi-monitor watch --table` makes of the messages, and how it looks.
#include "monitor/bus/watch_table.h"

#include <sstream>

#include <gmock/gmock.h>

#include "monitor/bus/watch_records.h"

namespace fdi::monitor {
namespace {

using std::chrono::seconds;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;
using Clock = WatchTable::Clock;

constexpr std::int64_t kSecond = 1'000'000'000;
constexpr std::size_t kAllLines = 1000;

idl::ModelSetInfoMessage Info() {
  idl::ModelSetInfoMessage info;
  info.model_set = "demo";
  info.version = 2;
  info.model_hash = 7;
  info.sample_period_s = 20.0;
  info.channels = {{"X", Signal::kX, -1.0, 1.0}};
  info.faults = {1, 7, 19};
  return info;
}

idl::DecisionMessage Decision(const std::string& valve, State state,
                              FaultSet isolated, std::int64_t second) {
  idl::DecisionMessage message;
  message.valve_id = valve;
  message.model_hash = 7;
  message.channel_count = 1;
  message.fault_count = 3;
  message.verdict.quality = Quality::kLive;
  message.verdict.confidence = 1.0;
  message.verdict.state = state;
  message.verdict.isolated = isolated;
  message.verdict.stamp_ns = second * kSecond;
  return message;
}

// The first sample that is not normal is that of second 40.
FaultEvent Event(const std::string& valve, TransitionKind kind,
                 std::int64_t second) {
  FaultEvent message;
  message.valve_id = valve;
  message.episode_id = 1;
  message.transition.kind = kind;
  message.transition.stamp_ns = second * kSecond;
  message.transition.detection_stamp_ns = 40 * kSecond;
  return message;
}
FaultEvent Isolated(const std::string& valve, std::int64_t second) {
  FaultEvent message = Event(valve, TransitionKind::kIsolated, second);
  message.transition.strength = 0.25;
  message.candidates = {{7, 0.8, 0.25, true}, {19, 0.8, 0.25, true}};
  return message;
}
FaultEvent Closed(const std::string& valve, EndReason reason,
                  std::int64_t second) {
  FaultEvent message = Isolated(valve, second);
  message.transition.kind = TransitionKind::kClosed;
  message.transition.reason = reason;
  return message;
}

class WatchTableTest : public testing::Test {
 protected:
  WatchTableTest() { records_.Add(Info(), now_); }

  template <typename Message>
  void Hear(const Message& message) {
    records_.Add(message, now_);
  }
  // Two vectors, so that the valve is seen to go on.
  void HearTwice(const std::string& valve, State state, FaultSet isolated = 0) {
    Hear(Decision(valve, state, isolated, 99));
    Hear(Decision(valve, state, isolated, 100));
  }
  report::Json Rows() { return table_.Valves(0, now_).document["valves"]; }
  report::Json Row(const std::string& valve) {
    for (const report::Json& row : Rows()) {
      if (row["valve_id"] == valve) {
        return row;
      }
    }
    return nullptr;
  }
  std::string Text(std::size_t lines = kAllLines) {
    return table_.Text(lines, 0, now_);
  }

  Clock::time_point now_{std::chrono::hours(1)};
  const report::FaultTexts texts_{FDI_FAULT_CATALOGUE};
  WatchTable table_{texts_, true};
  WatchRecords records_{true, [this](const WatchRecord& record) {
                          table_.Add(record.object, now_);
                        }};
};

TEST_F(WatchTableTest, TheWorstStandFirst) {
  HearTwice("calm", State::kNormal);
  HearTwice("ill", State::kIsolated, 0b110);
  HearTwice("seen", State::kDetected);
  Hear(Decision("once", State::kNormal, 0, 100));
  idl::DecisionMessage settling = Decision("new", State::kNormal, 0, 99);
  settling.verdict.quality = Quality::kSettling;
  Hear(settling);
  settling.verdict.stamp_ns += kSecond;
  Hear(settling);

  std::vector<std::string> valves;
  for (const report::Json& row : Rows()) {
    valves.push_back(row["valve_id"]);
  }
  EXPECT_THAT(valves, ElementsAre("ill", "seen", "once", "new", "calm"));
  EXPECT_EQ(Row("calm")["state"], "NORMAL");
  EXPECT_EQ(Row("new")["state"], "NOT_JUDGED");
  EXPECT_THAT(Text(), HasSubstr("5 valves, 2 in alarm, 1 not confirmed"));
}

TEST_F(WatchTableTest, AnEpisodeHasTheNameOfItsEvent) {
  HearTwice("ill", State::kIsolated, 0b110);
  EXPECT_EQ(Row("ill")["fault"], "f7|f19");
  EXPECT_TRUE(Row("ill")["since_utc"].is_null());

  Hear(Isolated("ill", 60));

  EXPECT_EQ(Row("ill")["state"], "ISOLATED");
  EXPECT_EQ(Row("ill")["fault"], "f7|f19");
  EXPECT_EQ(Row("ill")["certainty"], "one of");
  EXPECT_EQ(Row("ill")["strength"], 0.25);
  EXPECT_EQ(Row("ill")["since_utc"], "1970-01-01T00:00:40Z");
  EXPECT_THAT(Text(), HasSubstr(texts_.Words("f7|f19", 0.25).name));
}

// The audit of a loop beside a model set that finds nothing.
TEST_F(WatchTableTest, AValveWithAnOpenEpisodeIsNotNormal) {
  HearTwice("V", State::kNormal);
  Hear(Isolated("V", 60));
  EXPECT_EQ(Row("V")["state"], "ISOLATED");

  Hear(Closed("V", EndReason::kCleared, 100));

  EXPECT_EQ(Row("V")["state"], "NORMAL");
  EXPECT_TRUE(Row("V")["fault"].is_null());
}

// The monitor repeats the last vector to who comes late, and its engine has no
// episode any more.
TEST_F(WatchTableTest, WhoComesLateIsToldOfNoStateThatIsNotKnown) {
  Hear(Closed("ended", EndReason::kStreamEnded, 100));
  Hear(Decision("ended", State::kNormal, 0, 100));
  Hear(Decision("ended", State::kNormal, 0, 100));
  Hear(Decision("quiet", State::kNormal, 0, 100));

  EXPECT_EQ(Row("ended")["state"], "NOT_CONFIRMED");
  EXPECT_EQ(Row("ended")["fault"], "f7|f19");
  EXPECT_EQ(Row("ended")["unconfirmed_utc"], "1970-01-01T00:01:40Z");
  EXPECT_EQ(Row("quiet")["state"], "NOT_CONFIRMED");
  EXPECT_TRUE(Row("quiet")["fault"].is_null());
  EXPECT_THAT(Text(), HasSubstr("not confirmed since 1970-01-01T00:01:40Z"));
  EXPECT_THAT(Text(), Not(HasSubstr("NORMAL")));

  // It goes on.
  Hear(Decision("ended", State::kNormal, 0, 101));
  EXPECT_EQ(Row("ended")["state"], "NORMAL");
  EXPECT_TRUE(Row("ended")["unconfirmed_utc"].is_null());
}

TEST_F(WatchTableTest, AReplayOfEarlierTimesGoesOn) {
  HearTwice("V", State::kIsolated, 0b10);
  Hear(Closed("V", EndReason::kStreamEnded, 100));
  idl::DecisionMessage again = Decision("V", State::kNormal, 0, 50);
  again.verdict.source_id = 2;
  Hear(again);

  EXPECT_EQ(Row("V")["state"], "NORMAL");
}

TEST_F(WatchTableTest, AStreamThatEndsInAnAlarmLeavesItUnconfirmed) {
  HearTwice("V", State::kIsolated, 0b10);
  Hear(Isolated("V", 60));
  for (const EndReason reason :
       {EndReason::kStreamEnded, EndReason::kStaleTimeout,
        EndReason::kUnknown}) {
    Hear(Closed("V", reason, 100));
    EXPECT_EQ(Row("V")["state"], "NOT_CONFIRMED");
    EXPECT_EQ(Row("V")["fault"], "f7|f19");
  }
}

// After ten seconds, or three periods of its model set.
TEST_F(WatchTableTest, ASilentValveIsNotConfirmed) {
  HearTwice("slow", State::kNormal);
  idl::DecisionMessage other = Decision("other", State::kNormal, 0, 99);
  other.model_hash = 0;
  other.channel_count = other.fault_count = 0;
  Hear(other);
  other.verdict.stamp_ns += kSecond;
  Hear(other);

  now_ += seconds(11);
  EXPECT_EQ(Row("other")["state"], "NOT_CONFIRMED");
  EXPECT_EQ(Row("slow")["state"], "NORMAL");
  now_ += seconds(50);
  EXPECT_EQ(Row("slow")["state"], "NOT_CONFIRMED");
}

TEST_F(WatchTableTest, AValveThatIsGoneStaysOnlyWithItsAlarm) {
  HearTwice("calm", State::kNormal);
  HearTwice("ill", State::kIsolated, 0b10);
  Hear(Isolated("ill", 60));
  table_.Remove("calm");
  table_.Remove("ill");

  EXPECT_TRUE(Row("calm").is_null());
  EXPECT_EQ(Row("ill")["state"], "NOT_CONFIRMED");
  EXPECT_EQ(Row("ill")["unconfirmed_utc"], "1970-01-01T00:01:00Z");
  Hear(Closed("ill", EndReason::kCleared, 101));
  EXPECT_TRUE(Rows().empty());
}

TEST_F(WatchTableTest, AMonitorThatIsGoneIsNotHeard) {
  EXPECT_THAT(Text(), HasSubstr("NO MONITOR IS HEARD"));
  idl::MonitorStatusMessage status;
  status.monitor = "m";
  status.health = idl::Health::kDegraded;
  status.text = "disk";
  Hear(status);

  EXPECT_THAT(Text(), HasSubstr("monitor m DEGRADED: disk"));
  now_ += seconds(6);
  EXPECT_TRUE(table_.Valves(0, now_).document["monitor"].is_null());
}

TEST_F(WatchTableTest, WhatAMonitorSaysCommandsNoTerminal) {
  idl::MonitorStatusMessage status;
  status.monitor = "m";
  status.text = "\x1b]0;title\x07";
  Hear(status);
  HearTwice("V\x1b[2J", State::kIsolated, 1);

  EXPECT_THAT(Text(), HasSubstr("V\\x1b[2J"));
  EXPECT_EQ(Text().find('\x1b'), std::string::npos);
}

TEST_F(WatchTableTest, WhatDoesNotFitIsCounted) {
  for (const char* valve : {"ill", "seen", "late", "calm"}) {
    HearTwice(valve, *valve == 'i' ? State::kIsolated : State::kNormal,
              *valve == 'i' ? 1 : 0);
  }
  for (const std::size_t lines : {7U, 8U}) {
    const std::string text = Text(lines);
    EXPECT_LT(std::count(text.begin(), text.end(), '\n'), lines);
    EXPECT_THAT(text, HasSubstr("4 valves, 1 in alarm"));
    EXPECT_THAT(text, HasSubstr("ill"));
    EXPECT_THAT(text, Not(HasSubstr("seen")));
    EXPECT_THAT(text, HasSubstr(lines == 8 ? "2 more below" : "3 more"));
  }
  EXPECT_THAT(Text(10), HasSubstr("seen"));
  EXPECT_THAT(Text(10), Not(HasSubstr("below")));
}

}  // namespace
}  // namespace fdi::monitor
