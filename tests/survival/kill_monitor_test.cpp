// fdi-monitor killed while it diagnoses and records valves whose faults come
// and go; the publisher and a subscriber live on.

#include <algorithm>
#include <csignal>
#include <iostream>
#include <map>
#include <optional>
#include <set>
#include <sstream>
#include <tuple>

#include <gtest/gtest.h>

#include "idl/endpoint.h"
#include "storage/history/history_database.h"
#include "storage/history/history_reader.h"
#include "storage/models/models.h"
#include "storage/runs/runs.h"
#include "tests/idl/test_domain.h"
#include "tests/monitor/linear_models.h"
#include "tests/storage/temporary_directory.h"
#include "tests/survival/faulty_plant.h"
#include "tests/survival/kill_rounds.h"
#include "tests/system/monitor_process.h"

namespace fdi::monitor {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using Clock = std::chrono::steady_clock;

constexpr std::int64_t kDetectionNs = 3'000'000'000;  // n_d samples.

// One transition of an episode.
using Step = std::tuple<std::uint64_t, std::string, std::int64_t>;

std::string ContentOf(const FaultEvent& event) {
  const Transition& t = event.transition;
  std::ostringstream text;
  text.precision(17);
  text << event.valve_id << ' ' << event.source_id << ' ' << event.seq << ' '
       << t.detection_stamp_ns << ' ' << t.faults << ' ' << t.factor << ' '
       << t.strength << ' ' << EndReasonName(t.reason) << ' ' << event.model_set
       << '@' << event.model_version << ' ' << event.model_hash;
  for (const FaultCandidate& each : event.candidates) {
    text << ' ' << each.fault << ':' << each.factor << ':' << each.strength
         << ':' << each.isolated;
  }
  return text.str();
}

class KilledMonitor : public testing::Test {
 protected:
  KilledMonitor() {
    storage::ModelStore(directory_.path() / "models.db",
                        storage::Access::kOccasionalWriter)
        .Save(LinearModels(), storage::Activation::kAlways);
    idl::DdsOptions dds;
    dds.domain = domain_.id();
    participant_.emplace(dds);
    decisions_.emplace(*participant_);
    events_.emplace(*participant_);
    plant_.emplace(*participant_);
  }

  std::unique_ptr<ChildProcess> Start(const std::string& record) {
    answers_.clear();
    started_ns_ = std::chrono::duration_cast<std::chrono::nanoseconds>(
                      std::chrono::system_clock::now().time_since_epoch())
                      .count();
    return std::make_unique<ChildProcess>(std::vector<std::string>{
        FDI_MONITOR_PROGRAM, "--data", directory_.path().string(), "--domain",
        std::to_string(domain_.id()), "--transport", "udp", "--log-level",
        "warning", "run", record});
  }

  void Take() {
    decisions_->Take(
        {[this](const idl::DecisionMessage& m, const idl::Reception& r) {
           if (r.sent_ns > started_ns_) {
             answers_[m.valve_id].push_back({m.verdict.seq, Clock::now()});
           }
         },
         {}},
        milliseconds(5));
    events_->Take(
        {[this](const FaultEvent& m, const idl::Reception&) { Keep(m); }, {}},
        milliseconds(0));
  }
  // An event that is sent again equals the first one.
  void Keep(const FaultEvent& event) {
    const Step step{event.episode_id,
                    std::string(TransitionName(event.transition.kind)),
                    event.transition.stamp_ns};
    (event.persisted ? persisted_ : unpersisted_).insert(step);
    const auto [first, is_new] = contents_.emplace(step, ContentOf(event));
    repeats_ += is_new ? 0 : 1;
    EXPECT_EQ(first->second, ContentOf(event)) << event.valve_id;
  }
  void TakeFor(milliseconds time) {
    for (const auto end = Clock::now() + time; Clock::now() < end;) {
      Take();
    }
  }
  // @returns the time until the valves had answered; nothing after two minutes.
  std::optional<milliseconds> AwaitAnswers(std::size_t valves) {
    const auto start = Clock::now();
    while (answers_.size() < valves) {
      if (Clock::now() - start > seconds(120)) {
        return std::nullopt;
      }
      Take();
    }
    return std::chrono::duration_cast<milliseconds>(Clock::now() - start);
  }

  void ExpectPersistedOnce() const;
  void ExpectRecorded(std::uint64_t from, Clock::time_point killed);
  std::map<std::string, std::set<std::uint64_t>> RecordedSince(
      std::uint64_t from);
  void ExpectEpisodesInOrder() const;
  void ExpectOutagesNoted(std::size_t outages) const;

