#include "diagnosis/decision/episode.h"

#include <memory>
#include <optional>

#include <gtest/gtest.h>

#include "tests/diagnosis/linear_plant.h"

namespace fdi {
namespace {

using tests::LinearPlant;
using tests::PlantSample;

// An episode of a valve that reads as in normal operation, with factors set by
// hand: stuck transmitters are certain, so that their faults have the factor 1
// and all others 0.
class EpisodeTest : public ::testing::Test {
 protected:
  void Use(const ModelSet& models) {
    plan_ = std::make_shared<const ObserverPlan>(models);
    bank_.emplace(plan_);
    bank_->Initialise(PlantSample(0));
    episode_.emplace(std::make_shared<const FaultPlan>(plan_));
  }

  Sample Read(std::uint64_t k) const {
    Sample sample = PlantSample(k);
    tests::AddF6(sample, f6_);
    return sample;
  }

  Findings Next() {
    const Sample sample = Read(++k_);
    bank_->Step(sample);
    verdict_.stamp_ns = sample.stamp_ns;
    verdict_.transition_count = 0;
    episode_->Score(*bank_, verdict_);
    Findings findings;
    findings.abnormal = true;
    findings.detected = sample.stamp_ns;
    return findings;
  }

  // @returns the last transition of `samples` samples, if there is one.
  std::optional<Transition> Explained(FaultSet faults, int samples) {
    std::optional<Transition> last;
    for (int i = 0; i < samples; ++i) {
      Findings findings = Next();
      findings.stuck = faults;
      episode_->Step(Read(k_), *bank_, findings, verdict_);
      if (verdict_.transition_count > 0) {
        last = verdict_.Transitions().back();
      }
    }
    return last;
  }

  // Samples of which normal operation has the factor `normal`.
  std::optional<Transition> Found(FaultSet floor, double normal, int samples) {
    std::optional<Transition> last;
    for (int i = 0; i < samples; ++i) {
      Findings findings = Next();
      findings.floor = floor;
      verdict_.normal_factor = normal;
      verdict_.fault_factors.fill(0.0);
      episode_->Step(Read(k_), *bank_, findings, verdict_);
      if (verdict_.transition_count > 0) {
        last = verdict_.Transitions().back();
      }
    }
    return last;
  }

