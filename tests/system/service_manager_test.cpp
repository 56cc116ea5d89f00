// Messages of the built fdi-monitor to a service manager, here a datagram
// socket of the test in the place of systemd's.

#include <array>
#include <csignal>
#include <cstdlib>

#include <gmock/gmock.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>

#include "tests/system/monitor_fixture.h"

namespace fdi::monitor {
namespace {

using testing::Contains;
using testing::HasSubstr;

// Listens at NOTIFY_SOCKET as long as it lives.
class FakeManager {
 public:
  explicit FakeManager(const std::filesystem::path& path)
      : socket_(socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    path.string().copy(address.sun_path, sizeof address.sun_path - 1);
    if (bind(socket_, reinterpret_cast<const sockaddr*>(&address),
             sizeof address) != 0) {
      throw std::runtime_error("bind " + path.string());
    }
    setenv("NOTIFY_SOCKET", path.c_str(), 1);
  }
  ~FakeManager() {
    unsetenv("NOTIFY_SOCKET");
    unsetenv("WATCHDOG_USEC");
    close(socket_);
  }
  FakeManager(const FakeManager&) = delete;
  FakeManager& operator=(const FakeManager&) = delete;

  /// Waits for a message that begins with `text`, keeping all in messages().
  bool Await(const std::string& text,
             std::chrono::milliseconds timeout = std::chrono::seconds(60)) {
    const auto deadline = std::chrono::steady_clock::now() + timeout;
    while (true) {
      const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(
          deadline - std::chrono::steady_clock::now());
      pollfd waiting{socket_, POLLIN, 0};
      if (left.count() <= 0 ||
          poll(&waiting, 1, static_cast<int>(left.count())) <= 0) {
        return false;
      }
      std::array<char, 1024> buffer{};
      const ssize_t size = recv(socket_, buffer.data(), buffer.size(), 0);
      messages_.emplace_back(buffer.data(), static_cast<std::size_t>(size));
      if (messages_.back().starts_with(text)) {
        return true;
      }
    }
  }
  const std::vector<std::string>& messages() const { return messages_; }

 private:
  int socket_;
  std::vector<std::string> messages_;
};

class ServiceManagerTest : public MonitorFixture {
 protected:
  FakeManager manager_{directory_.path() / "notify"};
};

TEST_F(ServiceManagerTest, IsToldOfReadinessReloadAndEnd) {
  StoreModels(data_, LinearModels());
  const auto monitor = StartMonitor();
  ASSERT_TRUE(manager_.Await("READY=1"));
  Publish(0, 40);
  ASSERT_TRUE(manager_.Await("STATUS=OK valves=1"));

  monitor->Signal(SIGHUP);
  ASSERT_TRUE(manager_.Await("RELOADING=1"));
  ASSERT_TRUE(manager_.Await("READY=1"));
  EXPECT_TRUE(monitor->AwaitLine("models_reload cause=signal"));
  monitor->Signal(SIGTERM);
  ASSERT_TRUE(manager_.Await("STOPPING=1"));
  EXPECT_EQ(monitor->AwaitExit(), 0) << monitor->errors();
  EXPECT_THAT(manager_.messages(),
              testing::Not(Contains(HasSubstr("WATCHDOG"))));
}

TEST_F(ServiceManagerTest, AMonitorThatCannotStartIsNeverReady) {
  ChildProcess monitor(Command({"--model-set", "nowhere"}));

  EXPECT_EQ(monitor.AwaitExit(), 5);
  EXPECT_FALSE(manager_.Await("READY=1", std::chrono::milliseconds(1)));
}

TEST_F(ServiceManagerTest, TheWatchdogIsFedAtHalfOfItsLimit) {
  setenv("WATCHDOG_USEC", "3000000", 1);
  const auto monitor = StartMonitor();
  ASSERT_TRUE(manager_.Await("WATCHDOG=1"));
  for (int i = 0; i < 3; ++i) {
    EXPECT_TRUE(manager_.Await("WATCHDOG=1"));
  }
}

TEST_F(ServiceManagerTest, AStoppedProcessDoesNotFeedTheWatchdog) {
  setenv("WATCHDOG_USEC", "2000000", 1);
  const auto monitor = StartMonitor();
  ASSERT_TRUE(manager_.Await("WATCHDOG=1"));

  monitor->Signal(SIGSTOP);
  while (manager_.Await("", std::chrono::milliseconds(100))) {
  }
  EXPECT_FALSE(manager_.Await("", std::chrono::seconds(3)));
  monitor->Signal(SIGCONT);
  EXPECT_TRUE(manager_.Await("WATCHDOG=1"));
}

}  // namespace
}  // namespace fdi::monitor
