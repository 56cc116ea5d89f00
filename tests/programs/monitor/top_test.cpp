// What `fdi-monitor top` makes of the messages, and how it looks.
#include <sstream>

#include <gmock/gmock.h>

#include "programs/monitor/top_board.h"

namespace fdi::monitor {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;
using Clock = TopBoard::Clock;

constexpr std::int64_t kSecond = 1'000'000'000;

idl::ModelSetInfoMessage Info() {
  idl::ModelSetInfoMessage info;
  info.model_set = "demo";
  info.version = 2;
  info.model_hash = 7;
  info.channels = {{"X", Signal::kX, -1.0, 1.0}};
  info.faults = {1, 7, 19};
  return info;
}

idl::DecisionMessage Decision(const std::string& valve, State state,
                              FaultSet isolated, std::vector<double> factors) {
  idl::DecisionMessage message;
  message.valve_id = valve;
  message.model_hash = 7;
  message.channel_count = 1;
  message.fault_count = static_cast<int>(factors.size());
  message.verdict.quality = Quality::kLive;
  message.verdict.confidence = 1.0;
  message.verdict.state = state;
  message.verdict.isolated = isolated;
  message.verdict.stamp_ns = 100 * kSecond;
  std::copy(factors.begin(), factors.end(),
            message.verdict.fault_factors.begin());
  message.verdict.strengths.fill(0.25);
  return message;
}

FaultEvent Event(const std::string& valve, TransitionKind kind,
                 std::uint64_t episode) {
  FaultEvent message;
  message.valve_id = valve;
  message.episode_id = episode;
  message.transition.kind = kind;
  message.transition.detection_stamp_ns = 40 * kSecond;
  return message;
}

class TopTest : public testing::Test {
 protected:
  TopTest() {
    board_.Add(Info(), now_);
    board_.Add(Decision("calm", State::kNormal, 0, {0.9, 0, 0}), now_);
    board_.Add(Decision("seen", State::kDetected, 0, {0.2, 0.6, 0}), now_);
    board_.Add(Decision("ill", State::kIsolated, 0b110, {0.95, 0.7, 0.8}),
               now_);
    idl::DecisionMessage settling =
        Decision("new", State::kNormal, 0, {0, 0, 0});
    settling.verdict.quality = Quality::kSettling;
    board_.Add(settling, now_);
  }

  std::vector<std::string> Valves(TopSort sort,
                                  const std::string& filter = "") {
    std::vector<std::string> valves;
    for (const report::Json& row : Rows(sort, filter)) {
      valves.push_back(row["valve_id"]);
    }
    return valves;
  }
  report::Json Rows(TopSort sort, const std::string& filter = "") {
    return board_.Valves(sort, filter, now_).document["valves"];
  }
  report::Json Row(const std::string& filter) {
    return Rows(TopSort::kWorst, filter).at(0);
  }
  std::string Table() {
    std::ostringstream out;
    board_.Valves(TopSort::kWorst, "", now_).PrintText(out, {});
    return out.str();
  }
  std::string Screen(std::size_t height, const TopView& view = {}) {
    return TopScreen(board_, view, {false, 200}, height, 0, now_);
  }

