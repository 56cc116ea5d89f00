#include "monitor/service/shadow.h"

#include <memory>
#include <string>
#include <vector>

#include <gmock/gmock.h>

#include "monitor/shadow.h"
#include "tests/monitor/linear_models.h"
#include "tests/monitor/pipeline_fixture.h"

namespace fdi::monitor {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

// The candidate does not know f7.
ModelSet CandidateModels() {
  ModelSet models = LinearModels();
  models.version = 2;
  models.content_hash = 0x9999;
  models.observers.pop_back();
  models.faults = {1};
  return models;
}

std::shared_ptr<const ModelSet> Shared(ModelSet models) {
  return std::make_shared<const ModelSet>(std::move(models));
}

class ShadowTest : public testing::Test {
 protected:
  void Use(ModelSet candidate, ShadowLimits limits = {}) {
    ShadowOptions options;
    options.candidate = Shared(std::move(candidate));
    options.limits = limits;
    bank_ = std::make_unique<ShadowBank>(options, log_);
  }
  // Samples [from, to) of the plant go to both.
  void Feed(std::uint64_t from, std::uint64_t to, double offset = 0.0) {
    for (std::uint64_t k = from; k < to; ++k) {
      Give(PlantSample(k, offset));
    }
  }
  void Give(const Sample& sample, bool held = false) {
    active_.HoldIsolation(held);
    const Verdict& verdict = active_.Step(sample);
    bank_->OnVerdict("V0", sample,
                     {verdict, active_models_.get(), false, held});
  }
  std::vector<ShadowDifference> Take() {
    Checkpoint checkpoint;
    bank_->TakeCheckpoint(checkpoint, true);  // Nothing is urgent.
    EXPECT_TRUE(checkpoint.empty());
    bank_->TakeCheckpoint(checkpoint, false);
    return checkpoint.shadow;
  }
  std::uint64_t Samples(ShadowOutcome outcome) const {
    return bank_->counts().samples[static_cast<std::size_t>(outcome)];
  }
  std::int64_t Valves(ShadowFit fit) const {
    return bank_->counts().valves[static_cast<std::size_t>(fit)];
  }

