// `fdi-monitor watch` beside a real monitor: its table, in a pipe and on a
// terminal.
#include <csignal>
#include <fstream>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>
#include <sys/wait.h>

#include "base/time_text.h"
#include "storage/history/history_editor.h"
#include "tests/system/monitor_fixture.h"
#include "tests/system/pty_process.h"

namespace fdi::monitor {
namespace {

using testing::HasSubstr;

class WatchSystemTest : public MonitorFixture {
 protected:
  WatchSystemTest() {
    StoreModels(data_, LinearModels());
    monitor_ = StartMonitor();
    Publish(0, 40);
    Publish(40, 60, kF7Offset);
    EXPECT_TRUE(AwaitEvent(TransitionKind::kIsolated));
  }

  std::vector<std::string> Watch() const {
    return {FDI_MONITOR_PROGRAM,          "watch",       "--domain",
            std::to_string(domain_.id()), "--transport", "udp"};
  }
  // The last table that `watch --table --json` prints.
  nlohmann::json LastTable() const {
    const std::filesystem::path file = directory_.path() / "tables.json";
    std::string command;
    for (const std::string& word : Watch()) {
      command += "\"" + word + "\" ";
    }
    const int status = std::system(
        (command + "--table --for 4 --json >" + file.string()).c_str());
    EXPECT_EQ(WEXITSTATUS(status), 0);
    std::ifstream lines(file);
    std::string last;
    for (std::string line; std::getline(lines, line);) {
      last = line;
    }
    return nlohmann::json::parse(last);
  }

