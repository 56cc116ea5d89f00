// A pair of monitors that are killed while valves fail and recover, at 20 times
// the real time: what subscribers were told and what both histories hold has to
// be one and the same. FDI_PAIR_ROUNDS=50 is the long form.
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <map>
#include <memory>
#include <set>
#include <tuple>

#include <gtest/gtest.h>

#include "storage/history/history_reader.h"
#include "tests/idl/test_domain.h"
#include "tests/storage/temporary_directory.h"
#include "tests/survival/kill_rounds.h"
#include "tests/survival/pair_plant.h"
#include "tests/system/monitor_process.h"

namespace fdi::monitor {
namespace {

using std::chrono::milliseconds;

constexpr int kAttackedValves = 20;

int PairRounds(int otherwise) {
  const char* text = std::getenv("FDI_PAIR_ROUNDS");
  return text == nullptr ? otherwise : std::atoi(text);
}

using TransitionKey = std::tuple<std::uint64_t, std::string, std::int64_t>;

/// What one of the two has stored.
struct Stored {
  std::map<std::uint64_t, storage::Episode> episodes;
  std::set<TransitionKey> transitions;
};

Stored ReadHistory(const std::filesystem::path& data) {
  storage::HistoryReader reader(data / "history.db");
  Stored stored;
  for (const storage::Episode& episode : reader.List()) {
    stored.episodes[episode.id] = episode;
    for (const storage::HistoryEntry& entry : reader.Events(episode.id)) {
      if (entry.kind != "RESUMED") {  // Of this monitor alone.
        stored.transitions.emplace(episode.id, entry.kind, entry.stamp_ns);
      }
    }
  }
  return stored;
}

/// Pairs of episodes of one valve of which the later began before the other
/// one's end. One that is closed as superseded gives way to the other.
int Overlaps(const Stored& stored) {
  std::map<std::string, std::map<std::int64_t, std::int64_t>> spans;
  int overlaps = 0;
  for (const auto& [id, episode] : stored.episodes) {
    if (episode.end_reason == EndReasonName(EndReason::kSuperseded)) {
      continue;
    }
    const auto [span, fresh] = spans[episode.valve_id].try_emplace(
        episode.detected_ns,
        episode.ended_ns.value_or(std::numeric_limits<std::int64_t>::max()));
    overlaps += fresh ? 0 : 1;
  }
  for (const auto& [valve, of_valve] : spans) {
    std::int64_t ended = std::numeric_limits<std::int64_t>::min();
    for (const auto& [detected, end] : of_valve) {
      overlaps += detected < ended ? 1 : 0;
      ended = std::max(ended, end);
    }
  }
  return overlaps;
}

int Superseded(const Stored& stored) {
  return static_cast<int>(std::ranges::count_if(stored.episodes, [](auto& e) {
    return e.second.end_reason == EndReasonName(EndReason::kSuperseded);
  }));
}

class PairAttackTest : public testing::Test {
 protected:
  PairAttackTest()
      : plant_(domain_.Options(), kAttackedValves, kAttackedValves,
               milliseconds(50)) {
    plant_.SetGrowth(2.5);
    for (int i = 0; i < 2; ++i) {
      StorePairModels(data_[i].path());
      Start(i);
    }
  }

  void Start(int i) {
    monitors_[i] = std::make_unique<ChildProcess>(std::vector<std::string>{
        FDI_MONITOR_PROGRAM, "--data", data_[i].path().string(), "--domain",
        std::to_string(domain_.id()), "run", "--pair", "attacked", "--rank",
        std::to_string(i + 1)});
  }
  void Kill(int i) {
    monitors_[i]->Signal(SIGKILL);
    monitors_[i]->AwaitExit();
    Start(i);
  }
  /// Waits until both speak and one leads. @returns which one leads.
  int Leader() {
    int leader = -1;
    EXPECT_TRUE(Await([&] {
      const auto leaders = plant_.Leaders();
      for (int i = 0; i < 2; ++i) {
        leader = leaders == std::vector{std::to_string(monitors_[i]->pid())}
                     ? i
                     : leader;
      }
      return leader >= 0 && plant_.Words().size() == 2;
    }));
    return std::max(leader, 0);
  }

  /// Faults come and go, whatever happens to the monitors.
  void Attack(int rounds, const std::function<void(int, int)>& strike) {
    RandomMoments moments(31);
    Leader();
    std::jthread faults([this](const std::stop_token& stop) {
      RandomMoments lengths(32);
      for (bool on = true; !stop.stop_requested(); on = !on) {
        plant_.SetFaulty(on);
        std::this_thread::sleep_for(
            lengths.Within(milliseconds(1500), milliseconds(3000)));
      }
    });
    for (int round = 0; round < PairRounds(rounds); ++round) {
      const int leader = Leader();
      std::this_thread::sleep_for(
          moments.Within(milliseconds(500), milliseconds(2500)));
      strike(round, leader);
    }
    faults.request_stop();
    faults.join();
    Finish();
  }

