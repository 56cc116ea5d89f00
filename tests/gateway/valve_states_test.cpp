// The outgoing states of a valve: never NORMAL while nobody judges it.
#include "gateway/valve_states.h"

#include <fstream>
#include <set>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "monitor/bus/watch_records.h"

namespace fdi::gateway {
namespace {

using monitor::WatchRecord;
using report::Json;
using std::chrono::seconds;
using ::testing::HasSubstr;
using Clock = ValveStates::Clock;

constexpr std::int64_t kSecond = 1'000'000'000;

class ValveStatesTest : public ::testing::Test {
 protected:
  void Hear(std::int64_t second, Quality quality = Quality::kLive) {
    idl::ValveStateMessage state;
    state.valve_id = "FV/1";
    state.monitor = "host:1";
    state.model_set = "demo@2";
    state.quality = quality;
    state.as_of_ns = second * kSecond;
    Hear(state);
  }
  void Hear(const idl::ValveStateMessage& state) {
    now_ += seconds(1);
    HearMonitor();
    records_.Add(state, now_);
  }
  void HearMonitor() {
    idl::MonitorStatusMessage status;
    status.monitor = "host:1";
    records_.Add(status, now_);
  }
  void HearFault(std::int64_t second) {
    FaultEvent event;
    event.valve_id = "FV/1";
    event.episode_id = 1;
    event.transition.kind = TransitionKind::kIsolated;
    event.transition.stamp_ns = second * kSecond;
    event.candidates = {{19, 0.9, 0.25, true}};
    records_.Add(event, now_);
  }
  std::vector<Outgoing> Due() { return states_.Due(0, now_); }
  Json StateTold() {
    states_.Forget();
    for (const Outgoing& message : Due()) {
      if (message.topic == "fdi/north/FV%2F1/state") {
        EXPECT_TRUE(message.retained);
        return Json::parse(message.payload);
      }
    }
    return {};
  }

