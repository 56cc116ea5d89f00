#include "report/stop_signals.h"

#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <stdexcept>
#include <thread>

#include <gtest/gtest.h>
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
