#include "simulator/fault_schedule.h"

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"

namespace fdi::simulator {
namespace {

using testing::HasSubstr;

std::string MessageFor(const std::string& text) {
  try {
    ParseFaultSchedule(text);
  } catch (const ConfigError& error) {
    return error.what();
  }
  return "";
}

TEST(FaultScheduleTest, ReadsAnAbruptFault) {
  const FaultSchedule s = ParseFaultSchedule("f19:abrupt@50:strength=0.75");
  EXPECT_EQ(s.fault, 19);
  EXPECT_EQ(s.start_s, 50.0);
  EXPECT_EQ(s.development_s, 0.0);
  EXPECT_EQ(s.final_strength, 0.75);
  EXPECT_EQ(StrengthAt(s, 49.999), 0.0);
  EXPECT_EQ(StrengthAt(s, 50.0), 0.75);
  EXPECT_EQ(StrengthAt(s, 1e9), 0.75);
}

TEST(FaultScheduleTest, ReadsAnIncipientFaultWithItsEnd) {
  const FaultSchedule s = ParseFaultSchedule(
      "paper1:incipient@500+1200:from=0.25:strength=0.6:until=3000");
  EXPECT_EQ(s.fault, 1);
  EXPECT_EQ(StrengthAt(s, 499.0), 0.0);
  EXPECT_DOUBLE_EQ(StrengthAt(s, 500.0), 0.25);
  EXPECT_DOUBLE_EQ(StrengthAt(s, 1100.0), 0.425);
  EXPECT_DOUBLE_EQ(StrengthAt(s, 1700.0), 0.6);
  EXPECT_DOUBLE_EQ(StrengthAt(s, 2999.0), 0.6);
  EXPECT_EQ(StrengthAt(s, 3000.0), 0.0);
}

TEST(FaultScheduleTest, StrengthIsOneAndTheRampStartsAtZeroByDefault) {
  const FaultSchedule s = ParseFaultSchedule("F3:incipient@10+20");
  EXPECT_EQ(s.initial_strength, 0.0);
  EXPECT_EQ(s.final_strength, 1.0);
}

TEST(FaultScheduleTest, ReadsAFlatline) {
  const FaultSchedule s = ParseFaultSchedule("T1:flatline@50:until=90");
  EXPECT_EQ(s.fault, 20);
  EXPECT_TRUE(s.flatline);
  EXPECT_EQ(TruthAt({s}, 49.0).fault, 0);
  EXPECT_EQ(TruthAt({s}, 50.0).fault, 20);
  EXPECT_EQ(TruthAt({s}, 50.0).strength, 1.0);
  EXPECT_EQ(TruthAt({s}, 90.0).fault, 0);
  EXPECT_EQ(EffectsAt({s}, 60.0), FaultEffects{});
}

TEST(FaultScheduleTest, TextReadsBackAsTheSameSchedule) {
  for (const char* text :
       {"f19:abrupt@50:strength=-0.75", "p2:abrupt@5:strength=-1",
        "t1:flatline@50", "p1:flatline@50:until=90.5",
        "f1:incipient@500+1200:from=0.25:strength=0.6:until=3000.5"}) {
    EXPECT_EQ(ToText(ParseFaultSchedule(text)), text);
  }
}

TEST(FaultScheduleTest, MessagesNameTheReasonAndTheAcceptedForm) {
  EXPECT_THAT(MessageFor("f99:abrupt@50"), HasSubstr("f1..f19"));
  EXPECT_THAT(MessageFor("f1"), HasSubstr("profile is missing"));
  EXPECT_THAT(MessageFor("f19@100"),
              HasSubstr("profile is missing before '@'"));
  EXPECT_THAT(MessageFor("f1:sudden@50"), HasSubstr("'sudden'"));
  EXPECT_THAT(MessageFor("f1:abrupt"), HasSubstr("start time"));
  EXPECT_THAT(MessageFor("f1:abrupt@x"), HasSubstr("'x' is not a number"));
  EXPECT_THAT(MessageFor("f1:abrupt@1e999"), HasSubstr("not a number"));
  EXPECT_THAT(MessageFor("f1:abrupt@50+10"), HasSubstr("takes a duration"));
  EXPECT_THAT(MessageFor("t1:flatline@50+10"), HasSubstr("takes a duration"));
  EXPECT_THAT(MessageFor("t1:flatline@50:strength=0.5"),
              HasSubstr("no strength"));
  EXPECT_THAT(MessageFor("f19:flatline@50"), HasSubstr("t1, p1 or p2"));
  EXPECT_THAT(MessageFor("f1:incipient@50"), HasSubstr("duration"));
  EXPECT_THAT(MessageFor("f1:incipient@50+0"), HasSubstr("above 0"));
  EXPECT_THAT(MessageFor("f1:abrupt@50:strenght=1"), HasSubstr("'strenght'"));
  EXPECT_THAT(MessageFor("f1:abrupt@50:from=1"), HasSubstr("incipient"));
  EXPECT_THAT(MessageFor("f1:abrupt@50:strength=-0.5"), HasSubstr("0 to 1"));
  EXPECT_THAT(MessageFor("f19:abrupt@50:strength=2"), HasSubstr("-1 to 1"));
  EXPECT_THAT(MessageFor("f1:abrupt@50:until=40"),
              HasSubstr("after its start"));
  EXPECT_THAT(MessageFor("f1:abrupt@-5"), HasSubstr("start of f1"));
  for (const char* text : {"f1", "f1:sudden@50", "f1:abrupt@50:until=40"}) {
    EXPECT_THAT(MessageFor(text), HasSubstr(std::string(kFaultForms)));
  }
}

TEST(FaultScheduleTest, TruthIsTheFirstFaultThatActs) {
  const std::vector<FaultSchedule> both{
      ParseFaultSchedule("f6:abrupt@100:strength=0.5"),
      ParseFaultSchedule("f19:abrupt@50:strength=0.25")};
  EXPECT_EQ(TruthAt(both, 10.0).fault, 0);
  EXPECT_EQ(TruthAt(both, 60.0).fault, 19);
  EXPECT_EQ(TruthAt(both, 160.0).fault, 6);
  EXPECT_DOUBLE_EQ(EffectsAt(both, 160.0).flow_reading_factor, 0.75);
  EXPECT_DOUBLE_EQ(EffectsAt(both, 160.0).opening_offset, 0.05);
}

}  // namespace
}  // namespace fdi::simulator
