// The messages as `fdi-monitor watch --table` shows them, and its look.
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

idl::ValveStateMessage State(const std::string& valve) {
  idl::ValveStateMessage state;
  state.valve_id = valve;
  state.monitor = "m";
  state.quality = Quality::kLive;
  state.as_of_ns = 100 * kSecond;
  return state;
}

// An alarm since second 40.
idl::ValveStateMessage Detected(const std::string& valve) {
  idl::ValveStateMessage state = State(valve);
  state.state = fdi::State::kDetected;
  state.episode_id = 1;
  state.certainty = "not yet";
  state.priority = 3;
  state.since_ns = 40 * kSecond;
  return state;
}
idl::ValveStateMessage Named(const std::string& valve) {
  idl::ValveStateMessage state = Detected(valve);
  state.state = fdi::State::kIsolated;
  state.fault = "f7|f19";
  state.certainty = "one of";
  state.priority = 2;
  state.strength = 0.25;
  return state;
}

class WatchTableTest : public testing::Test {
 protected:
  WatchTableTest() {
    status_.monitor = "m";
    Hear(status_);
  }

  template <typename Message>
  void Hear(const Message& message) {
    records_.Add(message, now_);
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
  idl::MonitorStatusMessage status_;
  const report::FaultTexts texts_{FDI_FAULT_CATALOGUE};
  WatchTable table_{texts_, true};
  WatchRecords records_{true, [this](const WatchRecord& record) {
                          table_.Add(record.object, now_);
                        }};
};

TEST_F(WatchTableTest, TheWorstStandFirst) {
  Hear(State("calm"));
  Hear(Named("ill"));
  Hear(Detected("seen"));
  idl::ValveStateMessage silent = State("silent");
  silent.unconfirmed_ns = 90 * kSecond;
  Hear(silent);
  idl::ValveStateMessage settling = State("new");
  settling.quality = Quality::kSettling;
  Hear(settling);

  std::vector<std::string> valves;
  for (const report::Json& row : Rows()) {
    valves.push_back(row["valve_id"]);
  }
  EXPECT_THAT(valves, ElementsAre("ill", "seen", "silent", "new", "calm"));
  EXPECT_EQ(Row("calm")["state"], "NORMAL");
  EXPECT_EQ(Row("new")["state"], "NOT_JUDGED");
  EXPECT_THAT(Text(), HasSubstr("5 valves, 2 in alarm, 1 not confirmed"));
  EXPECT_THAT(Text(), HasSubstr("not confirmed since 1970-01-01T00:01:30Z"));
}

TEST_F(WatchTableTest, WhatIsNotJudgedForLongSaysSinceWhenAndWhy) {
  idl::ValveStateMessage blind = State("blind");
  blind.quality = Quality::kUncovered;
  Hear(blind);
  EXPECT_TRUE(Row("blind")["unjudged_utc"].is_null());
  EXPECT_TRUE(Row("blind")["why"].is_null());

  blind.unjudged_ns = 30 * kSecond;
  blind.why = "UNCOVERED cv";
  Hear(blind);
  EXPECT_EQ(Row("blind")["state"], "NOT_JUDGED");
  EXPECT_EQ(Row("blind")["unjudged_utc"], "1970-01-01T00:00:30Z");
  EXPECT_EQ(Row("blind")["why"], "UNCOVERED cv");
  EXPECT_THAT(Text(), HasSubstr("not judged since 1970-01-01T00:00:30Z"));
  EXPECT_THAT(Text(), HasSubstr("UNCOVERED cv"));
}

TEST_F(WatchTableTest, AnAlarmHasItsNameAndHowSureItIs) {
  Hear(Named("ill"));

  const report::Json row = Row("ill");
  EXPECT_EQ(row["state"], "ISOLATED");
  EXPECT_EQ(row["fault"], "f7|f19");
  EXPECT_EQ(row["certainty"], "one of");
  EXPECT_EQ(row["severity"], "high");
  EXPECT_EQ(row["strength"], 0.25);
  EXPECT_EQ(row["since_utc"], "1970-01-01T00:00:40Z");
  EXPECT_THAT(Text(), HasSubstr(texts_.Words("f7|f19", 0.25).name));
}

// The last state that it told is not what is.
TEST_F(WatchTableTest, WhatASilentMonitorSaidIsNotConfirmed) {
  Hear(State("calm"));
  Hear(Named("ill"));
  now_ += seconds(6);

  for (const char* valve : {"calm", "ill"}) {
    EXPECT_EQ(Row(valve)["state"], "NOT_CONFIRMED");
    EXPECT_EQ(Row(valve)["unconfirmed_utc"], "1970-01-01T00:01:40Z");
  }
  EXPECT_EQ(Row("ill")["fault"], "f7|f19");
  EXPECT_TRUE(table_.Valves(0, now_).document["monitor"].is_null());
  EXPECT_THAT(Text(), HasSubstr("NO MONITOR IS HEARD"));
  Hear(status_);
  EXPECT_EQ(Row("calm")["state"], "NORMAL");
}

TEST_F(WatchTableTest, AValveThatIsGoneLeaves) {
  Hear(State("calm"));
  table_.Remove("calm");

  EXPECT_TRUE(Rows().empty());
}

TEST_F(WatchTableTest, TheTitleHasTheMonitor) {
  status_.health = idl::Health::kDegraded;
  status_.text = "disk";
  Hear(status_);

  EXPECT_THAT(Text(), HasSubstr("monitor m DEGRADED: disk"));
}

TEST_F(WatchTableTest, WhatAMonitorSaysCommandsNoTerminal) {
  status_.text = "\x1b]0;title\x07";
  Hear(status_);
  Hear(Named("V\x1b[2J"));

  EXPECT_THAT(Text(), HasSubstr("V\\x1b[2J"));
  EXPECT_EQ(Text().find('\x1b'), std::string::npos);
}

TEST_F(WatchTableTest, WhatDoesNotFitIsCounted) {
  Hear(Named("ill"));
  for (const char* valve : {"seen", "late", "calm"}) {
    Hear(State(valve));
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
