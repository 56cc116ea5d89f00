// The messages as `fdi-monitor watch` shows them.
#include <gmock/gmock.h>

#include "monitor/bus/watch_records.h"

namespace fdi::monitor {
namespace {

using testing::EndsWith;
using testing::HasSubstr;
using testing::Not;
using Clock = WatchRecords::Clock;

idl::ModelSetInfoMessage Info(std::uint64_t hash) {
  idl::ModelSetInfoMessage info;
  info.model_set = "demo";
  info.version = 2;
  info.model_hash = hash;
  info.channels = {{"X", Signal::kX, -1.0, 1.0}};
  info.faults = {1, 19};
  return info;
}

idl::DecisionMessage Decision(std::uint64_t hash, Quality quality) {
  idl::DecisionMessage message;
  message.valve_id = "V1";
  message.model_hash = hash;
  message.channel_count = hash == 0 ? 0 : 1;
  message.fault_count = hash == 0 ? 0 : 2;
  message.verdict.quality = quality;
  message.verdict.fault_factors[1] = 0.9;
  return message;
}

class WatchTest : public testing::Test {
 protected:
  const Clock::time_point now_{std::chrono::hours(1)};
  std::vector<WatchRecord> records_;
  WatchRecords watch_{
      true, [this](const WatchRecord& record) { records_.push_back(record); }};
};

TEST_F(WatchTest, VectorsWaitForTheNamesOfTheirFaults) {
  watch_.Add(Decision(7, Quality::kLive), now_);
  watch_.Add(Decision(0, Quality::kUnassigned), now_);
  EXPECT_TRUE(records_.empty());

  watch_.Add(Info(7), now_);

  ASSERT_EQ(records_.size(), 3U);
  EXPECT_EQ(records_[0].object["topic"], "ModelSetInfo");
  EXPECT_THAT(records_[1].line, HasSubstr(" r_X=0.000"));
  EXPECT_THAT(records_[1].line, Not(HasSubstr("f19")));
  EXPECT_EQ(records_[1].object["factors"]["f19"], 0.9);
  EXPECT_EQ(records_[2].object["quality"], "UNASSIGNED");
}

TEST_F(WatchTest, AFaultIsNamedByWordsAndOnlyWhereThereIsOne) {
  watch_.Add(Info(7), now_);
  idl::DecisionMessage message = Decision(7, Quality::kLive);
  message.verdict.state = State::kDetected;
  watch_.Add(message, now_);
  message.verdict.state = State::kIsolated;
  message.verdict.isolated = 0b10;
  watch_.Add(message, now_);

  EXPECT_THAT(records_[1].line, EndsWith(" not yet"));
  EXPECT_THAT(records_[2].line, EndsWith(" sure f19"));
}

TEST_F(WatchTest, AnEventSaysHowSureItsNameIs) {
  FaultEvent event;
  event.valve_id = "V1";
  event.candidates = {{1, 0.5, 0.0, false}};
  watch_.Add(event, now_);
  event.transition.kind = TransitionKind::kIsolated;
  event.transition.factor = 0.8;
  event.transition.strength = 0.5;
  event.candidates = {{19, 0.8, 0.5, true}};
  watch_.Add(event, now_);

  EXPECT_THAT(records_[0].line, HasSubstr("DETECTED not yet, may be f1"));
  EXPECT_TRUE(records_[0].object["strength"].is_null());
  EXPECT_THAT(records_[1].line, HasSubstr("ISOLATED likely f19 strength=0.50"));
  EXPECT_EQ(records_[1].object["certainty"], "likely");
}

TEST_F(WatchTest, WithoutNamesAPositionDoesNotLookLikeAFault) {
  idl::DecisionMessage message = Decision(7, Quality::kLive);
  message.verdict.state = State::kIsolated;
  message.verdict.isolated = 0b10;
  watch_.Add(message, now_);
  watch_.Flush(now_ + WatchRecords::kPatience);

  ASSERT_EQ(records_.size(), 1U);
  EXPECT_THAT(records_[0].line, HasSubstr(" #2"));
  EXPECT_THAT(records_[0].line, Not(HasSubstr("d2")));
}

TEST_F(WatchTest, WhatAMonitorSaysCommandsNoTerminal) {
  idl::MonitorStatusMessage status;
  status.monitor = "m\x1b[2J";
  status.text = "\n2026 forged";
  watch_.Add(status, now_);

  EXPECT_TRUE(IsPrintable(records_[0].line)) << records_[0].line;
}

TEST_F(WatchTest, WhatIsNotJudgedIsNotCalledNormal) {
  watch_.Add(Info(7), now_);
  watch_.Add(Decision(7, Quality::kBadInput), now_);

  EXPECT_THAT(records_[1].line, HasSubstr("V1 BAD_INPUT NOT_JUDGED"));
  EXPECT_EQ(records_[1].object["state"], "NOT_JUDGED");
}

}  // namespace
}  // namespace fdi::monitor
