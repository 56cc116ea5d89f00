#include <fstream>
#include <map>
#include <memory>
#include <set>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/idl/dds_fixture.h"

namespace fdi::idl {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using std::chrono::steady_clock;

// The library's own limit is ten keys.
TEST_F(DeliveryTest, EveryOf2500ValvesIsServed) {
  constexpr int kValves = 2500;
  DdsOptions options = domain_.Options();
  options.max_valves = kValves;
  Participant here(options, log_.Sink());
  Participant there(options, log_.Sink());
  Subscriber<ValveSampleMessage> subscriber(here);
  Publisher<ValveSampleMessage> publisher(there, {Profile::kLossless});
  ASSERT_TRUE(publisher.WaitForReaders(1, kPatience));

  std::jthread writer([&] {
    for (std::uint64_t k = 0; k < 4; ++k) {
      for (int i = 0; i < kValves; ++i) {
        publisher.Write(SampleOf(ValveName(i), k));
      }
    }
  });
  OrderCheck check;
  TakeUntil(subscriber, check.AsHandlers(),
            [&] { return check.count == 4U * kValves; });

  EXPECT_EQ(check.count, 4U * kValves);
  EXPECT_EQ(check.next.size(), static_cast<std::size_t>(kValves));
  EXPECT_EQ(check.out_of_order, 0U);
  EXPECT_EQ(subscriber.status().rejected_instances, 0U);
}

TEST_F(DeliveryTest, ValvesBeyondTheLimitAreCountedAndNotServed) {
  DdsOptions options = domain_.Options();
  options.max_valves = 5;
  Participant here(options, log_.Sink());
  options.max_valves = 8;
  Participant there(options, log_.Sink());
  Subscriber<ValveSampleMessage> subscriber(here);
  Publisher<ValveSampleMessage> publisher(there, {Profile::kLossless});
  ASSERT_TRUE(publisher.WaitForReaders(1, kPatience));

  for (std::uint64_t k = 0; k < 10; ++k) {
    for (int i = 0; i < 8; ++i) {
      ASSERT_EQ(publisher.Write(SampleOf(ValveName(i), k)), WriteResult::kSent);
    }
  }
  OrderCheck check;
  TakeUntil(subscriber, check.AsHandlers(), [&] {
    return check.count == 50U && subscriber.status().rejected_instances >= 30U;
  });

  EXPECT_EQ(check.next.size(), 5U);
  EXPECT_EQ(check.count, 50U);
  EXPECT_EQ(subscriber.status().refused_valves, 3U);
  EXPECT_EQ(subscriber.status().rejected_instances, 30U);
}

TEST_F(DeliveryTest, APublisherRefusesValvesBeyondItsNumber) {
  Participant participant(domain_.Options(), log_.Sink());
  Publisher<ValveSampleMessage> publisher(participant, {Profile::kLossless, 2});

  EXPECT_EQ(publisher.Write(SampleOf("a", 0)), WriteResult::kSent);
  EXPECT_EQ(publisher.Write(SampleOf("b", 0)), WriteResult::kSent);
  EXPECT_EQ(publisher.Write(SampleOf("c", 0)), WriteResult::kTooManyValves);
  EXPECT_EQ(publisher.Write(SampleOf("a", 1)), WriteResult::kSent);
  EXPECT_EQ(publisher.status().refused, 1U);
  EXPECT_EQ(publisher.status().written, 3U);
}

TEST_F(DeliveryTest, APublisherThatReplacesGivesUpTheValveWrittenLongestAgo) {
  Participant participant(domain_.Options(), log_.Sink());
  Publisher<DecisionMessage> publisher(participant,
                                       {Profile::kLive, 2, {}, true});

  for (int i = 0; i < 5; ++i) {
    EXPECT_EQ(publisher.Write(DecisionOf(ValveName(i), 0)), WriteResult::kSent);
  }
  EXPECT_EQ(publisher.status().refused, 0U);
}

// The place of a valve that is gone is used again, not that of a silent one.
TEST_F(DeliveryTest, AnUnregisteredValveGivesItsPlaceToANewOne) {
  Participant here(domain_.Options(), log_.Sink());
  Participant there(domain_.Options(), log_.Sink());
  Publisher<DecisionMessage> publisher(there, {Profile::kLive, 3, {}, true});
  EXPECT_EQ(publisher.Write(DecisionOf("silent", 0)), WriteResult::kSent);
  for (int i = 0; i < 5; ++i) {
    const DecisionMessage gone = DecisionOf(ValveName(i), 0);
    EXPECT_EQ(publisher.Write(gone), WriteResult::kSent);
    publisher.Unregister(gone);
    publisher.Unregister(gone);
  }
  EXPECT_EQ(publisher.Write(DecisionOf("new", 0)), WriteResult::kSent);

  Subscriber<DecisionMessage> late(here);
  std::set<std::string> seen;
  const Handlers<DecisionMessage> handlers{
      [&](const DecisionMessage& message, const Reception&) {
        seen.insert(message.valve_id);
      },
      nullptr};
  TakeUntil(late, handlers, [&] { return seen.size() == 2; });
  EXPECT_EQ(seen, (std::set<std::string>{"silent", "new"}));
}

TEST_F(DeliveryTest, ALateJoinerHasTheLastDecisionOfEveryValve) {
  constexpr int kValves = 300;
  Participant here(domain_.Options(), log_.Sink());
  Participant there(domain_.Options(), log_.Sink());
  Publisher<DecisionMessage> publisher(there);
  for (std::uint64_t k = 0; k < 5; ++k) {
    for (int i = 0; i < kValves; ++i) {
      ASSERT_EQ(publisher.Write(DecisionOf(ValveName(i), k)),
                WriteResult::kSent);
    }
  }

  Subscriber<DecisionMessage> late(here);
  std::map<std::string, std::uint64_t> seen;
  std::size_t count = 0;
  const Handlers<DecisionMessage> handlers{
      [&](const DecisionMessage& message, const Reception&) {
        seen[message.valve_id] = message.verdict.seq;
        ++count;
      },
      nullptr};
  TakeUntil(late, handlers, [&] { return seen.size() == kValves; });

  ASSERT_EQ(seen.size(), static_cast<std::size_t>(kValves));
  EXPECT_EQ(count, static_cast<std::size_t>(kValves));
  for (const auto& [valve, seq] : seen) {
    EXPECT_EQ(seq, 4U) << valve;
  }
}

class LateReaderTest : public DeliveryTest,
                       public ::testing::WithParamInterface<Profile> {};

// The last samples of 1000 silent valves are 200 000 numbers back.
TEST_P(LateReaderTest, IsNotHeldUpBySilentValves) {
  Participant here(domain_.Options(), log_.Sink());
  Participant there(domain_.Options(), log_.Sink());
  Publisher<ValveSampleMessage> publisher(there, {GetParam()});
  for (std::uint64_t i = 0; i < 1000; ++i) {
    publisher.Write(SampleOf("silent" + std::to_string(i), i));
  }
  std::uint64_t number = 0;
  const auto write = [&] {
    const auto valve = "valve" + std::to_string(number % 100);
    ASSERT_EQ(publisher.Write(SampleOf(valve, number++)), WriteResult::kSent);
  };
  while (number < 200'000) {
    write();
  }

  Subscriber<ValveSampleMessage> late(here, {GetParam()});
  std::set<std::string> seen;
  const Handlers<ValveSampleMessage> handlers{
      [&](const ValveSampleMessage& message, const Reception&) {
        seen.insert(message.valve_id);
      },
      nullptr};
  TakeUntil(late, handlers, [&] {
    write();
    return seen.size() == 100;
  });

  EXPECT_EQ(seen.size(), 100U);
}

INSTANTIATE_TEST_SUITE_P(Profiles, LateReaderTest,
                         ::testing::Values(Profile::kLive, Profile::kLossless));

TEST_F(DeliveryTest, ALateReaderOfDecisionsIsNotHeldUpByASilentValve) {
  Participant here(domain_.Options(), log_.Sink());
  Participant there(domain_.Options(), log_.Sink());
  Publisher<DecisionMessage> publisher(there);
  publisher.Write(DecisionOf("silent", 0));
  std::uint64_t number = 0;
  for (; number < 1'000'000; ++number) {
    publisher.Write(
        DecisionOf(ValveName(static_cast<int>(number % 10)), number));
  }

  Subscriber<DecisionMessage> late(here);
  std::set<std::string> seen;
  const Handlers<DecisionMessage> handlers{
      [&](const DecisionMessage& message, const Reception&) {
        seen.insert(message.valve_id);
      },
      nullptr};
  EXPECT_TRUE(TakeUntil(late, handlers, [&] {
    ++number;
    publisher.Write(
        DecisionOf(ValveName(static_cast<int>(number % 10)), number));
    return seen.size() >= 10;
  }));
}

TEST_F(DeliveryTest, AnEndedStreamIsSeenBehindItsLastSample) {
  Participant here(domain_.Options(), log_.Sink());
  Participant there(domain_.Options(), log_.Sink());
  Subscriber<ValveSampleMessage> subscriber(here);
  Publisher<ValveSampleMessage> publisher(there, {Profile::kLossless});
  ASSERT_TRUE(publisher.WaitForReaders(1, kPatience));

  publisher.Write(SampleOf("goes", 0));
  publisher.Write(SampleOf("stays", 0));
  publisher.Write(SampleOf("goes", 1));
  publisher.Dispose(SampleOf("goes", 0));
  publisher.Write(SampleOf("stays", 1));
  std::vector<std::string> events;
  const Handlers<ValveSampleMessage> handlers{
      [&](const ValveSampleMessage& message, const Reception&) {
        events.push_back(message.valve_id + std::to_string(message.sample.seq));
      },
      [&](const ValveSampleMessage& message, const Reception&) {
        events.push_back(message.valve_id + " ended");
      }};
  TakeUntil(subscriber, handlers, [&] { return events.size() >= 5; });

  EXPECT_THAT(events, ::testing::ElementsAre("goes0", "stays0", "goes1",
                                             "goes ended", "stays1"));
  EXPECT_EQ(subscriber.status().ended, 1U);
}

// A valve goes over to version 2 of the samples with its first PV.
TEST_F(DeliveryTest, SamplesWithAndWithoutPvComeInOrderFromOnePublisher) {
  constexpr std::uint64_t kSamples = 2000;
  Participant here(domain_.Options(), log_.Sink());
  Participant there(domain_.Options(), log_.Sink());
  Subscriber<ValveSampleMessage> subscriber(here);
  Publisher<ValveSampleMessage> publisher(there, {Profile::kLossless, 3});
  ASSERT_TRUE(publisher.WaitForReaders(1, kPatience));
  EXPECT_EQ(publisher.status().matched, 1);

  std::jthread writer([&] {
    for (std::uint64_t k = 0; k < kSamples; ++k) {
      for (const std::string valve : {"never", "sometimes", "late"}) {
        ValveSampleMessage message = SampleOf(valve, k);
        if ((valve == "sometimes" && k % 3 != 0) ||
            (valve == "late" && k > kSamples / 2)) {
          message.sample.Set(Signal::kPv, static_cast<double>(k));
        }
        publisher.Write(message);
      }
    }
    for (const std::string valve : {"never", "sometimes", "late"}) {
      publisher.Dispose(SampleOf(valve, 0));
    }
  });
  OrderCheck check;
  std::map<std::string, std::uint64_t> pvs;
  std::map<std::string, std::uint64_t> last_writer;
  std::map<std::string, int> changes;  // By the writer, the first included.
  std::set<std::string> ended;
  Handlers<ValveSampleMessage> handlers = check.AsHandlers();
  handlers.on_message = [&, each = handlers.on_message](
                            const ValveSampleMessage& message,
                            const Reception& from) {
    each(message, from);
    std::uint64_t& last = last_writer[message.valve_id];
    changes[message.valve_id] += last != from.writer_id ? 1 : 0;
    last = from.writer_id;
    if (message.sample.Has(Signal::kPv)) {
      ++pvs[message.valve_id];
      EXPECT_EQ(message.sample[Signal::kPv],
                static_cast<double>(message.sample.seq));
    }
  };
  handlers.on_ended = [&](const ValveSampleMessage& message,
                          const Reception& from) {
    if (from.writer_id == last_writer[message.valve_id]) {
      EXPECT_EQ(check.next[message.valve_id], kSamples);
      ended.insert(message.valve_id);
    }
  };
  TakeUntil(subscriber, handlers, [&] { return ended.size() == 3; });

  EXPECT_EQ(check.count, 3 * kSamples);
  EXPECT_EQ(check.out_of_order, 0U);
  EXPECT_EQ(pvs["sometimes"], 1333U);
  EXPECT_EQ(pvs["late"], kSamples / 2 - 1);
  EXPECT_EQ(pvs.count("never"), 0U);
  // The order of two writers is not kept, so that a valve stays with one.
  EXPECT_EQ(changes["never"], 1);
  EXPECT_EQ(changes["sometimes"], 2);
  EXPECT_EQ(changes["late"], 2);
  EXPECT_EQ(subscriber.status().received, 3 * kSamples);
  EXPECT_EQ(subscriber.status().lost, 0U);
  EXPECT_EQ(subscriber.status().matched, 1);
  EXPECT_EQ(publisher.status().written, 3 * kSamples);
}

TEST_F(DeliveryTest, AnEndedValveMayComeBack) {
  Participant here(domain_.Options(), log_.Sink());
  Participant there(domain_.Options(), log_.Sink());
  Subscriber<ValveSampleMessage> subscriber(here);
  Publisher<ValveSampleMessage> publisher(there, {Profile::kLossless});
  ASSERT_TRUE(publisher.WaitForReaders(1, kPatience));

  publisher.Write(SampleOf("v", 0));
  publisher.Dispose(SampleOf("v", 0));
  publisher.Write(SampleOf("v", 1));
  publisher.Dispose(SampleOf("v", 0));
  int messages = 0;
  int ends = 0;
  const Handlers<ValveSampleMessage> handlers{
      [&](const ValveSampleMessage&, const Reception&) { ++messages; },
      [&](const ValveSampleMessage&, const Reception&) { ++ends; }};
  TakeUntil(subscriber, handlers, [&] { return messages + ends == 4; });

  EXPECT_EQ(messages, 2);
  EXPECT_EQ(ends, 2);
}

TEST_F(DeliveryTest, ATakeHandsOutNoMoreThanItsLimit) {
  Participant here(domain_.Options(), log_.Sink());
  Participant there(domain_.Options(), log_.Sink());
  Subscriber<ValveSampleMessage> subscriber(here);
  Publisher<ValveSampleMessage> publisher(there, {Profile::kLossless});
  ASSERT_TRUE(publisher.WaitForReaders(1, milliseconds::max()));
  for (std::uint64_t k = 0; k < 10; ++k) {
    publisher.Write(SampleOf("v", k));
  }
  ASSERT_TRUE(publisher.WaitForAcknowledged(milliseconds::max()));

  OrderCheck check;
  EXPECT_EQ(subscriber.Take(check.AsHandlers(), kPatience, 3), 3);
  EXPECT_EQ(check.count, 3U);
  EXPECT_EQ(subscriber.Take(check.AsHandlers(), kPatience), 7);
}

TEST_F(DeliveryTest, AnInterruptWakesATakeThatWaits) {
  Participant participant(domain_.Options(), log_.Sink());
  Subscriber<ValveSampleMessage> subscriber(participant);
  const auto start = steady_clock::now();

  std::jthread waker([&] { subscriber.Interrupt(); });

  EXPECT_EQ(subscriber.Take({}, 10 * kPatience), 0);
  EXPECT_LT(steady_clock::now() - start, 5 * kPatience);
}

TEST_F(DeliveryTest, DomainsDoNotMeet) {
  const TestDomain other;
  Participant here(domain_.Options(), log_.Sink());
  Participant there(other.Options(), log_.Sink());
  Subscriber<ValveSampleMessage> subscriber(here);
  Publisher<ValveSampleMessage> publisher(there);

  EXPECT_FALSE(publisher.WaitForReaders(1, seconds(2)));
  EXPECT_EQ(subscriber.status().matched, 0);
}

TEST_F(DeliveryTest, SharedMemoryDeliversToo) {
  DdsOptions options = domain_.Options();
  options.transport = "shm";
  Participant here(options, log_.Sink());
  Participant there(options, log_.Sink());
  Subscriber<ValveSampleMessage> subscriber(here);
  Publisher<ValveSampleMessage> publisher(there, {Profile::kLossless});
  ASSERT_TRUE(publisher.WaitForReaders(1, kPatience));

  publisher.Write(SampleOf("v", 0));
  OrderCheck check;
  EXPECT_TRUE(TakeUntil(subscriber, check.AsHandlers(),
                        [&] { return check.count == 1; }));
}

long ResidentKilobytes() {
  std::ifstream file("/proc/self/status");
  for (std::string word; file >> word;) {
    if (word == "VmRSS:") {
      long kilobytes = 0;
      file >> kilobytes;
      return kilobytes;
    }
  }
  return -1;
}

// Histories that are allocated ahead, for throughput, would take gigabytes.
TEST_F(DeliveryTest, NoMemoryIsTakenForValvesThatAreNotThere) {
  DdsOptions options = domain_.Options();
  options.max_valves = 100000;
  Participant participant(options, log_.Sink());
  const long before = ResidentKilobytes();

  Publisher<ValveSampleMessage> samples_out(participant);
  Publisher<ValveSampleMessage> all_out(participant, {Profile::kLossless});
  Subscriber<ValveSampleMessage> samples_in(participant);
  Publisher<DecisionMessage> decisions_out(participant);
  Subscriber<DecisionMessage> decisions_in(participant);
  Publisher<DecisionBatchMessage> batches_out(participant);
  Subscriber<DecisionBatchMessage> batches_in(participant);
  Publisher<FaultEvent> events_out(participant);
  Subscriber<FaultEvent> events_in(participant);

  ASSERT_GT(before, 0);
  EXPECT_LT(ResidentKilobytes() - before, 10000);
}

}  // namespace
}  // namespace fdi::idl
