// fdi-simulator killed while it records, with and without a bus.

#include <csignal>
#include <cstring>
#include <iostream>
#include <map>
#include <optional>
#include <set>
#include <thread>

#include <gtest/gtest.h>

#include "idl/endpoint.h"
#include "storage/runs/runs.h"
#include "tests/idl/test_domain.h"
#include "tests/storage/temporary_directory.h"
#include "tests/survival/kill_rounds.h"
#include "tests/system/monitor_process.h"

namespace fdi {
namespace {

using std::chrono::milliseconds;
using Clock = std::chrono::steady_clock;

using SamplesByValve = std::map<std::string, std::vector<Sample>>;

bool SameValues(const Sample& a, const Sample& b) {
  return a.seq == b.seq && a.stamp_ns == b.stamp_ns && a.present == b.present &&
         std::memcmp(&a.values, &b.values, sizeof a.values) == 0;
}

class KilledSimulator : public testing::Test {
 protected:
  std::vector<std::string> Command(const std::filesystem::path& data,
                                   const std::vector<std::string>& more) const {
    std::vector<std::string> command{FDI_SIMULATOR_PROGRAM,
                                     "--data",
                                     data.string(),
                                     "--domain",
                                     Domain(),
                                     "--transport",
                                     "udp",
                                     "run",
                                     "--record",
                                     "--count",
                                     "20",
                                     "--start",
                                     "2026-01-01T00:00:00Z",
                                     "--fault",
                                     "f19:abrupt@100:strength=0.5"};
    command.insert(command.end(), more.begin(), more.end());
    return command;
  }
  std::string Domain() const { return std::to_string(domain_.id()); }

  // The newest recorder's; the runs of those before are interrupted.
  static SamplesByValve NewestRuns(const std::filesystem::path& data,
                                   std::set<std::string>& known) {
    SamplesByValve all;
    if (!std::filesystem::exists(data / "runs.db")) {
      return all;
    }
    storage::RunStore store(data / "runs.db");
    for (const storage::RunInfo& info : store.List()) {
      if (!known.insert(info.id).second) {
        EXPECT_NE(info.state, storage::RunState::kRecording) << info.id;
        continue;
      }
      std::vector<Sample>& samples = all[info.run.valve_id];
      if (info.samples == 0) {
        continue;
      }
      for (const storage::StoredSample& stored : store.Load(info.id).samples) {
        samples.push_back(stored.sample);
      }
    }
    return all;
  }

  const idl::TestDomain domain_;
  storage::TemporaryDirectory directory_;
};

TEST_F(KilledSimulator, HasRecordedTheBeginningOfTheRun) {
  const std::vector<std::string> options{"--no-publish", "--duration", "1500"};
  const std::filesystem::path whole = directory_.path() / "whole";
  const Finished reference = RunProgram(Command(whole, options));
  ASSERT_EQ(reference.code, 0) << reference.errors;
  std::set<std::string> ignored;
  const SamplesByValve expected = NewestRuns(whole, ignored);
  ASSERT_EQ(expected.size(), 20U);

  RandomMoments moments(3);
  const std::filesystem::path data = directory_.path() / "data";
  std::set<std::string> known;
  const int rounds = KillRounds();
  int killed = 0;
  std::size_t samples = 0;
  for (int round = 0; round < rounds; ++round) {
    SCOPED_TRACE("round " + std::to_string(round));
    killed +=
        RunAndKill(Command(data, options),
                   moments.Within(milliseconds(1), reference.took * 21 / 20));
    EXPECT_EQ(Doctor(data), "");
    for (const auto& [valve, recorded] : NewestRuns(data, known)) {
      const std::vector<Sample>& all = expected.at(valve);
      ASSERT_LE(recorded.size(), all.size());
      for (std::size_t k = 0; k < recorded.size(); ++k) {
        ASSERT_TRUE(SameValues(recorded[k], all[k])) << valve << ' ' << k;
      }
      samples += recorded.size();
    }
  }
  std::cout << "simulator, recording alone: " << rounds << " rounds, " << killed
            << " killed within " << reference.took.count() << " ms, " << samples
            << " samples kept, each as in the undisturbed run\n";
}

// Receives what the simulator publishes.
class Witness {
 public:
  explicit Witness(int domain) {
    idl::DdsOptions dds;
    dds.domain = domain;
    participant_.emplace(dds);
    samples_.emplace(*participant_);
  }

  void WatchUntil(Clock::time_point end) {
    while (Clock::now() < end) {
      Take();
    }
  }
  void Take() {
    samples_->Take(
        {[this](const idl::ValveSampleMessage& m, const idl::Reception&) {
           seen_[m.valve_id].push_back(m.sample.seq);
         },
         {}},
        milliseconds(10));
  }
  bool AwaitFirst() {
    const Clock::time_point end = Clock::now() + std::chrono::seconds(60);
    while (seen_.empty() && Clock::now() < end) {
      Take();
    }
    return !seen_.empty();
  }
  /// Samples that were received and are not in `recorded`.
  struct Missing {
    int before{0};  ///< The last one of their valve that is.
    int after{0};
  };
  Missing MissingIn(const SamplesByValve& recorded) const {
    Missing missing;
    for (const auto& [valve, received] : seen_) {
      std::set<std::uint64_t> kept;
      if (const auto run = recorded.find(valve); run != recorded.end()) {
        for (const Sample& sample : run->second) {
          kept.insert(sample.seq);
        }
      }
      for (const std::uint64_t seq : received) {
        const bool before = !kept.empty() && seq < *kept.rbegin();
        (before ? missing.before : missing.after) += !kept.contains(seq);
      }
    }
    return missing;
  }
  std::size_t count() const {
    std::size_t count = 0;
    for (const auto& [valve, received] : seen_) {
      count += received.size();
    }
    return count;
  }
  void Clear() { seen_.clear(); }

 private:
  std::optional<idl::Participant> participant_;
  std::optional<idl::Subscriber<idl::ValveSampleMessage>> samples_;
  std::map<std::string, std::vector<std::uint64_t>> seen_;
};

TEST_F(KilledSimulator, HasRecordedWhatItPublishedUpToItsLastCommit) {
  Witness witness(domain_.id());
  RandomMoments moments(4);
  const std::filesystem::path data = directory_.path() / "data";
  std::set<std::string> known;
  const int rounds = KillRounds();
  std::size_t published = 0;
  int unrecorded = 0;
  for (int round = 0; round < rounds; ++round) {
    SCOPED_TRACE("round " + std::to_string(round));
    witness.Clear();
    ChildProcess simulator(
        Command(data, {"--duration", "100000", "--speed", "100"}));
    ASSERT_TRUE(witness.AwaitFirst()) << simulator.errors();
    witness.WatchUntil(Clock::now() +
                       moments.Within(milliseconds(500), milliseconds(3000)));
    simulator.Signal(SIGKILL);
    ASSERT_EQ(simulator.AwaitExit(), 128 + SIGKILL);
    witness.WatchUntil(Clock::now() + milliseconds(50));
    EXPECT_EQ(Doctor(data), "");
    const SamplesByValve recorded = NewestRuns(data, known);
    const Witness::Missing missing = witness.MissingIn(recorded);
    EXPECT_EQ(missing.before, 0);
    published += witness.count();
    unrecorded += missing.after;
  }
  EXPECT_LT(unrecorded, static_cast<int>(published));
  std::cout << "simulator, publishing: " << rounds << " rounds, " << published
            << " samples received, " << unrecorded
            << " not committed before the kill\n";
}

}  // namespace
}  // namespace fdi
