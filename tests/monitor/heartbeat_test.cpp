#include "monitor/heartbeat.h"

#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "monitor/pipeline.h"
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

// Waits for what threads bring about without a word; 10 s at most.
template <typename Condition>
bool Eventually(Condition condition) {
  const TimePoint deadline = Now() + std::chrono::seconds(10);
  while (!condition()) {
    if (Now() > deadline) {
      return false;
    }
    std::this_thread::sleep_for(milliseconds(5));
  }
  return true;
}

TEST(WatchdogTest, TellsOncePerIntervalWhileAllThreadsBeat) {
  Pulse pulse;
  const Heartbeat heartbeat({{"intake", &pulse}});
  const TimePoint start = Now() - milliseconds(1);
  Watchdog watchdog(heartbeat, milliseconds(100), start);
  pulse.Beat();

  EXPECT_FALSE(watchdog.Tell(start + milliseconds(99)));
  EXPECT_TRUE(watchdog.Tell(start + milliseconds(100)));
  EXPECT_EQ(watchdog.next(), start + milliseconds(200));
}

TEST(WatchdogTest, OneSilentThreadKeepsItSilentUntilItBeatsAgain) {
  Pulse alive;
  Pulse stuck;
  const Heartbeat heartbeat({{"intake", &alive}, {"writer", &stuck}});
  const TimePoint start = Now();
  Watchdog watchdog(heartbeat, milliseconds(1), start);
  ASSERT_TRUE(Eventually([&] { return Now() > start; }));
  alive.Beat();

  EXPECT_FALSE(watchdog.Tell(start + milliseconds(10)));
  EXPECT_THAT(heartbeat.StalledSince(start), ElementsAre("writer"));
  stuck.Beat();
  EXPECT_TRUE(watchdog.Tell(start + milliseconds(10)));
}

// The threads of a pipeline whose sinks hold them up.
class PipelineHeartbeatTest : public testing::Test {
 protected:
  PipelineHeartbeatTest() {
    PipelineOptions options;
    options.history.utc_now_ns = [] { return std::int64_t{1'000}; };
    options.history.commit_period = milliseconds(20);
    options.recorder.commit_period = milliseconds(20);
    pipeline_ = std::make_unique<Pipeline>(
        options, PipelineSinks{bus_, bus_, history_, &runs_},
        std::make_shared<FixedResolver>(SharedLinearModels()), counters_, log_);
    pipeline_->Start({});
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
  std::unique_ptr<Pipeline> pipeline_;
};

TEST_F(PipelineHeartbeatTest, IdleThreadsBeat) {
  EXPECT_THAT(Stalled(Heartbeat(pipeline_->threads())), IsEmpty());
}

TEST_F(PipelineHeartbeatTest, ABusThatHoldsTheDiagnosisUpIsSeen) {
  bus_.notice.Apply([this] { bus_.held = true; });
  pipeline_->Offer("V1", PlantSample(0), 1);
  pipeline_->AnnounceOffers();

  EXPECT_THAT(Stalled(Heartbeat(pipeline_->threads())),
              ElementsAre("diagnosis"));
  bus_.notice.Apply([this] { bus_.held = false; });
}

TEST_F(PipelineHeartbeatTest, AHistoryThatDoesNotReturnIsSeen) {
  history_.notice.Apply([this] { history_.stuck = true; });
  for (std::uint64_t k = 0; k < 80; ++k) {
    pipeline_->Offer("V1", PlantSample(k, k < 50 ? 0.0 : kF7Offset), 1);
  }

  EXPECT_THAT(Stalled(Heartbeat(pipeline_->threads())), ElementsAre("history"));
  history_.notice.Apply([this] { history_.stuck = false; });
}

TEST_F(PipelineHeartbeatTest, ARecorderThatDoesNotReturnIsSeen) {
  runs_.notice.Apply([this] { runs_.held = true; });
  pipeline_->Offer("V1", PlantSample(0), 1);
  pipeline_->AnnounceOffers();

  EXPECT_THAT(Stalled(Heartbeat(pipeline_->threads())),
              ElementsAre("recorder"));
  runs_.notice.Apply([this] { runs_.held = false; });
}

TEST_F(PipelineHeartbeatTest, AHistoryThatFailsIsNotOneThatIsStuck) {
  history_.notice.Apply([this] { history_.broken = true; });
  ASSERT_TRUE(
      Eventually([this] { return counters_[Counter::kPersistFailures] > 0; }));

  const TimePoint since = Now();
  EXPECT_TRUE(Eventually([&] {
    return Heartbeat(pipeline_->threads()).StalledSince(since).empty();
  }));
}

}  // namespace
}  // namespace fdi::monitor
