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

  Notice notice;
  std::vector<std::string> shown;
  std::vector<std::pair<std::string, Silence>> silences;
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
