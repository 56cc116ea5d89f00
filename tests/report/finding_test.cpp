#include "report/findings/finding.h"

#include <gtest/gtest.h>

#include "report/shared_files.h"

namespace fdi::findings {
namespace {

const report::FaultTexts& Texts() {
  static const report::FaultTexts texts(report::SharedFile("faults.toml"));
  return texts;
}

storage::Episode EpisodeOf(const std::string& valve, const std::string& fault,
                           double strength) {
  storage::Episode episode;
  episode.episode_id = valve;
  episode.valve_id = valve;
  episode.fault = fault;
  episode.fault_bits = 1;
  episode.isolated_ns = 5;
  episode.layer = LayerName(Layer::kObservers);
  episode.strength = strength;
  episode.peak_factor = 1.0;
  episode.detected_ns = 5;
  return episode;
}

Finding Of(const storage::Episode& episode, const RankFacts& facts = {}) {
  return FindingOf(episode, Texts(), facts);
}

TEST(FindingTest, ScoreIsSeverityGradeAndConfidence) {
  storage::Episode episode = EpisodeOf("V", "f19", 0.5);  // high: 4
  EXPECT_DOUBLE_EQ(Of(episode).score(), 4.0);
  episode.peak_factor = 0.5;
  EXPECT_DOUBLE_EQ(Of(episode).score(), 3.0);  // likely
  RankFacts facts;
  facts.labels["f19"].wrong = 1;
  EXPECT_DOUBLE_EQ(Of(episode, facts).score(), 1.5);
  facts.labels["f19"].right = 3;
  EXPECT_DOUBLE_EQ(Of(episode, facts).score(), 3.0 * 4.0 / 5.0);
  episode.label = "f19";
  EXPECT_DOUBLE_EQ(Of(episode, facts).score(), 4.0);
  facts.valves["V"].grade = 1;
  EXPECT_DOUBLE_EQ(Of(episode, facts).score(), 8.0);
  facts.valves["V"].grade = 3;
  EXPECT_DOUBLE_EQ(Of(episode, facts).score(), 2.0);
}

TEST(FindingTest, ALessCertainAnswerWeighsLess) {
  double last = 2.0;
  for (const Certainty certainty : {Certainty::kSure, Certainty::kLikely,
                                    Certainty::kOneOf, Certainty::kNotYet}) {
    EXPECT_LT(CertaintyFactor(certainty), last);
    last = CertaintyFactor(certainty);
  }
  EXPECT_DOUBLE_EQ(CertaintyFactor(Certainty::kNotKnown),
                   CertaintyFactor(Certainty::kOneOf));
  // "One of" is less than sure although the factor is the same.
  EXPECT_LT(Of(EpisodeOf("V", "f3|f6", 0.5)).confidence,
            Of(EpisodeOf("V", "f19", 0.5)).confidence);
}

TEST(FindingTest, StandsUntilItIsSeenToBeGone) {
  storage::Episode episode = EpisodeOf("V", "f19", 0.5);
  EXPECT_TRUE(Of(episode).stands());
  episode.ended_ns = 9;
  episode.unconfirmed_ns = 8;
  EXPECT_TRUE(Of(episode).stands());
  EXPECT_EQ(Of(episode).unconfirmed_ns, 8);
  episode.unconfirmed_ns.reset();
  episode.cleared_ns = 7;
  EXPECT_EQ(Of(episode).ended_ns, 7);
}

TEST(FindingTest, StoredPriorityTellsTheSeverity) {
  storage::Episode episode = EpisodeOf("V", "f19", 0.5);
  episode.priority = 1;
  EXPECT_EQ(Of(episode).words.severity, Severity::kCritical);
}

TEST(FindingTest, WorseStandsThenWeighsMoreThenIsNewer) {
  const Finding low = Of(EpisodeOf("A", "f2", 0.5));
  storage::Episode episode = EpisodeOf("B", "f10", 0.8);
  const Finding grave = Of(episode);
  ASSERT_GT(grave.score(), low.score());
  EXPECT_TRUE(IsWorse(grave, low));
  EXPECT_FALSE(IsWorse(low, grave));
  episode.ended_ns = 9;
  EXPECT_TRUE(IsWorse(low, Of(episode)));
  storage::Episode newer = EpisodeOf("Z", "f2", 0.5);
  newer.detected_ns = 6;
  EXPECT_TRUE(IsWorse(Of(newer), low));
  EXPECT_TRUE(IsWorse(low, Of(EpisodeOf("Z", "f2", 0.5))));
}

}  // namespace
}  // namespace fdi::findings
