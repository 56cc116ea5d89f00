#include "report/stop_signals.h"

#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <functional>
#include <stdexcept>
#include <thread>
#include <utility>

#include <gtest/gtest.h>
#include <pty.h>
#include <sys/wait.h>
#include <unistd.h>

namespace fdi::report {
namespace {

using namespace std::chrono_literals;
using Event = StopSignals::Event;

TEST(StopSignalsTest, TerminationIsSeenByEveryWaiterFromThenOn) {
  StopSignals signals;
  EXPECT_EQ(signals.WaitFor(0ms), Event::kTimeout);

  std::raise(SIGTERM);

  EXPECT_TRUE(signals.stop_requested());
  EXPECT_EQ(signals.WaitFor(10s), Event::kStop);
  EXPECT_EQ(signals.WaitFor(10s), Event::kStop);
}

TEST(StopSignalsTest, SignalWakesAThreadThatWaits) {
  StopSignals signals;
  Event seen = Event::kTimeout;
  std::thread waiter([&] { seen = signals.WaitFor(60s); });

  std::raise(SIGINT);
  waiter.join();

  EXPECT_EQ(seen, Event::kStop);
}

// Long work ends soon after a request, with its last words; what has gone back
// to looking itself takes its time.
TEST(StopSignalsTest, WorkThatLooksSeldomHasSomePatience) {
  const auto end_of = [](bool settled) {
    return [settled] {
      StopSignals signals;
      signals.EndWithin(50ms, "interrupted\n");
      if (settled) {
        signals.EndWithin(0ms);
      }
      std::raise(SIGINT);
      std::this_thread::sleep_for(settled ? 150ms : 20'000ms);
      _exit(7);
    };
  };
  const auto begin = std::chrono::steady_clock::now();
  EXPECT_EXIT(end_of(false)(), testing::ExitedWithCode(1), "interrupted");
  EXPECT_EXIT(end_of(true)(), testing::ExitedWithCode(7), "");
  EXPECT_LT(std::chrono::steady_clock::now() - begin, 5s);
}

TEST(StopSignalsTest, HangUpIsOneReload) {
  StopSignals signals(StopSignals::HangUp::kReload);

  std::raise(SIGHUP);

  EXPECT_EQ(signals.WaitFor(10s), Event::kReload);
  EXPECT_EQ(signals.WaitFor(0ms), Event::kTimeout);
  EXPECT_FALSE(signals.stop_requested());
}

TEST(StopSignalsTest, HangUpStopsWhatHasNothingToReload) {
  StopSignals signals;

  std::raise(SIGHUP);
  std::raise(SIGHUP);

  EXPECT_EQ(signals.WaitFor(10s), Event::kStop);
}

TEST(StopSignalsTest, HangUpThatNohupIgnoresStaysIgnored) {
  const auto previous = std::signal(SIGHUP, SIG_IGN);
  {
    StopSignals signals;
    std::raise(SIGHUP);
    EXPECT_EQ(signals.WaitFor(0ms), Event::kTimeout);
  }
  std::signal(SIGHUP, previous);
}

// The event that a program in a terminal of its own gets after `hang_up`.
Event EventInTerminal(sighandler_t before,
                      const std::function<void(int&, pid_t)>& hang_up) {
  int terminal = -1;
  const pid_t child = forkpty(&terminal, nullptr, nullptr, nullptr);
  if (child == 0) {
    std::signal(SIGHUP, before);
    StopSignals signals(StopSignals::HangUp::kReload);
    [[maybe_unused]] const auto said = write(STDOUT_FILENO, "r", 1);
    _exit(static_cast<int>(signals.WaitFor(15s)));
  }
  char ready = 0;
  EXPECT_EQ(read(terminal, &ready, 1), 1);
  hang_up(terminal, child);
  int status = 0;
  EXPECT_EQ(waitpid(child, &status, 0), child);
  if (terminal >= 0) {
    close(terminal);
  }
  EXPECT_TRUE(WIFEXITED(status));
  return static_cast<Event>(WEXITSTATUS(status));
}

TEST(StopSignalsTest, HangUpOfTheTerminalStopsWhatReloads) {
  const auto close_terminal = [](int& terminal, pid_t) {
    close(std::exchange(terminal, -1));
  };
  EXPECT_EQ(EventInTerminal(SIG_DFL, close_terminal), Event::kStop);
  // nohup
  EXPECT_EQ(EventInTerminal(SIG_IGN, close_terminal), Event::kReload);
  // kill -HUP, while the terminal is there
  EXPECT_EQ(
      EventInTerminal(SIG_DFL, [](int&, pid_t pid) { kill(pid, SIGHUP); }),
      Event::kReload);
}

TEST(StopSignalsTest, ReaderOfThePipeThatEndsDoesNotEndTheProcess) {
  StopSignals signals;
  std::array<int, 2> ends{};
  ASSERT_EQ(pipe(ends.data()), 0);
  close(ends[0]);

  EXPECT_EQ(write(ends[1], "x", 1), -1);
  EXPECT_EQ(errno, EPIPE);

  EXPECT_FALSE(signals.stop_requested());
  close(ends[1]);
}

TEST(StopSignalsTest, StopBehindAReloadIsNotLost) {
  StopSignals signals(StopSignals::HangUp::kReload);

  std::raise(SIGHUP);
  std::raise(SIGTERM);

  EXPECT_EQ(signals.WaitFor(10s), Event::kStop);
}

TEST(StopSignalsTest, OnlyOneLivesAtATime) {
  StopSignals signals;

  EXPECT_THROW(StopSignals(), std::logic_error);
}

TEST(StopSignalsDeathTest, SecondStopEndsTheProcessWithCodeOne) {
  const auto stop_twice = [] {
    StopSignals signals;
    std::raise(SIGINT);
    std::raise(SIGTERM);
    std::_Exit(0);
  };
  EXPECT_EXIT(stop_twice(), testing::ExitedWithCode(1), "");
}

TEST(StopSignalsTest, HandlersAreGivenBack) {
  { StopSignals signals; }
  struct sigaction action {};

  sigaction(SIGTERM, nullptr, &action);

  EXPECT_EQ(action.sa_handler, SIG_DFL);
}

}  // namespace
}  // namespace fdi::report
