#include "monitor/heartbeat.h"

#include <atomic>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "monitor/pipeline.h"
#include "monitor/recorder.h"
#include "tests/monitor/fake_sinks.h"
#include "tests/monitor/linear_models.h"

namespace fdi::monitor {
namespace {

using std::chrono::milliseconds;
using testing::ElementsAre;
using testing::IsEmpty;
using TimePoint = Heartbeat::TimePoint;

TimePoint Now() {
  return Pulse::Clock::now();
}

// Waits for what threads bring about without a word; 60 s at most.
template <typename Condition>
bool Eventually(Condition condition) {
  const TimePoint deadline = Now() + std::chrono::seconds(60);
  while (!condition()) {
    if (Now() > deadline) {
      return false;
    }
    std::this_thread::sleep_for(milliseconds(5));
  }
  return true;
}

TEST(WatchdogTest, IsDueOncePerIntervalWhileAllThreadsBeat) {
  Pulse pulse;
  const Heartbeat heartbeat({{"diagnosis", &pulse}});
  const TimePoint start = Now() - milliseconds(1);
  Watchdog watchdog(heartbeat, milliseconds(100), start);
  pulse.Beat();

  EXPECT_FALSE(watchdog.Due(start + milliseconds(99)));
  EXPECT_TRUE(watchdog.Due(start + milliseconds(100)));
  EXPECT_EQ(watchdog.next(), start + milliseconds(200));
}

TEST(WatchdogTest, OneSilentThreadKeepsItSilentUntilItBeatsAgain) {
  Pulse alive;
  Pulse stuck;
  const Heartbeat heartbeat({{"diagnosis", &alive}, {"writer", &stuck}});
  const TimePoint start = Now();
  Watchdog watchdog(heartbeat, milliseconds(1), start);
  ASSERT_TRUE(Eventually([&] { return Now() > start; }));
  alive.Beat();

  EXPECT_FALSE(watchdog.Due(start + milliseconds(10)));
  EXPECT_THAT(heartbeat.StalledSince(start), ElementsAre("writer"));
  stuck.Beat();
  EXPECT_TRUE(watchdog.Due(start + milliseconds(10)));
}

// The threads of a pipeline whose sinks hold them up.
class PipelineHeartbeatTest : public testing::Test {
 protected:
  PipelineHeartbeatTest() {
    PipelineOptions options;
    options.journal.commit_period = milliseconds(20);
    pipeline_ = std::make_unique<Pipeline>(
        options, PipelineSinks{bus_, bus_, history_},
        std::make_shared<FixedResolver>(SharedLinearModels()),
        MonitorContext{counters_, log_, [] { return std::int64_t{1'000}; }});
    recorder_.emplace(
        runs_, MonitorContext{counters_, log_, [] { return std::int64_t{0}; }},
        RecorderOptions{.commit_period = milliseconds(20)},
        [](const DataGap&) {});
    pipeline_->Attach(*recorder_);
    recorder_->Start();
    pipeline_->Start({});
    // The diagnosis thread of a service.
    diagnosis_ = std::jthread([this](const std::stop_token& stop) {
      while (!stop.stop_requested()) {
        for (; offered_ < wanted_; ++offered_) {
          pipeline_->OnSample(
              "V1", PlantSample(offered_, offered_ < 50 ? 0.0 : kF7Offset), 1);
        }
        pipeline_->Poll();
        std::this_thread::sleep_for(milliseconds(5));
      }
    });
  }
  ~PipelineHeartbeatTest() override {
    diagnosis_.request_stop();
    diagnosis_.join();
  }

  Heartbeat Threads() const {
    std::vector<Heartbeat::Member> threads = pipeline_->threads();
    threads.push_back({"recorder", &recorder_->pulse()});
    return Heartbeat(threads);
  }
  /// Threads that stand still from now on.
  std::vector<std::string_view> Stalled(const Heartbeat& heartbeat) const {
    const TimePoint since = Now() + milliseconds(50);
    EXPECT_TRUE(Eventually([&] { return Now() > since + milliseconds(400); }));
    return heartbeat.StalledSince(since);
  }

  FakeBus bus_;
  FakeHistory history_;
  FakeRuns runs_;
  Counters counters_;
  ThrottledLog log_{{}};
  std::optional<Recorder> recorder_;
  std::unique_ptr<Pipeline> pipeline_;
  std::uint64_t offered_{0};
  std::atomic<std::uint64_t> wanted_{0};
  std::jthread diagnosis_;
};

TEST_F(PipelineHeartbeatTest, IdleThreadsBeat) {
  EXPECT_THAT(Stalled(Threads()), IsEmpty());
}

TEST_F(PipelineHeartbeatTest, ABusThatHoldsTheDiagnosisUpIsSeen) {
  bus_.notice.Apply([this] { bus_.held = true; });
  wanted_ = 1;

  EXPECT_THAT(Stalled(Threads()), ElementsAre("diagnosis"));
  bus_.notice.Apply([this] { bus_.held = false; });
}

TEST_F(PipelineHeartbeatTest, AHistoryThatDoesNotReturnIsSeen) {
  history_.notice.Apply([this] { history_.stuck = true; });
  wanted_ = 80;

  EXPECT_THAT(Stalled(Threads()), ElementsAre("history"));
  history_.notice.Apply([this] { history_.stuck = false; });
}

TEST_F(PipelineHeartbeatTest, ARecorderThatDoesNotReturnIsSeen) {
  runs_.notice.Apply([this] { runs_.held = true; });
  wanted_ = 1;

  EXPECT_THAT(Stalled(Threads()), ElementsAre("recorder"));
  runs_.notice.Apply([this] { runs_.held = false; });
}

TEST_F(PipelineHeartbeatTest, AHistoryThatFailsIsNotOneThatIsStuck) {
  history_.notice.Apply([this] { history_.broken = true; });
  ASSERT_TRUE(
      Eventually([this] { return counters_[Counter::kPersistFailures] > 0; }));

  const TimePoint since = Now();
  EXPECT_TRUE(
      Eventually([&] { return Threads().StalledSince(since).empty(); }));
}

}  // namespace
}  // namespace fdi::monitor
