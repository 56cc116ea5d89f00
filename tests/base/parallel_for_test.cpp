#include "base/parallel_for.h"

#include <array>
#include <atomic>
#include <stdexcept>

#include <gtest/gtest.h>

namespace fdi {
namespace {

TEST(ParallelForTest, EveryTaskRunsOnceAndItsResultIsSeen) {
  std::array<int, 1000> calls{};
  ParallelFor(1000, 4, [&](int i) { calls.at(static_cast<std::size_t>(i))++; });
  for (const int count : calls) {
    EXPECT_EQ(count, 1);
  }
}

TEST(ParallelForTest, AFailureIsThrownOnceAllThreadsHaveEnded) {
  std::atomic<int> running{0};
  EXPECT_THROW(ParallelFor(1000, 4,
                           [&](int i) {
                             ++running;
                             if (i == 10) {
                               --running;
                               throw std::runtime_error("task 10");
                             }
                             --running;
                           }),
               std::runtime_error);
  EXPECT_EQ(running, 0);
}

}  // namespace
}  // namespace fdi