  const idl::TestDomain domain_;
  storage::TemporaryDirectory directory_;
  std::optional<idl::Participant> participant_;
  std::optional<idl::Subscriber<idl::DecisionMessage>> decisions_;
  std::optional<idl::Subscriber<FaultEvent>> events_;
  std::optional<FaultyPlant> plant_;
  std::int64_t started_ns_{0};
  // Since the monitor was started: which sample it had answered when.
  std::map<std::string,
           std::vector<std::pair<std::uint64_t, Clock::time_point>>>
      answers_;
  std::set<Step> persisted_;
  std::set<Step> unpersisted_;
  std::map<Step, std::string> contents_;
  int repeats_{0};
  std::vector<std::int64_t> killed_ns_;
  std::uint64_t recorded_{0};
  std::uint64_t lost_{0};
  std::vector<milliseconds> losses_;  // The age of the oldest sample lost.
};

// Every event published as persisted is in the history once, and nothing is
// there twice.
void KilledMonitor::ExpectPersistedOnce() const {
  storage::HistoryReader history(directory_.path() / "history.db");
  std::map<Step, int> stored;
  for (const storage::Episode& episode : history.List()) {
    for (const storage::HistoryEntry& event : history.Events(episode.id)) {
      ++stored[{episode.id, event.kind, event.stamp_ns}];
    }
  }
  for (const Step& step : persisted_) {
    EXPECT_TRUE(stored.contains(step))
        << storage::EpisodeIdText(std::get<0>(step)) << ' '
        << std::get<1>(step);
  }
  for (const auto& [step, count] : stored) {
    EXPECT_EQ(count, 1) << storage::EpisodeIdText(std::get<0>(step)) << ' '
                        << std::get<1>(step);
  }
}

// The runs since instant `from` have every sample that was answered up to the
// last commit.
void KilledMonitor::ExpectRecorded(std::uint64_t from,
                                   Clock::time_point killed) {
  const std::map<std::string, std::set<std::uint64_t>> recorded =
      RecordedSince(from);
  int missing = 0;
  Clock::duration longest{0};
  for (const auto& [valve, answers] : answers_) {
    const auto run = recorded.find(valve);
    for (const auto& [seq, when] : answers) {
      if (run == recorded.end() || seq > *run->second.rbegin()) {
        ++lost_;
        longest = std::max(longest, killed - when);
      } else {
        missing += !run->second.contains(seq);
      }
    }
  }
  EXPECT_EQ(missing, 0) << "samples missing before the end of their run";
  losses_.push_back(std::chrono::duration_cast<milliseconds>(longest));
}

// Content of the runs that began at instant `from` or later, one of each valve.
std::map<std::string, std::set<std::uint64_t>> KilledMonitor::RecordedSince(
    std::uint64_t from) {
  storage::RunStore runs(directory_.path() / "runs.db");
  storage::RunFilter filter;
  filter.since_ns = PlantSample(from).stamp_ns;
  std::map<std::string, std::set<std::uint64_t>> recorded;
  int wrong = 0;
  for (const storage::RunInfo& info : runs.List(filter)) {
    const int valve = std::stoi(info.run.valve_id.substr(1));
    EXPECT_FALSE(recorded.contains(info.run.valve_id)) << info.run.valve_id;
    std::set<std::uint64_t>& all = recorded[info.run.valve_id];
    for (const auto& [sample, truth, intake, first, swapped] :
         runs.Load(info.id).samples) {
      wrong += !all.empty() && sample.seq <= *all.rbegin();
      wrong += sample.values[Index(Signal::kX)] !=
               50.0 + OffsetOf(valve, sample.seq);
      all.insert(sample.seq);
      ++recorded_;
    }
  }
  EXPECT_EQ(wrong, 0) << "samples doubled, out of order or changed";
  return recorded;
}

// No episode of a valve begins before the one before has ended; one that was
// given up as unknown may have ended while the next was being detected.
void KilledMonitor::ExpectEpisodesInOrder() const {
  storage::HistoryReader history(directory_.path() / "history.db");
  std::map<std::string, storage::Episode> last;
  for (const storage::Episode& episode : history.List()) {
    EXPECT_TRUE(episode.ended_ns.has_value()) << episode.episode_id;
    const auto [before, first] = last.emplace(episode.valve_id, episode);
    if (!first) {
      const std::int64_t tolerated =
          before->second.end_reason == "unknown" ? kDetectionNs : 0;
      EXPECT_GE(episode.detected_ns + tolerated,
                before->second.ended_ns.value_or(0))
          << episode.valve_id << ' ' << episode.episode_id;
      before->second = episode;
    }
  }
}

// Each outage is a gap of all valves; an episode that was open then is resumed
// before anything else happens to it, or closed for a reason.
void KilledMonitor::ExpectOutagesNoted(std::size_t outages) const {
  storage::HistoryReader history(directory_.path() / "history.db");
  const std::vector<DataGap> gaps = history.Gaps();
  for (const std::int64_t killed_ns : killed_ns_) {
    EXPECT_TRUE(
        std::any_of(gaps.begin(), gaps.end(), [killed_ns](const DataGap& gap) {
          return gap.valve_id.empty() && gap.reason == "monitor_down" &&
                 gap.from_ns <= killed_ns && gap.to_ns >= killed_ns;
        }));
  }
  EXPECT_EQ(killed_ns_.size(), outages);
  int resumed = 0;
  int unknown = 0;
  for (const storage::Episode& episode : history.List()) {
    std::size_t session = 0;
    for (const storage::HistoryEntry& event : history.Events(episode.id)) {
      const auto died = std::lower_bound(killed_ns_.begin(), killed_ns_.end(),
                                         event.recorded_ns);
      const auto now = static_cast<std::size_t>(died - killed_ns_.begin());
      const bool begins = event.kind == "DETECTED";
      if (!begins && now != session) {
        EXPECT_TRUE(event.kind == "RESUMED" || event.kind == "CLOSED")
            << episode.episode_id << ' ' << event.kind;
        resumed += event.kind == "RESUMED";
        unknown += event.reason == "unknown";
      }
      session = now;
    }
  }
  std::cout << "monitor: " << resumed << " episodes resumed, " << unknown
            << " closed unknown after an outage\n";
}

// Not judged: a machine that does other things besides may keep any round
// waiting.
void Tell(const char* what, std::vector<milliseconds> times) {
  std::sort(times.begin(), times.end());
  std::cout << "monitor: " << what << " after "
            << times[times.size() / 2].count() << " ms (median), "
            << times.back().count() << " ms (longest)\n";
}

TEST_F(KilledMonitor, LosesNoPersistedEventAndDiagnosesAgain) {
  RandomMoments moments(5);
  const int rounds = KillRounds();
  std::vector<milliseconds> starts;
  for (int round = 0; round < rounds; ++round) {
    SCOPED_TRACE("round " + std::to_string(round));
    const int valves = round == 0
                           ? FaultyPlant::kMaxValves
                           : moments.Choose({20, 20, 50, 100, 300, 1000});
    plant_->SetValves(valves);
    const std::uint64_t from = plant_->next() + 1;
    const auto monitor =
        Start(round % 2 == 0 ? "--record" : "--record=lossless");
    const auto answered = AwaitAnswers(static_cast<std::size_t>(valves));
    ASSERT_TRUE(answered.has_value())
        << answers_.size() << " of " << valves << "; " << monitor->errors();
    starts.push_back(*answered);
    TakeFor(moments.Within(milliseconds(0), milliseconds(3500)));
    monitor->Signal(SIGKILL);
    const Clock::time_point killed = Clock::now();
    killed_ns_.push_back(
        std::chrono::duration_cast<std::chrono::nanoseconds>(
            std::chrono::system_clock::now().time_since_epoch())
            .count());
    ASSERT_EQ(monitor->AwaitExit(), 128 + SIGKILL);
    TakeFor(milliseconds(50));
    EXPECT_EQ(Doctor(directory_.path()), "");
    ExpectPersistedOnce();
    ExpectRecorded(from, killed);
  }

  plant_->SetValves(FaultyPlant::kMaxValves);
  const auto monitor = Start("--record");
  ASSERT_TRUE(AwaitAnswers(FaultyPlant::kMaxValves).has_value())
      << monitor->errors();
  plant_->EndStreams();
  TakeFor(seconds(2));
  monitor->Signal(SIGTERM);
  EXPECT_EQ(monitor->AwaitExit(), 0) << monitor->errors();
  EXPECT_EQ(Doctor(directory_.path()), "");
  ExpectPersistedOnce();
  ExpectEpisodesInOrder();
  ExpectOutagesNoted(static_cast<std::size_t>(rounds));

  EXPECT_GT(recorded_, 0U);
  Tell("all valves answered", starts);
  Tell("oldest sample lost", losses_);
  std::cout << "monitor: " << rounds << " rounds, " << persisted_.size()
            << " events persisted, " << unpersisted_.size() << " not, "
            << repeats_ << " of them sent again, " << recorded_
            << " samples recorded, " << lost_ << " answered but not recorded\n";
}

}  // namespace
}  // namespace fdi::monitor
