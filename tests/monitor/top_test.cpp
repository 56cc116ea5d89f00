// What `fdi-monitor top` makes of the messages, and how it looks.
#include <gmock/gmock.h>

#include "monitor/app/top_board.h"
#include "monitor/app/top_screen.h"

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
  message.verdict.state = state;
  message.verdict.isolated = isolated;
  message.verdict.stamp_ns = 100 * kSecond;
  std::copy(factors.begin(), factors.end(),
            message.verdict.fault_factors.begin());
  message.verdict.strengths.fill(0.25);
  return message;
}

idl::FaultEventMessage Event(const std::string& valve, TransitionKind kind,
                             std::uint64_t episode) {
  idl::FaultEventMessage message;
  message.valve_id = valve;
  message.episode_id = episode;
  message.transition.kind = kind;
  message.transition.detection_stamp_ns = 40 * kSecond;
  return message;
}

class TopTest : public testing::Test {
 protected:
  TopTest() {
    board_.Learn(Info());
    board_.Update(Decision("calm", State::kNormal, 0, {0.9, 0, 0}), now_);
    board_.Update(Decision("seen", State::kDetected, 0, {0.2, 0.6, 0}), now_);
    board_.Update(Decision("ill", State::kIsolated, 0b110, {0.95, 0.7, 0.8}),
                  now_);
    idl::DecisionMessage settling =
        Decision("new", State::kNormal, 0, {0, 0, 0});
    settling.verdict.quality = Quality::kSettling;
    board_.Update(settling, now_);
  }

  std::vector<std::string> Valves(TopSort sort,
                                  const std::string& filter = "") {
    std::vector<std::string> valves;
    for (const TopRow& row : board_.Rows(sort, filter, now_)) {
      valves.push_back(row.valve_id);
    }
    return valves;
  }
  TopView View() {
    TopView view;
    view.rows = board_.Rows(TopSort::kWorst, "", now_);
    view.valves = board_.valves();
    view.utc = true;
    return view;
  }

  const Clock::time_point now_{std::chrono::hours(1)};
  TopBoard board_{std::chrono::seconds(10)};
  const cli::FaultTexts texts_{FDI_FAULT_CATALOGUE};
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
  const TopRow row = board_.Rows(TopSort::kWorst, "", now_).front();

  EXPECT_EQ(row.faults, "f7|f19");
  EXPECT_EQ(row.factor, 0.8);
  EXPECT_EQ(row.strength, 0.25);
  EXPECT_EQ(row.factors.front().first, "f1");
  EXPECT_EQ(row.model_set, "demo@2");
}

TEST_F(TopTest, AFilterLooksAtValveFaultStateAndQuality) {
  EXPECT_THAT(Valves(TopSort::kWorst, "IL"), ElementsAre("ill"));
  EXPECT_THAT(Valves(TopSort::kWorst, "f19"), ElementsAre("ill"));
  EXPECT_THAT(Valves(TopSort::kWorst, "detect"), ElementsAre("seen"));
  EXPECT_THAT(Valves(TopSort::kWorst, "sett"), ElementsAre("new"));
}

TEST_F(TopTest, AValveIsAbnormalSinceItsOpenEpisodeBegan) {
  board_.Update(Event("ill", TransitionKind::kDetected, 1));
  board_.Update(Event("ill", TransitionKind::kClosed, 99));  // Another one.
  EXPECT_EQ(board_.Rows(TopSort::kWorst, "ill", now_)[0].since_ns,
            40 * kSecond);
  EXPECT_THAT(TopTable(View(), texts_, {}), HasSubstr("60 s"));

  board_.Update(Event("ill", TransitionKind::kClosed, 1));

  EXPECT_FALSE(board_.Rows(TopSort::kWorst, "ill", now_)[0].since_ns);
}

TEST_F(TopTest, WhoHasNotSpokenForAWhileIsSilent) {
  const auto later = now_ + std::chrono::seconds(11);
  board_.Update(Decision("calm", State::kNormal, 0, {0, 0, 0}), later);

  const auto rows = board_.Rows(TopSort::kValve, "", later);

  EXPECT_FALSE(rows[0].silent);
  EXPECT_TRUE(rows[1].silent);
  board_.Remove("ill");
  EXPECT_EQ(board_.valves(), 3U);
}

TEST_F(TopTest, AMonitorThatIsGoneIsNotHeard) {
  EXPECT_EQ(board_.Health(now_), "");
  idl::MonitorStatusMessage status;
  status.monitor = "m";
  status.health = idl::Health::kDegraded;
  status.text = "disk";
  board_.Update(status, now_);

  EXPECT_EQ(board_.Health(now_), "DEGRADED: disk");
  EXPECT_EQ(board_.Health(now_ + std::chrono::seconds(6)), "");
}

TEST_F(TopTest, TheScreenHasTheLinesAndColumnsOfTheTerminal) {
  for (const std::size_t height : {3U, 8U, 30U}) {
    const std::string screen = TopScreen(View(), texts_, {true, 40}, height);
    EXPECT_EQ(static_cast<std::size_t>(
                  std::count(screen.begin(), screen.end(), '\n') + 1),
              height);
    std::istringstream lines(screen);
    for (std::string line; std::getline(lines, line);) {
      EXPECT_EQ(Clipped(line, 40), line);
    }
  }
}

TEST_F(TopTest, WhatDoesNotFitIsCountedAndScrolledTo) {
  TopView view = View();
  const std::string top = TopScreen(view, texts_, {false, 200}, 8);
  EXPECT_THAT(top, HasSubstr("ill"));
  EXPECT_THAT(top, HasSubstr("2 more below"));
  EXPECT_THAT(top, Not(HasSubstr("calm")));

  view.first = 100;

  EXPECT_THAT(TopScreen(view, texts_, {false, 200}, 8), HasSubstr("calm"));
}

TEST_F(TopTest, FaultsAreCalledByTheirNames) {
  EXPECT_THAT(TopTable(View(), texts_, {}),
              HasSubstr(texts_.Words("f7|f19", 0.25).name));
  const cli::Json json = TopJson(View(), texts_);
  EXPECT_EQ(json["valves"][0]["fault"], "f7|f19");
  EXPECT_TRUE(json["valves"][3]["fault"].is_null());
}

TEST(ClippedTest, CodesTakeNoRoomAndLettersStayWhole) {
  EXPECT_EQ(Clipped("\x1b[31mab\x1b[0mc", 2), "\x1b[31mab\x1b[0m");
  EXPECT_EQ(Clipped("żółw", 2), "żó");
  EXPECT_EQ(Clipped("abc", 0), "abc");
}

}  // namespace
}  // namespace fdi::monitor
