#include <chrono>
#include <map>

#include <gtest/gtest.h>

#include "tests/system/monitor_fixture.h"

namespace fdi::monitor {
namespace {

using LateListenerTest = MonitorFixture;

// Vectors by valve, of those that come within a while.
std::map<std::string, std::vector<std::uint64_t>> Heard(
    idl::Subscriber<idl::DecisionMessage>& subscriber) {
  std::map<std::string, std::vector<std::uint64_t>> heard;
  const auto until = std::chrono::steady_clock::now() + std::chrono::seconds(2);
  while (std::chrono::steady_clock::now() < until) {
    subscriber.Take({[&](const idl::DecisionMessage& m, const auto&) {
                       heard[m.valve_id].push_back(m.verdict.seq);
                     },
                     {}},
                    std::chrono::milliseconds(50));
  }
  return heard;
}

// Nobody reads the live stream while the vectors are made.
TEST_F(LateListenerTest, GetsTheLastVectorOfEveryValveOnceThenAll) {
  const auto monitor = StartMonitor();
  for (std::uint64_t k = 0; k < 40; ++k) {
    Publish(PlantSample(k), "V1");
    Publish(PlantSample(k), "V2");
  }
  ASSERT_TRUE(AwaitVectors(80));

  idl::Participant here(participant_->options());
  idl::Subscriber<idl::DecisionMessage> late(here);
  ASSERT_TRUE(late.WaitForWriters(1, kMonitorPatience));
  auto heard = Heard(late);
  EXPECT_EQ(heard["V1"], std::vector<std::uint64_t>{39});
  EXPECT_EQ(heard["V2"], std::vector<std::uint64_t>{39});

  Publish(PlantSample(40), "V1");
  ASSERT_TRUE(AwaitVectors(81));
  heard = Heard(late);
  EXPECT_EQ(heard["V1"], std::vector<std::uint64_t>{40});
  EXPECT_TRUE(heard["V2"].empty());
}

// As many valves as the monitor takes, the first of which falls silent.
TEST_F(LateListenerTest, GetsTheLastVectorOfASilentValveOfAFullMonitor) {
  const auto monitor = StartMonitor({"--max-valves", "2"});
  idl::Participant here(participant_->options());
  const idl::Subscriber<idl::DecisionMessage> early(here);
  ASSERT_TRUE(Await([this] { return counters_["dds_decision_readers"] > 1; }));
  for (const char* valve : {"V1", "V2"}) {
    for (std::uint64_t k = 0; k < 40; ++k) {
      Publish(PlantSample(k), valve);
    }
  }
  ASSERT_TRUE(AwaitVectors(80));

  idl::Subscriber<idl::DecisionMessage> late(here);
  ASSERT_TRUE(late.WaitForWriters(1, kMonitorPatience));
  auto heard = Heard(late);
  EXPECT_EQ(heard["V1"], std::vector<std::uint64_t>{39});
  EXPECT_EQ(heard["V2"], std::vector<std::uint64_t>{39});
}

}  // namespace
}  // namespace fdi::monitor