  std::unique_ptr<ChildProcess> monitor_;
};

// The valve sends nothing while the table is made, so nobody can tell.
TEST_F(WatchSystemTest, ATableOfWhatWasSaidLastConfirmsNothing) {
  const auto table = LastTable();

  ASSERT_EQ(table["valves"].size(), 1U);
  const auto& row = table["valves"][0];
  EXPECT_EQ(row["valve_id"], "V1");
  EXPECT_EQ(row["state"], "NOT_CONFIRMED");
  EXPECT_EQ(row["fault"], "f7");
  EXPECT_TRUE(row["since_utc"].is_string());
  EXPECT_TRUE(row["unconfirmed_utc"].is_string());
  EXPECT_THAT(table["monitor"], HasSubstr("OK"));
}

// The engine has no episode any more, and its last vector says NORMAL.
TEST_F(WatchSystemTest, AnAlarmWhoseStreamHasEndedIsNotNormal) {
  samples_->Dispose({"V1", {}});
  ASSERT_TRUE(AwaitEvent(TransitionKind::kClosed));

  const auto table = LastTable();

  ASSERT_EQ(table["valves"].size(), 1U);
  EXPECT_EQ(table["valves"][0]["state"], "NOT_CONFIRMED");
  EXPECT_EQ(table["valves"][0]["fault"], "f7");
}

// No vector is left that would say NORMAL, and the state is not.
TEST_F(WatchSystemTest, WhoComesLateHearsNoVectorOfAStreamThatHasEnded) {
  samples_->Dispose({"V1", {}});
  ASSERT_TRUE(AwaitEvent(TransitionKind::kClosed));
  idl::Participant here(participant_->options());
  idl::Subscriber<idl::ValveStateMessage> states(here);
  idl::Subscriber<idl::DecisionMessage> vectors(here);
  ASSERT_TRUE(vectors.WaitForWriters(1, kMonitorPatience));

  std::vector<idl::ValveStateMessage> told;
  ASSERT_TRUE(Await([&] {
    states.Take(
        {[&](const auto& state, const auto&) { told.push_back(state); }, {}},
        std::chrono::milliseconds(10));
    return !told.empty() && told.back().unconfirmed_ns != 0;
  }));
  EXPECT_EQ(told.back().fault, "f7");
  EXPECT_GT(told.back().priority, 0);
  int heard = 0;
  vectors.Take({[&](const auto&, const auto&) { ++heard; }, {}},
               std::chrono::seconds(1));
  EXPECT_EQ(heard, 0);
}

// The page says so by its clock, the other views by what the history has.
TEST_F(WatchSystemTest, ASilentValveIsNotConfirmedInListsEither) {
  const auto ask = [this](const std::string& verb) {
    const std::filesystem::path file = directory_.path() / "answer";
    const std::string command =
        FDI_STORE_PROGRAM " --utc --data " + data_.string() + " " + verb;
    EXPECT_EQ(std::system((command + " >" + file.string()).c_str()), 0);
    std::ostringstream text;
    text << std::ifstream(file).rdbuf();
    return text.str();
  };
  const auto since = [&] {
    return nlohmann::json::parse(
        ask("worklist --json"))["rows"][0]["unconfirmed_utc"];
  };
  ASSERT_TRUE(Await([&] { return !since().is_null(); }));
  const std::string stamp = FormatTime(PlantSample(59).stamp_ns, true);
  EXPECT_EQ(since(), stamp);
  EXPECT_THAT(ask("worklist"), HasSubstr(", not confirmed for "));
  EXPECT_THAT(ask("worklist --csv"), HasSubstr(stamp));
  EXPECT_THAT(ask("history list"), HasSubstr("not confirmed"));
  EXPECT_THAT(ask("history show last"), HasSubstr("not confirmed since "));

  Publish(60, 63, kF7Offset);
  EXPECT_TRUE(Await([&] { return since().is_null(); }));
  EXPECT_THAT(ask("worklist"), testing::Not(HasSubstr("not confirmed")));

  // Nor does an episode stand by itself that a monitor left open.
  monitor_->Signal(SIGTERM);
  monitor_->AwaitExit();
  EXPECT_EQ(since(), FormatTime(PlantSample(62).stamp_ns, true));
  monitor_ = StartMonitor();
  Publish(63, 103, kF7Offset);
  EXPECT_TRUE(Await([&] { return since().is_null(); })) << "it goes on";
  monitor_->Signal(SIGKILL);
  monitor_->AwaitExit();
  monitor_ = StartMonitor();
  EXPECT_TRUE(Await([&] { return !since().is_null(); }));
}

// Its history is what the monitor knows after a crash.
TEST_F(WatchSystemTest, AnAlarmOfBeforeARestartStandsUntilTheValveIsNormal) {
  samples_->Dispose({"V1", {}});
  ASSERT_TRUE(AwaitEvent(TransitionKind::kClosed));
  monitor_->Signal(SIGKILL);
  monitor_->AwaitExit();
  monitor_ = StartMonitor();

  auto table = LastTable();
  ASSERT_EQ(table["valves"].size(), 1U);
  EXPECT_EQ(table["valves"][0]["state"], "NOT_CONFIRMED");
  EXPECT_EQ(table["valves"][0]["fault"], "f7");
  EXPECT_EQ(table["valves"][0]["certainty"], "sure");

  Publish(100, 200);
  ASSERT_TRUE(AwaitVectors(160));
  idl::Participant here(participant_->options());
  idl::Subscriber<idl::ValveStateMessage> states(here);
  EXPECT_TRUE(Await([&] {
    bool normal = false;
    states.Take({[&](const idl::ValveStateMessage& state, const auto&) {
                   normal =
                       state.episode_id == 0 && state.quality == Quality::kLive;
                 },
                 {}},
                std::chrono::milliseconds(10));
    return normal;
  }));
}

// The page and the list have left it; nobody tells the monitor.
TEST_F(WatchSystemTest, AnAlarmWhoseEndSomebodyAcknowledgedLeavesTheBus) {
  samples_->Dispose({"V1", {}});
  ASSERT_TRUE(AwaitEvent(TransitionKind::kClosed));
  idl::Participant here(participant_->options());
  idl::Subscriber<idl::ValveStateMessage> states(here);
  idl::ValveStateMessage last;
  const auto told = [&](const auto& condition) {
    return Await([&] {
      states.Take({[&](const auto& state, const auto&) { last = state; }, {}},
                  std::chrono::milliseconds(10));
      return condition();
    });
  };
  ASSERT_TRUE(
      told([&] { return last.unconfirmed_ns != 0 && last.fault == "f7"; }));

  storage::HistoryEditor(data_ / "history.db")
      .Acknowledge("last", {"anna", "seen", "test", NowNs()});

  EXPECT_TRUE(told([&] { return last.episode_id == 0; }));
  EXPECT_EQ(last.fault, "");
  EXPECT_NE(last.unconfirmed_ns, 0);  // Nobody knows that it is normal.
  const auto table = LastTable();
  ASSERT_EQ(table["valves"].size(), 1U);
  EXPECT_EQ(table["valves"][0]["state"], "NOT_CONFIRMED");
  EXPECT_EQ(table["valves"][0]["certainty"], nullptr);
}

// Two of each twelve samples are missing, so the observers never settle.
TEST_F(WatchSystemTest, SinceWhenAValveIsNotJudgedIsOnTheBus) {
  Publish(60, 160);
  for (std::uint64_t k = 162; k < 900; k += 12) {
    Publish(k, k + 10);
  }
  idl::Participant here(participant_->options());
  idl::Subscriber<idl::ValveStateMessage> states(here);
  idl::ValveStateMessage last;
  EXPECT_TRUE(Await([&] {
    states.Take({[&](const auto& state, const auto&) { last = state; }, {}},
                std::chrono::milliseconds(10));
    return last.unjudged_ns != 0;
  }));
  EXPECT_EQ(last.unjudged_ns, PlantSample(159).stamp_ns);
  EXPECT_EQ(last.why.substr(0, 8), "SETTLING");
}

// It stands as long as its data come.
TEST_F(WatchSystemTest, AnAcknowledgedAlarmStaysOnTheBusWhileItStands) {
  storage::HistoryEditor(data_ / "history.db")
      .Acknowledge("last", {"anna", "seen", "test", NowNs()});

  samples_->Dispose({"V1", {}});
  ASSERT_TRUE(AwaitEvent(TransitionKind::kClosed));

  const auto table = LastTable();
  ASSERT_EQ(table["valves"].size(), 1U);
  EXPECT_EQ(table["valves"][0]["fault"], "f7");
}

TEST_F(WatchSystemTest, TheTableComesAgainUntilCtrlC) {
  std::vector<std::string> command = Watch();
  command.emplace_back("--table");
  PtyProcess watch(command, 120, 20);
  const termios before = watch.Settings();
  EXPECT_TRUE(watch.AwaitText("not confirmed since")) << watch.output();
  Publish(60, 70, kF7Offset);
  EXPECT_TRUE(watch.AwaitText("ISOLATED")) << watch.output();
  watch.ClearOutput();
  EXPECT_TRUE(watch.AwaitText("1 in alarm")) << watch.output();

  watch.Type("\x03");  // Ctrl-C

  EXPECT_EQ(watch.AwaitExit(), 0);
  EXPECT_THAT(watch.output(), HasSubstr("\x1b[?25h\x1b[?1049l"));
  EXPECT_EQ(watch.Settings().c_lflag, before.c_lflag);
}

// It waits for its reader, but not with a stop.
TEST_F(WatchSystemTest, AWatchWhoseReaderHasStoppedReadingEnds) {
  std::string command =
      "exec 1> >(exec sleep 20); "
      "timeout 0.2 head -c 1000000 /dev/zero; exec";
  for (const std::string& word : Watch()) {
    command += " '" + word + "'";
  }
  ChildProcess watch({"/bin/bash", "-c", command});
  EXPECT_TRUE(watch.AwaitLine("watch_ready"));
  EXPECT_TRUE(Await([&] {
    std::string function;
    std::ifstream("/proc/" + std::to_string(watch.pid()) + "/wchan") >>
        function;
    return function.find("pipe_write") != std::string::npos;
  }));

  watch.Signal(SIGTERM);

  EXPECT_EQ(watch.AwaitExit(std::chrono::seconds(10)), 1);
}

// Verbs and options of earlier versions answer with what to do instead.
TEST(RemovedWordsTest, NameWhatReplacesThem) {
  const std::vector<std::pair<std::vector<std::string>, std::string>> removed{
      {{"top", "--once"}, "top is gone: fdi-monitor watch --table"},
      {{"run", "--shadow", "paper@2"}, "--shadow is gone: record with"},
      {{"run", "--shadow-valves=V*"}, "--shadow-valves is gone: record with"}};
  for (const auto& [words, instead] : removed) {
    std::vector<std::string> command{FDI_MONITOR_PROGRAM};
    command.insert(command.end(), words.begin(), words.end());
    ChildProcess program(command);
    EXPECT_EQ(program.AwaitExit(), 2) << words.front();
    EXPECT_THAT(program.errors(), HasSubstr(instead));
  }
}

}  // namespace
}  // namespace fdi::monitor
