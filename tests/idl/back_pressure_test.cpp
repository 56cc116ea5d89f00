#include <map>
#include <memory>
#include <thread>

#include <gtest/gtest.h>

#include "tests/idl/dds_fixture.h"

namespace fdi::idl {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using std::chrono::steady_clock;

// The consumer takes nothing until the writer has had to wait; then all comes.
class SlowReaderTest : public DeliveryTest,
                       public testing::WithParamInterface<Overflow> {};

TEST_P(SlowReaderTest, PacesALosslessWriter) {
  constexpr std::uint64_t kSamples = 80000;
  Participant here(domain_.Options(), log_.Sink());
  Participant there(domain_.Options(), log_.Sink());
  Subscriber<ValveSampleMessage> subscriber(here, Profile::kLossless,
                                            GetParam());
  Publisher<ValveSampleMessage> publisher(there, {Profile::kLossless, 1});
  ASSERT_TRUE(publisher.WaitForReaders(1, kPatience));

  std::uint64_t sent = 0;
  while (publisher.Write(SampleOf("v", sent), {}, milliseconds(2000)) ==
         WriteResult::kSent) {
    ++sent;
    ASSERT_LT(sent, kSamples) << "nothing held the writer up";
  }
  EXPECT_GT(sent, 10000U);
  std::jthread writer([&, sent] {
    for (std::uint64_t k = sent; k < kSamples; ++k) {
      publisher.Write(SampleOf("v", k));
    }
  });
  OrderCheck check;
  TakeUntil(subscriber, check.AsHandlers(),
            [&] { return check.count == kSamples; });

  EXPECT_EQ(check.count, kSamples);
  EXPECT_EQ(check.out_of_order, 0U);
  EXPECT_EQ(subscriber.status().lost, 0U);
  EXPECT_EQ(subscriber.status().received, kSamples);
}

TEST_P(SlowReaderTest, EndsWhileNothingIsTaken) {
  Participant here(domain_.Options(), log_.Sink());
  Participant there(domain_.Options(), log_.Sink());
  auto subscriber = std::make_unique<Subscriber<ValveSampleMessage>>(
      here, Profile::kLossless, GetParam());
  Publisher<ValveSampleMessage> publisher(there, {Profile::kLossless, 1});
  ASSERT_TRUE(publisher.WaitForReaders(1, kPatience));
  for (std::uint64_t k = 0;
       publisher.Write(SampleOf("v", k), {}, milliseconds(300)) ==
       WriteResult::kSent;
       ++k) {
  }
  const auto start = steady_clock::now();
  subscriber.reset();
  EXPECT_LT(steady_clock::now() - start, kPatience);
}

INSTANTIATE_TEST_SUITE_P(Overflow, SlowReaderTest,
                         testing::Values(Overflow::kLibrary,
                                         Overflow::kOnTheWay),
                         [](const auto& test) {
                           return test.param == Overflow::kLibrary ? "Library"
                                                                   : "OnTheWay";
                         });

// Behind the queue of the subscriber the library keeps samples valve by valve.
TEST_F(DeliveryTest, ABacklogOfManyValvesIsNoLoss) {
  constexpr int kValves = 100;
  Participant here(domain_.Options(), log_.Sink());
  Participant there(domain_.Options(), log_.Sink());
  Subscriber<ValveSampleMessage> subscriber(here, Profile::kLossless);
  Publisher<ValveSampleMessage> publisher(there, {Profile::kLossless, kValves});
  ASSERT_TRUE(publisher.WaitForReaders(1, kPatience));

  std::uint64_t sent = 0;
  while (publisher.Write(SampleOf(ValveName(static_cast<int>(sent % kValves)),
                                  sent / kValves),
                         {}, milliseconds(300)) == WriteResult::kSent) {
    ++sent;
  }
  OrderCheck check;
  TakeUntil(subscriber, check.AsHandlers(),
            [&] { return check.count == sent; });

  EXPECT_EQ(check.count, sent);
  EXPECT_EQ(check.out_of_order, 0U);
  EXPECT_EQ(subscriber.status().lost, 0U);
}

TEST_F(DeliveryTest, AStopEndsAWriteThatWaits) {
  Participant here(domain_.Options(), log_.Sink());
  Participant there(domain_.Options(), log_.Sink());
  Subscriber<ValveSampleMessage> subscriber(here, Profile::kLossless);
  Publisher<ValveSampleMessage> publisher(there, {Profile::kLossless, 1});
  ASSERT_TRUE(publisher.WaitForReaders(1, kPatience));

  WriteResult last = WriteResult::kSent;
  std::jthread writer([&](const std::stop_token& stop) {
    for (std::uint64_t k = 0; last == WriteResult::kSent; ++k) {
      last = publisher.Write(SampleOf("v", k), stop);
    }
  });
  while (publisher.status().retries == 0) {
    std::this_thread::yield();
  }
  writer.request_stop();
  writer.join();

  EXPECT_EQ(last, WriteResult::kNotSent);
}

TEST_F(DeliveryTest, WhatALiveWriterOverwritesIsCountedAsLost) {
  constexpr std::uint64_t kSamples = 200000;
  Participant here(domain_.Options(), log_.Sink());
  Participant there(domain_.Options(), log_.Sink());
  Subscriber<ValveSampleMessage> subscriber(here);
  Publisher<ValveSampleMessage> publisher(there, {Profile::kLive, 1});
  ASSERT_TRUE(publisher.WaitForReaders(1, kPatience));

  bool newest = false;
  std::uint64_t got = 0;
  const Handlers<ValveSampleMessage> handlers{
      [&](const ValveSampleMessage& message, const Reception&) {
        ++got;
        newest = message.sample.seq == kSamples - 1;
      },
      nullptr};
  publisher.Write(SampleOf("v", 0));
  ASSERT_TRUE(TakeUntil(subscriber, handlers, [&] { return got == 1; }));

  for (std::uint64_t k = 1; k < kSamples; ++k) {
    ASSERT_EQ(publisher.Write(SampleOf("v", k)), WriteResult::kSent);
  }
  // The count of what was lost may come after the newest sample.
  TakeUntil(subscriber, handlers, [&] {
    return newest && got + subscriber.status().lost == kSamples;
  });

  EXPECT_TRUE(newest);
  EXPECT_EQ(got + subscriber.status().lost, kSamples);
}

TEST_F(DeliveryTest, ADecisionSubscriberThatSleepsNeverHoldsTheWriterUp) {
  Participant here(domain_.Options(), log_.Sink());
  Participant there(domain_.Options(), log_.Sink());
  Subscriber<DecisionMessage> sleeper(here);
  Publisher<DecisionMessage> publisher(there);
  ASSERT_TRUE(publisher.WaitForReaders(1, kPatience));

  for (std::uint64_t k = 0; k < 2000; ++k) {
    for (int i = 0; i < 20; ++i) {
      ASSERT_EQ(publisher.Write(DecisionOf(ValveName(i), k)),
                WriteResult::kSent);
    }
  }

  EXPECT_EQ(publisher.status().retries, 0U);
}

TEST_F(DeliveryTest, BatchesAllArrive) {
  constexpr std::uint64_t kSamples = 1000;
  Participant here(domain_.Options(), log_.Sink());
  Participant there(domain_.Options(), log_.Sink());
  Subscriber<DecisionBatchMessage> subscriber(here);
  Publisher<DecisionBatchMessage> publisher(there, {Profile::kLossless});
  ASSERT_TRUE(publisher.WaitForReaders(1, kPatience));

  std::jthread writer([&] {
    for (std::uint64_t k = 0; k < kSamples; ++k) {
      DecisionBatchMessage batch{"host:1", {}};
      for (int i = 0; i < 20; ++i) {
        batch.vectors.push_back(DecisionOf(ValveName(i), k));
      }
      publisher.Write(batch);
    }
  });
  std::map<std::string, std::uint64_t> next;
  std::uint64_t count = 0;
  std::uint64_t out_of_order = 0;
  const Handlers<DecisionBatchMessage> handlers =
      ForEachVector([&](const DecisionMessage& message, const Reception&) {
        std::uint64_t& expected = next[message.valve_id];
        out_of_order += message.verdict.seq != expected ? 1 : 0;
        expected = message.verdict.seq + 1;
        ++count;
      });
  TakeUntil(subscriber, handlers, [&] { return count == 20 * kSamples; });

  EXPECT_EQ(count, 20 * kSamples);
  EXPECT_EQ(out_of_order, 0U);
}

}  // namespace
}  // namespace fdi::idl
