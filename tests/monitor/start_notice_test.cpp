#include "monitor/service/start_notice.h"

#include <atomic>
#include <thread>

#include <gtest/gtest.h>

#include "tests/monitor/fake_sinks.h"
#include "tests/sanitized.h"

namespace fdi::monitor {
namespace {

using std::chrono::milliseconds;

TEST(StartNoticeTest, AsksForMoreTimeWhileTheProcessGetsOn) {
  Notice notice;
  std::vector<std::string> asked;
  StartNotice start(
      [&](const std::string& state) {
        notice.Apply([&] { asked.push_back(state); });
      },
      milliseconds(20));
  start.Start();
  std::atomic<bool> busy{true};
  std::thread work([&busy] {
    while (busy) {
    }
  });
  EXPECT_TRUE(notice.Await([&] { return asked.size() >= 3; }));
  busy = false;
  work.join();
  start.Stop();
  EXPECT_EQ(asked.front(), "EXTEND_TIMEOUT_USEC=60000");
}

// A start that waits for ever is ended by the service manager. In the first of
// its three periods the process may still read its own pages.
TEST(StartNoticeTest, DoesNotSpeakForAProcessThatStandsStill) {
  if (kSanitized) {
    GTEST_SKIP() << "the sanitizer's own thread uses the processor";
  }
  std::atomic<int> asked{0};
  StartNotice start([&](const std::string&) { ++asked; }, milliseconds(1000));
  start.Start();
  std::this_thread::sleep_for(milliseconds(3500));
  start.Stop();
  EXPECT_LE(asked, 1);
}

}  // namespace
}  // namespace fdi::monitor
