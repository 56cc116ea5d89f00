#include <stdexcept>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/bounded_queue.h"
#include "base/worker.h"

namespace fdi {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using testing::ElementsAre;
using testing::IsEmpty;

TEST(BoundedQueueTest, TheTakerGetsAllThatWaitsOldestFirst) {
  BoundedQueue<int> queue(3);
  EXPECT_TRUE(queue.Push(1));
  EXPECT_TRUE(queue.TryPush(2));
  EXPECT_TRUE(queue.TryPush(3));
  EXPECT_FALSE(queue.HasRoom());
  EXPECT_FALSE(queue.TryPush(4));

  std::vector<int> batch;
  EXPECT_TRUE(queue.PopAll(batch, milliseconds(0)));
  EXPECT_THAT(batch, ElementsAre(1, 2, 3));
  EXPECT_TRUE(queue.Reopened());
  EXPECT_FALSE(queue.Reopened());
  EXPECT_TRUE(queue.PopAll(batch, milliseconds(0)));
  EXPECT_THAT(batch, IsEmpty());
}

TEST(BoundedQueueTest, PushWaitsForRoomAndLosesNothing) {
  BoundedQueue<int> queue(4);
  std::thread producer([&queue] {
    for (int i = 0; i < 10'000; ++i) {
      EXPECT_TRUE(queue.Push(i));
      EXPECT_LE(queue.size(), 4U);
    }
    queue.Close();
  });
  std::vector<int> taken;
  std::vector<int> batch;
  while (queue.PopAll(batch, seconds(10))) {
    taken.insert(taken.end(), batch.begin(), batch.end());
  }
  producer.join();

  ASSERT_EQ(taken.size(), 10'000U);
  for (int i = 0; i < 10'000; ++i) {
    EXPECT_EQ(taken[static_cast<std::size_t>(i)], i);
  }
}

TEST(BoundedQueueTest, ClosingReleasesWhoWaitsForRoomAndRefusesTheItem) {
  BoundedQueue<int> queue(1);
  EXPECT_TRUE(queue.Push(1));
  std::thread producer([&queue] { EXPECT_FALSE(queue.Push(2)); });
  queue.Close();
  producer.join();
  EXPECT_FALSE(queue.WaitForRoom());

  std::vector<int> batch;
  EXPECT_TRUE(queue.PopAll(batch, milliseconds(0)));
  EXPECT_THAT(batch, ElementsAre(1));
  EXPECT_FALSE(queue.PopAll(batch, milliseconds(0)));
}

TEST(BoundedQueueTest, AnInterruptIsNotLostBeforeTheWait) {
  BoundedQueue<int> queue(1);
  queue.Interrupt();
  std::vector<int> batch;
  const auto start = std::chrono::steady_clock::now();
  EXPECT_TRUE(queue.PopAll(batch, seconds(300)));
  EXPECT_LT(std::chrono::steady_clock::now() - start, seconds(150));
}

TEST(WorkerTest, WhatItsBodyThrowsIsThrownByJoinOnce) {
  Worker worker;
  EXPECT_TRUE(worker.WaitFor(milliseconds(0)));  // Nothing to wait for.
  worker.Start([] { throw std::runtime_error("no luck"); });
  EXPECT_TRUE(worker.WaitFor(seconds(60)));
  EXPECT_TRUE(worker.failed());
  EXPECT_THROW(worker.Join(), std::runtime_error);
  EXPECT_NO_THROW(worker.Join());
  EXPECT_FALSE(worker.started());
}

TEST(FirstErrorTest, EveryStepIsTriedAndTheFirstErrorKept) {
  FirstError errors;
  int steps = 0;
  errors.Try([&] { ++steps; });
  errors.Try([&] {
    ++steps;
    throw std::runtime_error("first");
  });
  errors.Try([&] {
    ++steps;
    throw std::logic_error("second");
  });
  EXPECT_EQ(steps, 3);
  EXPECT_THROW(errors.Rethrow(), std::runtime_error);
}

}  // namespace
}  // namespace fdi