  const Clock::time_point now_{std::chrono::hours(1)};
  const report::FaultTexts texts_{FDI_FAULT_CATALOGUE};
  TopBoard board_{texts_, std::chrono::seconds(10)};
};

TEST_F(TopTest, WorstStandsFirst) {
  EXPECT_THAT(Valves(TopSort::kWorst),
              ElementsAre("ill", "seen", "new", "calm"));
  EXPECT_THAT(Valves(TopSort::kValve),
              ElementsAre("calm", "ill", "new", "seen"));
  EXPECT_THAT(Valves(TopSort::kFactor),
              ElementsAre("calm", "ill", "seen", "new"));
}

TEST_F(TopTest, TheFactorIsThatOfTheIsolatedFaults) {
  const report::Json row = Row("");

  EXPECT_EQ(row["fault"], "f7|f19");
  EXPECT_EQ(row["factor"], 0.8);
  EXPECT_EQ(row["strength"], 0.25);
  EXPECT_EQ(row["factors"].begin().key(), "f1");
  EXPECT_EQ(row["model_set"], "demo@2");
}

TEST_F(TopTest, WordsAndNoNumbersSayHowSureANameIs) {
  FaultEvent outside = Event("odd", TransitionKind::kReisolated, 5);
  board_.Add(outside, now_);
  board_.Add(Decision("odd", State::kDetected, 0, {0, 0, 0}), now_);
  board_.Add(Decision("clear", State::kIsolated, 0b1, {0.95, 0, 0}), now_);

  EXPECT_EQ(Row("ill")["certainty"], "one of");
  EXPECT_EQ(Row("clear")["certainty"], "sure");
  EXPECT_EQ(Row("seen")["certainty"], "not yet");
  EXPECT_TRUE(Row("seen")["fault"].is_null());
  EXPECT_EQ(Row("odd")["certainty"], "not known");
  EXPECT_TRUE(Row("calm")["certainty"].is_null());
  EXPECT_THAT(Table(), HasSubstr("one of"));
  EXPECT_THAT(Table(), Not(HasSubstr("0.9")));
}

TEST_F(TopTest, AValveThatIsNotJudgedIsNotCalledNormal) {
  for (const Quality quality :
       {Quality::kBadInput, Quality::kUncovered, Quality::kUnassigned}) {
    idl::DecisionMessage message = Decision("calm", State::kNormal, 0, {});
    message.verdict.quality = quality;
    board_.Add(message, now_);

    EXPECT_EQ(Row("calm")["state"], "NOT_JUDGED");
    EXPECT_EQ(Row("calm")["quality"], QualityName(quality));
  }
  idl::DecisionMessage half = Decision("calm", State::kNormal, 0, {});
  half.verdict.confidence = 0.5;
  board_.Add(half, now_);
  EXPECT_EQ(Row("calm")["state"], "PARTLY_JUDGED");
  idl::DecisionMessage open = Decision("ill", State::kIsolated, 0b1, {1, 0, 0});
  open.verdict.quality = Quality::kBadInput;
  board_.Add(open, now_);
  EXPECT_EQ(Row("ill")["state"], "ISOLATED");
}

TEST_F(TopTest, BeforeTheModelSetIsKnownNoPositionLooksLikeAFault) {
  idl::DecisionMessage message =
      Decision("early", State::kIsolated, 0b10, {0.1, 0.9, 0.0});
  message.model_hash = 8;
  board_.Add(message, now_);

  EXPECT_EQ(Row("early")["fault"], "#2");
  EXPECT_EQ(Row("early")["residuals"].begin().key(), "#1");
  EXPECT_TRUE(Row("early")["model_set"].is_null());
}

TEST_F(TopTest, AFilterLooksAtValveFaultStateAndQuality) {
  EXPECT_THAT(Valves(TopSort::kWorst, "IL"), ElementsAre("ill"));
  EXPECT_THAT(Valves(TopSort::kWorst, "f19"), ElementsAre("ill"));
  EXPECT_THAT(Valves(TopSort::kWorst, "detect"), ElementsAre("seen"));
  EXPECT_THAT(Valves(TopSort::kWorst, "sett"), ElementsAre("new"));
}

TEST_F(TopTest, AValveIsAbnormalSinceItsOpenEpisodeBegan) {
  board_.Add(Event("ill", TransitionKind::kDetected, 1), now_);
  board_.Add(Event("ill", TransitionKind::kClosed, 99), now_);  // Another one.
  EXPECT_EQ(Row("ill")["since_utc"], "1970-01-01T00:00:40Z");
  EXPECT_THAT(Table(), HasSubstr("60 s"));

  board_.Add(Event("ill", TransitionKind::kClosed, 1), now_);

  EXPECT_TRUE(Row("ill")["since_utc"].is_null());
}

TEST_F(TopTest, WhoHasNotSpokenForAWhileIsSilent) {
  const auto later = now_ + std::chrono::seconds(11);
  board_.Add(Decision("calm", State::kNormal, 0, {0, 0, 0}), later);

  const report::Json rows =
      board_.Valves(TopSort::kValve, "", later).document["valves"];

  EXPECT_EQ(rows[0]["silent"], false);
  EXPECT_EQ(rows[1]["silent"], true);
  board_.Remove("ill");
  EXPECT_EQ(board_.valves(), 3U);
}

// The last vector of each valve comes at once to who starts `top`.
TEST_F(TopTest, WhatWasSentLongAgoIsSilentAndNotNormal) {
  // The clock of the monitor is 5 s behind.
  const idl::Reception late{0, 65 * kSecond, 1, 1};
  const idl::Reception fresh{60 * kSecond, 65 * kSecond, 1, 1};
  board_.Hear(late);
  board_.Add(Decision("stale", State::kNormal, 0, {0.9, 0, 0}), now_, late);
  board_.Hear(fresh);
  board_.Add(Decision("fresh", State::kNormal, 0, {0.9, 0, 0}), now_, fresh);

  EXPECT_EQ(Row("stale")["silent"], true);
  EXPECT_EQ(Row("stale")["state"], "NOT_JUDGED");
  EXPECT_EQ(Row("fresh")["silent"], false);
  EXPECT_EQ(Row("fresh")["state"], "NORMAL");
}

TEST_F(TopTest, AMonitorThatIsGoneIsNotHeard) {
  EXPECT_EQ(board_.Health(now_), "");
  idl::MonitorStatusMessage status;
  status.monitor = "m";
  status.health = idl::Health::kDegraded;
  status.text = "disk";
  board_.Add(status, now_);

  EXPECT_EQ(board_.Health(now_), "DEGRADED: disk");
  EXPECT_EQ(board_.Health(now_ + std::chrono::seconds(6)), "");
}

TEST_F(TopTest, WhatAMonitorSaysCommandsNoTerminal) {
  idl::MonitorStatusMessage status;
  status.monitor = "m";
  status.text = "\x1b]0;title\x07";
  board_.Add(status, now_);
  board_.Add(Decision("V\x1b[2J", State::kIsolated, 1, {0, 1, 0}), now_);
  const std::string screen = Screen(20, {.filter = "\x1b"});

  EXPECT_THAT(screen, HasSubstr("V\\x1b[2J"));
  EXPECT_EQ(screen.find('\x1b'), std::string::npos);
}

TEST_F(TopTest, WhatDoesNotFitIsCounted) {
  for (const std::size_t height : {7U, 8U}) {
    const std::string screen = Screen(height);
    EXPECT_LT(std::count(screen.begin(), screen.end(), '\n'), height);
    EXPECT_THAT(screen, HasSubstr("4 valves, 2 abnormal"));
    EXPECT_THAT(screen, HasSubstr("ill"));
    EXPECT_THAT(screen, Not(HasSubstr("calm")));
    EXPECT_THAT(screen, HasSubstr(height == 8 ? "2 more below" : "3 more"));
  }
  EXPECT_THAT(Screen(10), HasSubstr("calm"));
  EXPECT_THAT(Screen(10), Not(HasSubstr("below")));
}

TEST_F(TopTest, TheTitleSaysHowManyPassTheFilter) {
  EXPECT_THAT(Screen(20, {.filter = "f19"}), HasSubstr("1 with 'f19'"));
}

TEST_F(TopTest, FaultsAreCalledByTheirNames) {
  EXPECT_THAT(Table(), HasSubstr(texts_.Words("f7|f19", 0.25).name));
  EXPECT_EQ(Rows(TopSort::kWorst)[0]["fault"], "f7|f19");
  EXPECT_TRUE(Rows(TopSort::kWorst)[3]["fault"].is_null());
}

}  // namespace
}  // namespace fdi::monitor
