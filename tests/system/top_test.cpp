// `fdi-monitor top` beside a real monitor: printed once, and on a terminal.
#include <csignal>
#include <fstream>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>
#include <sys/wait.h>

#include "tests/system/monitor_fixture.h"
#include "tests/system/pty_process.h"

namespace fdi::monitor {
namespace {

using testing::HasSubstr;

class TopSystemTest : public MonitorFixture {
 protected:
  TopSystemTest() {
    StoreModels(data_, LinearModels());
    monitor_ = StartMonitor();
    Publish(0, 40);
    Publish(40, 60, kF7Offset);
    EXPECT_TRUE(AwaitEvent(TransitionKind::kIsolated));
  }

  std::vector<std::string> Top() const {
    return {FDI_MONITOR_PROGRAM,          "top",         "--domain",
            std::to_string(domain_.id()), "--transport", "udp"};
  }

  std::unique_ptr<ChildProcess> monitor_;
};

TEST_F(TopSystemTest, OnceIsTheTableOfWhatWasSaidLast) {
  const std::filesystem::path file = directory_.path() / "top.json";
  std::string command;
  for (const std::string& word : Top()) {
    command += "\"" + word + "\" ";
  }

  const int status =
      std::system((command + "--json >" + file.string()).c_str());

  ASSERT_EQ(WEXITSTATUS(status), 0);
  const auto table = nlohmann::json::parse(std::ifstream(file));
  ASSERT_EQ(table["valves"].size(), 1U);
  EXPECT_EQ(table["valves"][0]["valve_id"], "V1");
  EXPECT_EQ(table["valves"][0]["state"], "ISOLATED");
  EXPECT_EQ(table["valves"][0]["fault"], "f7");
  EXPECT_GE(table["valves"][0]["factor"], 0.7);
  EXPECT_TRUE(table["valves"][0]["since_utc"].is_string());
  EXPECT_EQ(table["monitor"], "OK");
}

TEST_F(TopSystemTest, TheTableComesAgainUntilCtrlC) {
  std::vector<std::string> command = Top();
  command.insert(command.end(), {"--filter", "V1", "--sort", "since"});
  PtyProcess top(command, 120, 20);
  const termios before = top.Settings();
  EXPECT_TRUE(top.AwaitText("1 with 'V1'")) << top.output();
  EXPECT_TRUE(top.AwaitText("ISOLATED")) << top.output();
  top.ClearOutput();
  EXPECT_TRUE(top.AwaitText("ISOLATED")) << top.output();

  top.Type("\x03");  // Ctrl-C

  EXPECT_EQ(top.AwaitExit(), 0);
  EXPECT_THAT(top.output(), HasSubstr("\x1b[?25h\x1b[?1049l"));
  EXPECT_EQ(top.Settings().c_lflag, before.c_lflag);
}

// It waits for its reader, but not with a stop.
TEST_F(TopSystemTest, AWatchWhoseReaderHasStoppedReadingEnds) {
  std::string command =
      "exec 1> >(exec sleep 20); "
      "timeout 0.2 head -c 1000000 /dev/zero; exec";
  for (const std::string& word : Top()) {
    command += word == "top" ? " watch" : " '" + word + "'";
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

  EXPECT_EQ(watch.AwaitExit(), 1);
}

}  // namespace
}  // namespace fdi::monitor