  /// The valves recover, all episodes end, both monitors stop.
  void Finish() {
    plant_.SetFaulty(false);
    EXPECT_TRUE(Await([this] { return plant_.Settled(); }));
    Await([this] { return plant_.Open() == 0; }, milliseconds(10'000));
    // The minute within which an episode may be resumed passes in 3 s.
    std::this_thread::sleep_for(milliseconds(4000));
    for (const auto& monitor : monitors_) {
      monitor->Signal(SIGTERM);
    }
    for (const auto& monitor : monitors_) {
      EXPECT_EQ(monitor->AwaitExit(), 0) << monitor->errors();
    }
  }

  void ExpectOneRecord() {
    const Stored one = ReadHistory(data_[0].path());
    const Stored two = ReadHistory(data_[1].path());
    std::map<std::uint64_t, int> ends;
    std::set<std::uint64_t> on_bus;
    int unstored = 0;
    const std::vector<FaultEvent> events = plant_.Events();
    for (const FaultEvent& event : events) {
      on_bus.insert(event.episode_id);
      const TransitionKey key{event.episode_id,
                              TransitionName(event.transition.kind),
                              event.transition.stamp_ns};
      ends[event.episode_id] +=
          event.transition.kind == TransitionKind::kClosed ? 1 : 0;
      if (event.persisted && !one.transitions.contains(key) &&
          !two.transitions.contains(key)) {
        ++unstored;
        Note("unstored", event);
      }
    }
    int double_ends = 0;
    for (const auto& [episode, count] : ends) {
      double_ends += count > 1 ? 1 : 0;
    }
    int missing = 0;
    int ends_differ = 0;
    for (const auto& [id, episode] : one.episodes) {
      const auto other = two.episodes.find(id);
      if (other == two.episodes.end()) {
        ++missing;
      } else {
        ends_differ += episode.ended_ns != other->second.ended_ns ||
                               episode.end_reason != other->second.end_reason
                           ? 1
                           : 0;
      }
    }
    for (const auto& [id, episode] : two.episodes) {
      missing += one.episodes.contains(id) ? 0 : 1;
    }
    int open = 0;
    for (const Stored* each : {&one, &two}) {
      for (const auto& [id, episode] : each->episodes) {
        open += episode.ended_ns ? 0 : 1;
      }
    }
    std::printf(
        "episodes: %zu on the bus, %zu and %zu in the histories; %zu "
        "transitions; double ends %d, overlaps %d and %d, persisted but not "
        "stored %d, episodes in one history alone %d, ends that differ %d, "
        "superseded %d and %d, open %d, transitions that differ %zu\n",
        on_bus.size(), one.episodes.size(), two.episodes.size(), events.size(),
        double_ends, Overlaps(one), Overlaps(two), unstored, missing,
        ends_differ, Superseded(one), Superseded(two), open,
        Differing(one, two));
    EXPECT_GT(on_bus.size(), kAttackedValves);
    EXPECT_EQ(double_ends, 0);
    EXPECT_EQ(Overlaps(one), 0);
    EXPECT_EQ(Overlaps(two), 0);
    EXPECT_EQ(unstored, 0);
    EXPECT_EQ(missing, 0);
    EXPECT_EQ(ends_differ, 0);
    EXPECT_EQ(open, 0);
  }

  static void Note(const char* what, const FaultEvent& event) {
    std::printf("%s: %s %s %s\n", what, event.valve_id.c_str(),
                storage::EpisodeIdText(event.episode_id).c_str(),
                std::string(TransitionName(event.transition.kind)).c_str());
  }

  static std::size_t Differing(const Stored& one, const Stored& two) {
    std::vector<TransitionKey> differing;
    std::ranges::set_symmetric_difference(one.transitions, two.transitions,
                                          std::back_inserter(differing));
    return differing.size();
  }

  void TearDown() override {
    for (int i = 0; i < 2; ++i) {
      if (const char* folder = std::getenv("FDI_PAIR_KEEP")) {
        std::filesystem::copy(
            data_[i].path(), std::string(folder) + "/" + std::to_string(i),
            std::filesystem::copy_options::recursive |
                std::filesystem::copy_options::overwrite_existing);
      }
    }
  }

  const idl::TestDomain domain_;
  storage::TemporaryDirectory data_[2];
  PairPlant plant_;
  std::unique_ptr<ChildProcess> monitors_[2];
};

// Episodes that had ended came back to life in the monitor that was restarted.
TEST_F(PairAttackTest, KillsOfBothInTurnLeaveOneRecord) {
  Attack(7, [this](int round, int leader) {
    Kill(round % 2 == 0 ? leader : 1 - leader);
  });
  ExpectOneRecord();
}

// When one goes on, it has samples of the time in which the other one led,
// which had started later than it.
TEST_F(PairAttackTest, LeadersThatHangLeaveOneRecord) {
  RandomMoments lengths(34);
  Attack(6, [&](int round, int leader) {
    if (round % 2 == 0) {
      return Kill(1 - leader);
    }
    monitors_[leader]->Signal(SIGSTOP);
    std::this_thread::sleep_for(
        lengths.Within(milliseconds(100), milliseconds(2000)));
    monitors_[leader]->Signal(SIGCONT);
  });
  ExpectOneRecord();
}

// Its fresh observers detected the faults at other samples than the leader.
TEST_F(PairAttackTest, AStandbyThatSettlesAsValvesFailFindsNoEpisodeOfItsOwn) {
  RandomMoments moments(33);
  for (int round = 0; round < PairRounds(3); ++round) {
    plant_.SetFaulty(false);
    EXPECT_TRUE(
        Await([this] { return plant_.Open() == 0 && plant_.Settled(); }));
    const int standby = 1 - Leader();
    Kill(standby);
    EXPECT_TRUE(monitors_[standby]->AwaitLine("monitor_ready"));
    std::this_thread::sleep_for(
        moments.Within(milliseconds(0), milliseconds(1200)));
    plant_.SetFaulty(true);
    std::this_thread::sleep_for(milliseconds(2500));
  }
  Finish();
  ExpectOneRecord();
}

}  // namespace
}  // namespace fdi::monitor
