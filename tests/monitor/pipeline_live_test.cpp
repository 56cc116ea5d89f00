#include <gmock/gmock.h>

#include "tests/monitor/pipeline_fixture.h"

namespace fdi::monitor {
namespace {

using testing::ElementsAre;

class FakeLive : public LiveSink {
 public:
  void Show(const std::string& valve_id, const Sample& sample,
            const ValveOutcome& outcome) override {
    notice.Apply([&] {
      shown.push_back(
          valve_id + "/" + std::to_string(sample.seq) +
          (outcome.models != nullptr ? "" : "/bare") +
          (outcome.verdict.intake == Intake::kAccepted ? "" : "/bad") +
          (outcome.missing == 0 ? "" : "/missing"));
    });
  }
  void ShowSilence(const std::string& valve_id, Silence silence) override {
    notice.Apply([&] { silences.emplace_back(valve_id, silence); });
  }

  Notice notice;
  std::vector<std::string> shown;
  std::vector<std::pair<std::string, Silence>> silences;
};

class PipelineLiveTest : public PipelineTest {
 protected:
  PipelineLiveTest() { live_ = &board_; }

  FakeLive board_;
};

TEST_F(PipelineLiveTest, ShowsEverySampleInItsOrder) {
  Start();
  Offer("V1", 0, 2);
  Offer("V1", 1, 2);  // Repeated: nothing new to show.
  pipeline_->Offer("V1", BadSample(2), 1);
  Offer("bare", 0, 1);

  ASSERT_TRUE(board_.notice.Await([this] { return board_.shown.size() == 4; }));
  EXPECT_THAT(board_.shown,
              ElementsAre("V1/0", "V1/1", "V1/2/bad", "bare/0/bare"));
}

// The engine accepts the sample and abstains: people must learn why.
TEST_F(PipelineLiveTest, ASignalThatIsMissingIsShownAndLogged) {
  Start();
  Sample sample = PlantSample(0);
  sample.present = MaskOf(Signal::kCv);
  pipeline_->Offer("V1", sample, 1);

  EXPECT_THAT(board_.shown, ElementsAre("V1/0/missing"));
  EXPECT_EQ(bus_.decisions.at(0).quality, Quality::kBadInput);
  EXPECT_EQ(counters_[Intake::kAccepted], 1U);
  EXPECT_THAT(lines_,
              testing::Contains("sample_rejected id=M116 reason=missing_signal "
                                "signal=X valve=V1 seq=0"));
}

TEST_F(PipelineLiveTest, ShowsWhenAValveEndsOrFallsSilent) {
  Start();
  Offer("V1", 0, 2);
  Offer("V2", 0, 2);
  pipeline_->OfferEnd("V1", 2);  // Somebody else's.
  pipeline_->OfferEnd("V1", 1);
  pipeline_->Tend(std::chrono::steady_clock::now() + std::chrono::seconds(4));

  ASSERT_TRUE(
      board_.notice.Await([this] { return board_.silences.size() == 2; }));
  EXPECT_THAT(board_.silences, ElementsAre(std::pair("V1", Silence::kEnded),
                                           std::pair("V2", Silence::kStale)));
}

}  // namespace
}  // namespace fdi::monitor