  std::vector<std::string> lines_;
  ThrottledLog log_{
      [this](LogLevel, std::string_view line) { lines_.emplace_back(line); }};
  std::shared_ptr<const ModelSet> active_models_ = SharedLinearModels();
  ValveEngine active_{active_models_};
  std::unique_ptr<ShadowBank> bank_;
};

TEST_F(ShadowTest, StretchBeginsWhereTheAnswersPartAndSaysBoth) {
  Use(CandidateModels());
  Feed(0, 50);
  EXPECT_THAT(Take(), IsEmpty());

  Feed(50, 90, kF7Offset);

  const auto stretches = Take();
  ASSERT_THAT(stretches, SizeIs(1));
  const ShadowDifference& d = stretches[0];
  EXPECT_EQ(d.valve_id, "V0");
  EXPECT_EQ(d.active_set, "linear@1");
  EXPECT_EQ(d.candidate_set, "linear@2");
  EXPECT_EQ(d.active, (ShadowAnswer{State::kIsolated, "f7"}));
  EXPECT_EQ(d.candidate, (ShadowAnswer{State::kDetected, ""}));
  EXPECT_EQ(d.to_ns, PlantSample(89).stamp_ns);
  EXPECT_EQ(d.samples, (d.to_ns - d.from_ns) / 1'000'000'000 + 1);
  EXPECT_EQ(Samples(ShadowOutcome::kDiffered),
            static_cast<std::uint64_t>(d.samples));
  EXPECT_GT(Samples(ShadowOutcome::kAgreed), 30U);
  EXPECT_GT(Samples(ShadowOutcome::kNotJudged), 10U);  // While settling.
}

TEST_F(ShadowTest, OpenStretchGrowsUnderItsKeyAndIsGivenOnceMore) {
  Use(CandidateModels());
  Feed(0, 50);
  Feed(50, 80, kF7Offset);
  const auto first = Take();
  EXPECT_THAT(Take(), IsEmpty());
  Feed(80, 90, kF7Offset);
  Feed(90, 140);
  const auto second = Take();

  ASSERT_THAT(first, SizeIs(1));
  ASSERT_THAT(second, SizeIs(1));
  EXPECT_EQ(second[0].from_ns, first[0].from_ns);
  EXPECT_GT(second[0].samples, first[0].samples);
  EXPECT_THAT(Take(), IsEmpty());
  EXPECT_EQ(bank_->counts().recorded, 1U);
  Checkpoint older;
  Checkpoint newer;
  older.shadow = first;
  newer.shadow = second;
  const Checkpoint merged = Merged(older, newer);
  ASSERT_THAT(merged.shadow, SizeIs(1));
  EXPECT_EQ(merged.shadow[0].samples, second[0].samples);
}

TEST_F(ShadowTest, SameFaultsUnderOtherNumbersInTheSetAgree) {
  ModelSet candidate = LinearModels();
  candidate.content_hash = 0x9999;
  candidate.observers.erase(candidate.observers.begin() + 1);
  candidate.faults = {7};
  Use(candidate);
  Feed(0, 50);
  Feed(50, 90, kF7Offset);
  EXPECT_THAT(Take(), IsEmpty());
  EXPECT_EQ(Samples(ShadowOutcome::kDiffered), 0U);
}

TEST_F(ShadowTest, ShortStretchesAreCountedNotRecorded) {
  Use(CandidateModels(), {.min_samples = 1000});
  Feed(0, 50);
  Feed(50, 90, kF7Offset);
  EXPECT_THAT(Take(), IsEmpty());
  EXPECT_GT(Samples(ShadowOutcome::kDiffered), 0U);
  EXPECT_EQ(bank_->counts().recorded, 0U);
}

TEST_F(ShadowTest, StretchesOfAnHourAreBounded) {
  Use(CandidateModels(), {.max_per_hour = 1});
  for (std::uint64_t k = 0; k < 400; k += 100) {
    Feed(k, k + 50);
    Feed(k + 50, k + 100, kF7Offset);
  }
  EXPECT_THAT(Take(), SizeIs(1));
  EXPECT_EQ(bank_->counts().recorded, 1U);
  EXPECT_GE(bank_->counts().left_out, 2U);
}

TEST_F(ShadowTest, EndOfTheStreamEndsStretchAndEpisode) {
  ModelSet candidate = CandidateModels();
  candidate.decision.clearing_samples = 100;
  Use(candidate);
  Feed(0, 50);
  Feed(50, 90, kF7Offset);
  active_.EndEpisode(EndReason::kStreamEnded);
  bank_->OnSilence("V0", Silence::kEnded);
  const std::uint64_t differed = Samples(ShadowOutcome::kDiffered);
  EXPECT_THAT(Take(), SizeIs(1));

  Feed(90, 150);

  EXPECT_EQ(Samples(ShadowOutcome::kDiffered), differed);
  EXPECT_THAT(Take(), IsEmpty());
}

TEST_F(ShadowTest, HeldIsolationIsHeldOfBoth) {
  ModelSet same = LinearModels();
  same.content_hash = 0x9999;
  Use(same);
  for (std::uint64_t k = 0; k < 90; ++k) {
    Give(PlantSample(k, k < 50 ? 0.0 : kF7Offset), true);
  }
  EXPECT_EQ(active_.verdict().state, State::kDetected);
  EXPECT_EQ(Samples(ShadowOutcome::kDiffered), 0U);
}

TEST_F(ShadowTest, ValveThatTheCandidateDoesNotFitIsReportedWithItsReason) {
  ModelSet candidate = CandidateModels();
  for (Observer& observer : candidate.observers) {
    observer.channels[0].model.regressors[0].signal = Signal::kPz;
  }
  Use(candidate);
  Feed(0, 30);
  EXPECT_EQ(Valves(ShadowFit::kSignals), 1);
  EXPECT_EQ(Valves(ShadowFit::kNoActive), 0);
  ASSERT_THAT(lines_, SizeIs(1));
  EXPECT_THAT(lines_[0], HasSubstr("valve=V0 reason=signals"));
  EXPECT_EQ(Samples(ShadowOutcome::kNotJudged), 0U);
}

TEST_F(ShadowTest, ActiveSetIsNotComparedWithItself) {
  Use(LinearModels());
  Feed(0, 30);
  EXPECT_EQ(Valves(ShadowFit::kSameSet), 1);
}

TEST_F(ShadowTest, ValveThatIsRemovedIsNotCounted) {
  Use(CandidateModels());
  Feed(0, 30);
  ASSERT_EQ(Valves(ShadowFit::kCompared), 1);

  Checkpoint last;
  bank_->OnRemoved("V0", last);
  EXPECT_THAT(last.shadow_accumulators, SizeIs(1));
  EXPECT_EQ(Valves(ShadowFit::kCompared), 0);
}

TEST_F(ShadowTest, AccumulatorsOfAnotherCandidateCountForNothing) {
  Use(CandidateModels());
  Feed(0, 100);
  Checkpoint checkpoint;
  bank_->TakeCheckpoint(checkpoint, false);
  ASSERT_THAT(checkpoint.shadow_accumulators, SizeIs(1));
  EXPECT_EQ(checkpoint.shadow_accumulators[0].model_hash, 0x9999U);

  ModelSet other = CandidateModels();
  other.content_hash = 0x7777;
  Use(other);
  bank_->Restore(checkpoint.shadow_accumulators);
  Feed(100, 130);
  EXPECT_EQ(Valves(ShadowFit::kCompared), 1);
}

class ShadowPipelineTest : public PipelineTest {};

TEST_F(ShadowPipelineTest, CandidateIsKeptAndNeverHeardOfOutside) {
  ShadowBank bank({Shared(CandidateModels()), "*", {}}, log_);
  listeners_ = {&bank};
  Start();
  OfferEpisode("V1");
  ASSERT_TRUE(AwaitEvents(2));  // DETECTED, ISOLATED.
  pipeline_->Stop();

  EXPECT_THAT(bus_.events, SizeIs(2));
  for (const FakeBus::Decision& decision : bus_.decisions) {
    EXPECT_EQ(decision.model_hash, 0x1234U);
  }
  ASSERT_THAT(history_.checkpoint_sum.shadow, SizeIs(1));
  EXPECT_EQ(history_.checkpoint_sum.shadow[0].valve_id, "V1");
  EXPECT_EQ(history_.checkpoint_sum.shadow[0].active.fault, "f7");
  EXPECT_THAT(history_.checkpoint_sum.shadow_accumulators, SizeIs(1));
  EXPECT_EQ(bank.counts().recorded, 1U);
}

TEST(ShadowMetricsTest, CountsAreFamiliesOfThePage) {
  ShadowCounts counts;
  counts.samples[1] = 7;
  counts.recorded = 2;
  counts.valves[static_cast<std::size_t>(ShadowFit::kSignals)] = 3;

  const std::string page = ShadowMetrics(counts);

  EXPECT_THAT(
      page,
      AllOf(HasSubstr("fdi_shadow_samples_total{outcome=\"differed\"} 7\n"),
            HasSubstr("fdi_shadow_differences_total{outcome=\"recorded\"} 2\n"),
            HasSubstr("fdi_shadow_valves{fit=\"signals\"} 3\n")));
}

}  // namespace
}  // namespace fdi::monitor
