#include "idl/bounded_queue.h"

#include <thread>

#include <gtest/gtest.h>

namespace fdi::idl {
namespace {

using std::chrono::steady_clock;

TEST(BoundedQueueTest, GateClosesWhenFullAndOpensWhenAnEighthIsFree) {
  BoundedQueue<int> queue(16);
  for (int i = 0; i < 16; ++i) {
    EXPECT_TRUE(queue.open());
    queue.Push(int{i});
  }
  EXPECT_FALSE(queue.open());

  EXPECT_FALSE(queue.Pop().opened);
  EXPECT_FALSE(queue.open());
  EXPECT_TRUE(queue.Pop().opened);
  EXPECT_TRUE(queue.open());
  EXPECT_FALSE(queue.Pop().opened);
}

TEST(BoundedQueueTest, ItemsLeaveInTheOrderTheyCame) {
  BoundedQueue<int> queue(10);
  queue.Push(3);
  queue.Push(1);

  EXPECT_EQ(queue.Pop().item, 3);
  EXPECT_EQ(queue.Pop().item, 1);
  EXPECT_EQ(queue.Pop().item, std::nullopt);
}

TEST(BoundedQueueTest, InterruptEndsOneWait) {
  BoundedQueue<int> queue(10);
  const auto start = steady_clock::now();
  queue.Interrupt();

  queue.Wait(start + std::chrono::seconds(30));
  EXPECT_LT(steady_clock::now() - start, std::chrono::seconds(10));

  const auto deadline = steady_clock::now() + std::chrono::milliseconds(20);
  queue.Wait(deadline);
  EXPECT_GE(steady_clock::now(), deadline);
}

TEST(BoundedQueueTest, WhoWaitsForTheGateIsWokenByPopOrClose) {
  BoundedQueue<int> queue(1);
  queue.Push(7);
  std::jthread reader([&] { queue.Pop(); });
  EXPECT_TRUE(queue.WaitUntilOpen());

  queue.Push(8);
  std::jthread owner([&] { queue.Close(); });
  EXPECT_FALSE(queue.WaitUntilOpen());
}

TEST(BoundedQueueTest, PushWakesAWaiter) {
  BoundedQueue<int> queue(10);
  std::jthread writer([&] { queue.Push(7); });

  queue.Wait(steady_clock::now() + std::chrono::seconds(30));

  EXPECT_EQ(queue.Pop().item, 7);
}

}  // namespace
}  // namespace fdi::idl