  std::shared_ptr<const ObserverPlan> plan_;
  std::optional<ObserverBank> bank_;
  std::optional<Episode> episode_;
  std::uint64_t k_{0};
  double f6_{0.0};  // strength that acts
  Verdict verdict_;
};

constexpr FaultSet kF1 = 0b001;
constexpr FaultSet kF3 = 0b010;
constexpr FaultSet kF6 = 0b100;

TEST_F(EpisodeTest, AnotherSetHasToHoldWithoutTheValveLookingNormal) {
  ModelSet models = LinearPlant();
  models.decision.isolation_samples = 10;
  models.decision.reisolation_samples = 20;
  Use(models);
  Explained(kF6, 10);
  ASSERT_EQ(verdict_.isolated, kF6);
  Explained(kF3, 9);  // The last of these is the first that supports f3.
  Explained(kF3, 15);
  ASSERT_EQ(verdict_.isolated, kF6);
  Explained(0, 1);
  ASSERT_EQ(verdict_.normal_factor, 1.0);
  EXPECT_FALSE(Explained(kF3, 19));
  EXPECT_EQ(verdict_.isolated, kF6);
  const auto other = Explained(kF3, 1);
  ASSERT_TRUE(other);
  EXPECT_EQ(other->kind, TransitionKind::kReisolated);
  EXPECT_EQ(other->faults, kF3);
}

// A set that allows for interpolation: an episode is long after 80 samples,
// which are a day.
ModelSet SlowPlant() {
  ModelSet models = LinearPlant();
  models.sample_period_s = 1080.0;
  models.decision.reisolation_samples = 20;
  models.decision.evidence_window = 20.0;
  models.decision.interpolation_allowance = 0.04;
  return models;
}

// The evidence tells nothing apart.
ModelSet Blurred(ModelSet models) {
  for (Observer& observer : models.observers) {
    for (ChannelObserver& channel : observer.channels) {
      channel.residual_sd = 1e4;
    }
  }
  return models;
}

TEST_F(EpisodeTest, InALongEpisodeWhatIsAheadForAWhileDoesNotReplaceTheName) {
  const ModelSet models = Blurred(SlowPlant());
  Use(models);
  Explained(kF6, 100);
  ASSERT_EQ(verdict_.isolated, kF6);
  EXPECT_FALSE(Explained(kF3, 30));
  EXPECT_EQ(verdict_.isolated, kF6);
  // For more than half of the second half.
  Explained(kF3, 60);
  EXPECT_EQ(verdict_.isolated, kF3 | kF6);
  EXPECT_FALSE(Explained(kF6, 60));
  EXPECT_FALSE(Explained(kF3, 60));
  EXPECT_EQ(verdict_.isolated, kF3 | kF6);
  // For all but the first third of the episode.
  Explained(kF3, 800);
  EXPECT_EQ(verdict_.isolated, kF3);
}

TEST_F(EpisodeTest, InAShortEpisodeAnotherNameReplacesTheOneThatStands) {
  const ModelSet models = Blurred(SlowPlant());
  Use(models);
  Explained(kF6, 40);
  ASSERT_EQ(verdict_.isolated, kF6);
  Explained(kF3, 30);
  EXPECT_EQ(verdict_.isolated, kF3);
}

TEST_F(EpisodeTest, ASetTooLargeLeavesTheNameOfALongEpisode) {
  ModelSet models = SlowPlant();
  for (const int fault : {10, 11, 13}) {
    models.observers.push_back(tests::F6(1.0));
    models.observers.back().fault = fault;
    models.faults.push_back(fault);
  }
  models.floor.emplace();
  AddFindings(models);
  models = Blurred(models);
  Use(models);
  Explained(kF6, 100);
  ASSERT_EQ(verdict_.isolated, kF6);
  EXPECT_FALSE(Explained(0b111111, 50));
  EXPECT_EQ(verdict_.isolated, kF6);
}

TEST_F(EpisodeTest, WhatTheEvidenceRefutesLeavesTheNameOfALongEpisode) {
  f6_ = 1.0;
  const ModelSet models = SlowPlant();
  Use(models);
  Explained(kF3 | kF6, 60);
  ASSERT_EQ(verdict_.isolated, kF3 | kF6);
  Explained(kF3 | kF6, 60);
  EXPECT_EQ(verdict_.isolated, kF6);
  // Whatever is ahead for a while.
  EXPECT_FALSE(Explained(kF3, 30));
}

TEST_F(EpisodeTest, ANameThatIsGivenUpSaysWhy) {
  ModelSet models = LinearPlant();
  models.observers.resize(1);
  models.faults.clear();
  for (int fault = 1; fault <= 6; ++fault) {
    models.observers.push_back(tests::F6(1.0));
    models.observers.back().fault = fault;
    models.faults.push_back(fault);
  }
  models.floor.emplace();
  AddFindings(models);
  Use(models);
  Explained(kF1, 20);
  ASSERT_EQ(verdict_.isolated, kF1);
  const auto given_up = Explained(0b111111, 50);
  ASSERT_TRUE(given_up);
  EXPECT_EQ(given_up->kind, TransitionKind::kReisolated);
  EXPECT_EQ(given_up->faults, 0U);
  EXPECT_EQ(given_up->unknown, Unknown::kTooEarly);
  EXPECT_EQ(verdict_.unknown, Unknown::kTooEarly);
}

// A finding of the floor names what goes on, not what came before it.
TEST_F(EpisodeTest, AFindingThatIsOverIsNotTheNameOfWhatGoesOn) {
  ModelSet models = LinearPlant();
  models.floor.emplace();
  AddFindings(models);
  Use(models);
  const FaultSet first = FindingsOf(models) & ~(FindingsOf(models) - 1);
  const FaultSet second = first << 1;
  const int last = models.decision.isolation_samples * 3 / 2;
  Found(first | second, 0.0, 40);
  ASSERT_EQ(verdict_.isolated, first | second);
  EXPECT_FALSE(Found(second, 0.0, last - 1));
  const auto dropped = Found(second, 0.0, 1);
  ASSERT_TRUE(dropped);
  EXPECT_EQ(dropped->kind, TransitionKind::kReisolated);
  EXPECT_EQ(dropped->faults, second);
  // A valve that looks healthy by now keeps the name of what it had.
  EXPECT_FALSE(Found(0, 1.0, 2 * last));
  EXPECT_EQ(verdict_.isolated, second);
  // A finding that comes and goes is not over.
  for (int i = 0; i < 4; ++i) {
    EXPECT_FALSE(Found(0, 0.0, last - 1));
    EXPECT_FALSE(Found(second, 0.0, 1));
  }
  EXPECT_TRUE(Found(0, 0.0, last));
  EXPECT_EQ(verdict_.state, State::kDetected);
  EXPECT_EQ(verdict_.isolated, 0U);
  // The second time it is kept for twice as long.
  EXPECT_TRUE(Found(second, 0.0, 1));
  EXPECT_FALSE(Found(0, 0.0, 2 * last - 1));
  EXPECT_TRUE(Found(0, 0.0, 1));
}

// The floor opens the episode, and the valve is not judged any more before the
// observers have settled.
TEST_F(EpisodeTest, NothingExplainsItBeforeEvidenceIsGathered) {
  ModelSet models = LinearPlant();
  models.floor.emplace();
  AddFindings(models);
  Use(models);
  Findings findings = Next();
  findings.settled = false;
  findings.floor = FindingsOf(models) & ~(FindingsOf(models) - 1);
  episode_->Step(Read(k_), *bank_, findings, verdict_);
  ASSERT_EQ(verdict_.state, State::kIsolated);
  Next();
  verdict_.fault_factors[2] = 1.0;
  episode_->Hold(verdict_);
  for (std::size_t i = 0; i < models.faults.size(); ++i) {
    EXPECT_EQ(verdict_.fault_factors[i], 0.0) << i;
  }
}

}  // namespace
}  // namespace fdi