  Clock::time_point now_{Clock::now()};
  ValveStates states_{
      report::FaultTexts(std::filesystem::path(FDI_FAULT_CATALOGUE)), "north"};
  monitor::WatchRecords records_{true, [this](const WatchRecord& record) {
                                   states_.Add(record.object, now_);
                                 }};
};

TEST_F(ValveStatesTest, NormalWhileAMonitorJudgesIt) {
  Hear(1);
  Hear(2);
  const Json state = StateTold();
  EXPECT_EQ(state["health"], "NORMAL");
  EXPECT_TRUE(state["reason"].is_null());
  EXPECT_EQ(state["model_set"], "demo@2");
  EXPECT_EQ(state["as_of_utc"], "1970-01-01T00:00:02Z");
}

TEST_F(ValveStatesTest, WithoutDataItIsNotNormal) {
  idl::ValveStateMessage silent;
  silent.valve_id = "FV/1";
  silent.monitor = "host:1";
  silent.as_of_ns = silent.unconfirmed_ns = 2 * kSecond;
  Hear(silent);
  EXPECT_EQ(StateTold()["health"], "CHECK_FUNCTION");
  EXPECT_THAT(StateTold()["reason"], HasSubstr("no data since 1970-01-01"));
  now_ += seconds(20);
  EXPECT_EQ(StateTold()["reason"], "no monitor is heard");
}

TEST_F(ValveStatesTest, WhatIsNotJudgedIsNotNormal) {
  Hear(2, Quality::kBadInput);
  EXPECT_EQ(StateTold()["health"], "CHECK_FUNCTION");
  EXPECT_EQ(StateTold()["reason"], "readings are missing or impossible");
  Hear(3, Quality::kUnassigned);
  EXPECT_THAT(StateTold()["reason"], HasSubstr("no models"));
}

TEST_F(ValveStatesTest, WhatIsNotJudgedForLongSaysSinceWhenAndWhy) {
  idl::ValveStateMessage blind;
  blind.valve_id = "FV/1";
  blind.monitor = "host:1";
  blind.quality = Quality::kUncovered;
  blind.as_of_ns = 700 * kSecond;
  blind.unjudged_ns = 60 * kSecond;
  blind.why = "UNCOVERED cv";
  Hear(blind);
  EXPECT_EQ(StateTold()["health"], "CHECK_FUNCTION");
  EXPECT_EQ(StateTold()["reason"],
            "it works where its models do not know it: not judged since "
            "1970-01-01T00:01:00Z because UNCOVERED cv");
}

TEST_F(ValveStatesTest, AFaultHasItsClassAndWords) {
  idl::ValveStateMessage ill;
  ill.valve_id = "FV/1";
  ill.monitor = "host:1";
  ill.quality = Quality::kLive;
  ill.state = State::kIsolated;
  ill.as_of_ns = 43 * kSecond;
  ill.episode_id = 1;
  ill.fault = "f19";
  ill.certainty = "sure";
  ill.priority = 1;
  ill.strength = 0.25;
  ill.since_ns = 40 * kSecond;
  Hear(ill);
  const Json state = StateTold();
  EXPECT_EQ(state["fault"], "f19");
  EXPECT_EQ(state["health"], "FAILURE");
  EXPECT_EQ(state["name"], "Flow transmitter wrong");
  EXPECT_EQ(state["strength_pct"], 25.0);
  EXPECT_EQ(state["since_utc"], "1970-01-01T00:00:40Z");
  EXPECT_TRUE(state["check"].is_string());
  EXPECT_EQ(state["severity"], "critical");
  EXPECT_EQ(state["priority"], 1);
}

TEST_F(ValveStatesTest, AnEventGoesOutOnceWithAnId) {
  HearFault(43);
  int events = 0;
  for (const Outgoing& message : Due()) {
    if (message.topic == "fdi/north/FV%2F1/event") {
      ++events;
      EXPECT_FALSE(message.retained);
      EXPECT_EQ(Json::parse(message.payload)["id"],
                "0000000000000001/ISOLATED/1970-01-01T00:00:43Z");
    }
  }
  EXPECT_EQ(events, 1);
  for (const Outgoing& message : Due()) {
    EXPECT_THAT(message.topic, ::testing::Not(HasSubstr("event")));
  }
}

TEST_F(ValveStatesTest, OnlyWhatChangesGoesOutAndAllOnceAMinute) {
  Hear(1);
  Hear(2);
  EXPECT_EQ(Due().size(), 2U);  // The monitor's and the valve's.
  Hear(3);
  EXPECT_TRUE(Due().empty());
  now_ += seconds(60);
  Hear(4);
  EXPECT_EQ(Due().size(), 2U);
}

TEST_F(ValveStatesTest, AValveThatNobodyTellsOfAnyMore) {
  states_.Expect("FV/1");
  const Json state = StateTold();
  EXPECT_EQ(state["health"], "CHECK_FUNCTION");
  EXPECT_THAT(state["reason"], HasSubstr("no monitor tells of it"));
}

TEST_F(ValveStatesTest, AStateThatTheBrokerKeptIsThatOfAValve) {
  using Kind = MqttEvent::Kind;
  states_.TakeKept({Kind::kMessage, "fdi/north/FV%2F1/event", "{}", true});
  states_.TakeKept({Kind::kMessage, "fdi/north/FV%2F1/state", "", true});
  states_.TakeKept({Kind::kMessage, "fdi/north/FV%2F1/state", "{}", false});
  states_.TakeKept({Kind::kMessage, "fdi/south/FV%2F1/state", "{}", true});
  states_.TakeKept({Kind::kMessage, "fdi/north/state", "{}", true});
  EXPECT_EQ(states_.Due(0, now_).size(), 1U);  // The monitor's.
  states_.TakeKept({Kind::kMessage, "fdi/north/FV%2F1/state", "{}", true});
  EXPECT_EQ(StateTold()["health"], "CHECK_FUNCTION");
}

TEST_F(ValveStatesTest, AMissingValveWaitsUntilMonitorsWereHeard) {
  states_.Expect("FV/1");
  ValveIdentity identity;
  identity.description = "Feed";
  states_.Describe("FV/1", "hall 1", identity);
  EXPECT_EQ(states_.Due(0, now_, false).size(), 1U);  // The monitor's.
  EXPECT_EQ(StateTold()["group"], "hall 1");
  EXPECT_EQ(StateTold()["about"]["description"], "Feed");
}

TEST_F(ValveStatesTest, AValveThatGoesIsNotNormalAnyMore) {
  Hear(1);
  Hear(2);
  EXPECT_EQ(StateTold()["health"], "NORMAL");
  states_.Remove("FV/1");
  EXPECT_EQ(StateTold()["health"], "CHECK_FUNCTION");
}

storage::Alarm AcknowledgedAlarm() {
  storage::Alarm alarm;
  alarm.episode.episode_id = "0000000000000001";
  alarm.episode.valve_id = "FV/1";
  alarm.episode.fault = "f19";
  alarm.episode.detected_ns = 40 * kSecond;
  alarm.episode.acked_by = "anna";
  alarm.episode.acked_ns = 50 * kSecond;
  alarm.episode.ack_comment = "on the way";
  alarm.state = storage::AlarmState::kAcked;
  return alarm;
}

TEST_F(ValveStatesTest, TheAlarmsOfTheHistoryAreToldWithWhoHasSeenThem) {
  Hear(1);
  Hear(2);
  EXPECT_TRUE(StateTold()["alarms"].is_null());  // There is no history.
  states_.SetAlarms(std::vector<storage::Alarm>());
  EXPECT_EQ(StateTold()["alarms"], Json::array());
  states_.SetAlarms(std::vector{AcknowledgedAlarm()});
  const Json alarm = StateTold()["alarms"][0];
  EXPECT_EQ(alarm["episode_id"], "0000000000000001");
  EXPECT_EQ(alarm["state"], "ACKED");
  EXPECT_EQ(alarm["health"], "FAILURE");
  EXPECT_EQ(alarm["name"], "Flow transmitter wrong");
  EXPECT_EQ(alarm["detected_utc"], "1970-01-01T00:00:40Z");
  EXPECT_EQ(alarm["acked_by"], "anna");
  EXPECT_EQ(alarm["acked_utc"], "1970-01-01T00:00:50Z");
  EXPECT_EQ(alarm["ack_comment"], "on the way");
  EXPECT_TRUE(alarm["shelved_until_utc"].is_null());
  // One whose name was withdrawn is not unlike any known fault.
  storage::Alarm withdrawn = AcknowledgedAlarm();
  withdrawn.episode.fault = "unknown";
  withdrawn.episode.isolated_ns = 42 * kSecond;
  states_.SetAlarms(std::vector{withdrawn});
  EXPECT_EQ(StateTold()["alarms"][0]["name"], "Fault whose name was withdrawn");
}

TEST_F(ValveStatesTest, AnAlarmOfAValveThatNobodyTellsOfIsTold) {
  states_.SetAlarms(std::vector{AcknowledgedAlarm()});
  const Json state = StateTold();
  EXPECT_EQ(state["health"], "CHECK_FUNCTION");
  EXPECT_EQ(state["alarms"].size(), 1U);
}

// The table of keys is the schema.
TEST_F(ValveStatesTest, ThePageExplainsEachKey) {
  Hear(1);
  Hear(2);
  std::ifstream page(FDI_CONNECT_PAGE);
  std::set<std::string> keys;
  bool in_state = false;
  for (std::string line; std::getline(page, line);) {
    in_state = line.starts_with("| valve_id |") ||
               (in_state && line.starts_with("| "));
    std::istringstream cell(in_state ? line.substr(2, line.find(" |") - 2)
                                     : "");
    for (std::string key; std::getline(cell, key, ',');) {
      keys.insert(key.substr(key.find_first_not_of(' ')));
    }
  }
  std::set<std::string> told;
  const Json state = StateTold();
  for (const auto& [key, value] : state.items()) {
    told.insert(key);
  }
  EXPECT_EQ(keys, told);
}

TEST(TopicLevel, IsOneLevelOfATopicAndBack) {
  EXPECT_EQ(TopicLevel("a/b+c#d%"), "a%2Fb%2Bc%23d%25");
  EXPECT_EQ(ValveOfLevel("a%2Fb%2Bc%23d%25"), "a/b+c#d%");
  EXPECT_EQ(ValveOfLevel("FV-101"), "FV-101");
  EXPECT_EQ(ValveOfLevel("100%"), "100%");
}

}  // namespace
}  // namespace fdi::gateway
