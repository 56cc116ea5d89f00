#include <cmath>
#include <map>
#include <span>

#include <gmock/gmock.h>

#include "tests/monitor/pipeline_fixture.h"

namespace fdi::monitor {
namespace {

using testing::ElementsAre;

class FakeLive : public ValveListener {
 public:
  std::string_view name() const override { return "live"; }
  void OnVerdict(const std::string& valve_id, const Sample& sample,
                 const ValveOutcome& outcome) override {
    if (OutOfOrder(outcome.verdict.intake)) {
      return;
    }
    notice.Apply([&] {
      shown.push_back(
          valve_id + "/" + std::to_string(sample.seq) +
          (outcome.models != nullptr ? "" : "/bare") +
          (outcome.verdict.intake == Intake::kAccepted ? "" : "/bad") +
          (outcome.missing == 0 ? "" : "/missing"));
    });
  }
  void OnSilence(const std::string& valve_id, Silence silence) override {
    notice.Apply([&] { silences.emplace_back(valve_id, silence); });
  }
  void OnDrift(const std::string& valve_id,
               std::span<const FollowedDrift> channels) override {
    notice.Apply([&] { drift[valve_id] = channels[0]; });
  }

  Notice notice;
  std::vector<std::string> shown;
  std::vector<std::pair<std::string, Silence>> silences;
  std::map<std::string, FollowedDrift> drift;
};

class PipelineLiveTest : public PipelineTest {
 protected:
  PipelineLiveTest() { listeners_ = {&board_}; }
  // The board has to outlive the pipeline.
  ~PipelineLiveTest() override { pipeline_.reset(); }

  FakeLive board_;
};

TEST_F(PipelineLiveTest, ShowsEverySampleInItsOrder) {
  Start();
  Feed("V1", 0, 2);
  Feed("V1", 1, 2);  // Repeated: nothing new to show.
  pipeline_->OnSample("V1", BadSample(2), 1);
  Feed("bare", 0, 1);

  ASSERT_TRUE(board_.notice.Await([this] { return board_.shown.size() == 4; }));
  EXPECT_THAT(board_.shown,
              ElementsAre("V1/0", "V1/1", "V1/2/bad", "bare/0/bare"));
}

// The engine accepts the sample and abstains: people must learn why.
TEST_F(PipelineLiveTest, ASignalThatIsMissingIsShownAndLogged) {
  Start();
  Sample sample = PlantSample(0);
  sample.present = MaskOf(Signal::kCv);
  pipeline_->OnSample("V1", sample, 1);

  EXPECT_THAT(board_.shown, ElementsAre("V1/0/missing"));
  EXPECT_EQ(bus_.decisions.at(0).quality, Quality::kBadInput);
  EXPECT_EQ(counters_[Intake::kAccepted], 1U);
  EXPECT_THAT(lines_,
              testing::Contains("sample_rejected id=M116 reason=missing_signal "
                                "signal=X valve=V1 seq=0"));
}

TEST_F(PipelineLiveTest, ShowsWhenAValveEndsOrFallsSilent) {
  Start();
  Feed("V1", 0, 2);
  Feed("V2", 0, 2);
  pipeline_->OnStreamEnded("V1", 2);  // Somebody else's.
  pipeline_->OnStreamEnded("V1", 1);
  pipeline_->Poll(std::chrono::steady_clock::now() + std::chrono::seconds(4));

  ASSERT_TRUE(
      board_.notice.Await([this] { return board_.silences.size() == 2; }));
  EXPECT_THAT(board_.silences, ElementsAre(std::pair("V1", Silence::kEnded),
                                           std::pair("V2", Silence::kStale)));
}

// After the first hour the limits on the mean follow by 1/8 % an hour, up to
// 0.05 %; those on the noise by a factor of 2 in 8 h, up to 1.02. V1 is off
// downwards, V2 upwards, V3 to either side.
TEST_F(PipelineLiveTest, ADriftIsShownAndOnceAtItsBoundCountedAndLogged) {
  ModelSet models = LinearModels();
  models.channels[0].windows = {{30, -1.0, 1.0, 1.0}};
  models.channels[0].drift = {-0.05, 0.05, std::log(1.02)};
  models_ = std::make_shared<const ModelSet>(models);
  Start();
  const auto offer = [this](std::uint64_t from, std::uint64_t to) {
    Feed("V1", from, to, -0.2);
    Feed("V2", from, to, 0.2);
    for (std::uint64_t k = from; k < to; ++k) {
      pipeline_->OnSample("V3", PlantSample(k, k % 2 == 0 ? -2.3 : 2.3), 1);
    }
  };
  auto tend = [this, now = std::chrono::steady_clock::now()]() mutable {
    pipeline_->Poll(now += std::chrono::milliseconds(300));
  };

  offer(0, 3600 + 720);
  tend();
  EXPECT_NEAR(board_.drift.at("V1").mean, -0.025, 0.001);
  EXPECT_NEAR(board_.drift.at("V2").mean_used(), 0.5, 0.02);
  EXPECT_EQ(pipeline_->census().near_bound, 0U);
  EXPECT_THAT(lines_, testing::Each(testing::StartsWith("valve_seen")));
  lines_.clear();
  offer(3600 + 720, 3600 + 1350);
  tend();
  EXPECT_EQ(pipeline_->census().near_bound, 3U);
  offer(3600 + 1350, 3600 + 1500);
  tend();
  tend();

  EXPECT_EQ(board_.drift.at("V1").mean, -0.05);
  EXPECT_THAT(lines_,
              testing::UnorderedElementsAre(
                  "drift_at_bound id=M118 valve=V1 channel=X direction=down "
                  "followed=-0.05",
                  "drift_at_bound id=M118 valve=V2 channel=X direction=up "
                  "followed=0.05",
                  "drift_at_bound id=M118 valve=V3 channel=X direction=wider "
                  "followed=1.02"));
}

class FailingListener : public ValveListener {
 public:
  std::string_view name() const override { return "failing"; }
  void OnVerdict(const std::string& /*valve_id*/, const Sample& /*sample*/,
                 const ValveOutcome& /*outcome*/) override {
    throw std::runtime_error("no verdicts");
  }
  void OnSilence(const std::string& /*valve_id*/,
                 Silence /*silence*/) override {
    throw std::runtime_error("no silence");
  }
  void TakeCheckpoint(Checkpoint& /*checkpoint*/, bool /*urgent*/) override {
    throw std::runtime_error("no checkpoint");
  }
};

// Neither diagnosis nor journal notice, nor those that are told after it.
TEST_F(PipelineLiveTest, AListenerThatFailsIsCountedAndStopsNothing) {
  FailingListener failing;
  listeners_ = {&failing, &board_};
  Start();
  OfferEpisode("V1");
  ASSERT_TRUE(AwaitEvents(2));
  pipeline_->OnStreamEnded("V1", 1);
  pipeline_->Stop();

  EXPECT_EQ(bus_.decisions.size(), 80U);
  EXPECT_EQ(board_.shown.size(), 80U);
  EXPECT_EQ(board_.silences.size(), 1U);
  EXPECT_EQ(history_.recorded.size(), 3U);
  EXPECT_FALSE(history_.checkpoint_sum.health.empty());
  EXPECT_GE(counters_[Counter::kPartFailures], 80U + 1U + 1U);
  EXPECT_THAT(lines_, testing::Contains(testing::StartsWith(
                          "part_failed id=M155 part=failing reason=")));
}

}  // namespace
}  // namespace fdi::monitor
