#include "base/retry.h"

#include <stdexcept>
#include <thread>

#include <gtest/gtest.h>

namespace fdi {
namespace {

TEST(RetryTest, WhatIsThrownEndsNeitherTheThreadNorTheProcess) {
  int calls = 0;
  int reports = 0;
  std::stop_source stop;
  std::jthread thread([&] {
    RetryUntil(
        stop.get_token(), std::chrono::milliseconds(1),
        [&calls, &stop] {
          if (++calls == 3) {
            stop.request_stop();
          }
          throw std::runtime_error("every time");
        },
        [&reports](const std::exception&) {
          ++reports;
          throw std::runtime_error("again");
        });
  });
  thread.join();
  EXPECT_EQ(calls, 3);
  EXPECT_EQ(reports, 3);
}

TEST(RetryTest, AStopEndsThePause) {
  std::stop_source stop;
  std::jthread thread([&] {
    RetryUntil(
        stop.get_token(), std::chrono::hours(1),
        [] { throw std::runtime_error("once"); },
        [&stop](const std::exception&) { stop.request_stop(); });
  });
}

}  // namespace
}  // namespace fdi
