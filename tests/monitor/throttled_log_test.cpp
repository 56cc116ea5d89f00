#include "monitor/throttled_log.h"

#include <chrono>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace fdi::monitor {
namespace {

using testing::ElementsAre;

TEST(LogLimitTest, HoldsBackEachEventForItselfAndSaysHowMany) {
  std::vector<std::string> lines;
  const LogSink log = LimitLog(
      [&lines](LogLevel, std::string_view line) { lines.emplace_back(line); },
      {2, std::chrono::milliseconds(200)});
  const auto begin = std::chrono::steady_clock::now();
  for (int i = 0; i < 5; ++i) {
    log(LogLevel::kInfo, "fault_event valve=V1");
  }
  log(LogLevel::kInfo, "fault_events valve=V1");
  log(LogLevel::kInfo, "bare");
  EXPECT_THAT(lines, ElementsAre("fault_event valve=V1", "fault_event valve=V1",
                                 "fault_events valve=V1", "bare"));

  std::this_thread::sleep_until(begin + std::chrono::milliseconds(250));
  log(LogLevel::kInfo, "fault_event valve=V2");
  log(LogLevel::kInfo, "fault_event valve=V3");
  EXPECT_EQ(lines[4], "fault_event valve=V2 not_shown=3");
  EXPECT_EQ(lines[5], "fault_event valve=V3");
}

TEST(LogLimitTest, KindsThatSomebodyMakesUpFillNoMemory) {
  constexpr std::chrono::milliseconds kInterval(500);
  LogLimit limit({1, kInterval});
  std::uint64_t not_shown = 0;
  int shown = 0;
  const auto begin = std::chrono::steady_clock::now();
  for (int i = 0; i < 30'000; ++i) {
    shown += limit.Admit(std::to_string(i), not_shown) ? 1 : 0;
  }
  if (std::chrono::steady_clock::now() - begin < kInterval) {
    EXPECT_EQ(shown, 10'000);
  }
  std::this_thread::sleep_for(kInterval);
  EXPECT_TRUE(limit.Admit("another", not_shown));
}

}  // namespace
}  // namespace fdi::monitor
