// The episodes of one valve as the two monitors of a pair find them: what the
// leader says is the record of both.
#include <algorithm>
#include <cstdint>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "monitor/valve_monitor.h"
#include "tests/monitor/fake_sinks.h"
#include "tests/monitor/linear_models.h"

namespace fdi::monitor {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using Kind = TransitionKind;

/// One monitor of the valve, and what it has recorded.
struct PairMember : FakeOutlet {
  explicit PairMember(bool standby)
      : valve("V1", EngineParts(SharedLinearModels()), {}) {
    valve.StandBy(standby, *this);
  }
  void OnEvent(FaultEvent event) override { said.push_back(std::move(event)); }
  void OnResumed(const OpenEpisode& episode, std::int64_t /*stamp*/) override {
    resumed.push_back(episode.episode_id);
  }

  void Feed(std::uint64_t k, double offset) {
    valve.Step(PlantSample(k, offset), 1, {}, *this);
  }
  /// Takes what the other one said since the last call.
  void Hear(const PairMember& other) {
    for (; heard < other.said.size(); ++heard) {
      valve.Adopt(other.said[heard], *this);
    }
  }
  std::vector<Kind> Kinds() const {
    std::vector<Kind> kinds;
    for (const FaultEvent& event : said) {
      kinds.push_back(event.transition.kind);
    }
    return kinds;
  }

  ValveMonitor valve;
  std::vector<FaultEvent> said;
  std::vector<std::uint64_t> resumed;
  std::size_t heard{0};
};

FaultEvent Said(Kind kind, std::uint64_t detected, std::uint64_t at) {
  FaultEvent event;
  event.valve_id = "V1";
  event.source_id = 1;
  event.transition.detection_stamp_ns = PlantSample(detected).stamp_ns;
  event.episode_id = EpisodeId("V1", 1, event.transition.detection_stamp_ns);
  event.transition.kind = kind;
  event.transition.stamp_ns = PlantSample(at).stamp_ns;
  event.transition.faults =
      kind == Kind::kIsolated || kind == Kind::kReisolated ? 0b10 : 0;
  event.candidates = {{7, 1.0, 1.0, true}};
  event.model_hash = 0x1234;
  return event;
}

std::vector<FaultEvent> Episode(std::uint64_t detected) {
  return {Said(Kind::kDetected, detected, detected),
          Said(Kind::kIsolated, detected, detected + 5),
          Said(Kind::kCleared, detected, detected + 40),
          Said(Kind::kClosed, detected, detected + 40)};
}

class PairEpisodeTest : public testing::Test {
 protected:
  /// f7 from sample `from` to `to`; the standby starts at sample `start` and
  /// hears each word at once.
  void Run(std::uint64_t start, std::uint64_t from, std::uint64_t to,
           std::uint64_t end) {
    for (; k_ < end; ++k_) {
      const double offset = k_ >= from && k_ < to ? kF7Offset : 0.0;
      leader_.Feed(k_, offset);
      if (k_ >= start) {
        standby_.Feed(k_, offset);
      }
      standby_.Hear(leader_);
    }
  }

  PairMember leader_{false};
  PairMember standby_{true};
  std::uint64_t k_{0};
};

// It settles in the middle of the fault, so that it detects it later.
TEST_F(PairEpisodeTest, AStandbyThatSettlesAsTheValveFailsFindsNoOtherEpisode) {
  for (std::uint64_t start = 80; start <= 110; ++start) {
    PairMember leader(false);
    PairMember standby(true);
    for (std::uint64_t k = 0; k < 200; ++k) {
      const double offset = k >= 100 && k < 150 ? kF7Offset : 0.0;
      leader.Feed(k, offset);
      if (k >= start) {
        standby.Feed(k, offset);
      }
      // The word needs some time.
      if (k % 3 == 0) {
        standby.Hear(leader);
      }
    }
    EXPECT_THAT(leader.Kinds(), ElementsAre(Kind::kDetected, Kind::kIsolated,
                                            Kind::kCleared, Kind::kClosed));
    standby.valve.StandBy(false, standby);
    EXPECT_THAT(standby.Kinds(), IsEmpty()) << start;
  }
}

// Whichever of the two is the earlier by a sample, and however late the word.
TEST_F(PairEpisodeTest, WhatTheStandbyFoundFirstTakesTheIdOfTheLeader) {
  for (std::uint64_t k = 0; k < 120; ++k) {
    standby_.Feed(k, k >= 100 ? kF7Offset : 0.0);
  }
  standby_.valve.Adopt(Said(Kind::kDetected, 102, 102), standby_);
  standby_.valve.Adopt(Said(Kind::kIsolated, 102, 107), standby_);
  EXPECT_THAT(standby_.Kinds(), IsEmpty());
  standby_.valve.StandBy(false, standby_);
  EXPECT_THAT(standby_.Kinds(), IsEmpty());
  for (std::uint64_t k = 120; k < 160; ++k) {
    standby_.Feed(k, 0.0);
  }
  ASSERT_THAT(standby_.Kinds(), ElementsAre(Kind::kCleared, Kind::kClosed));
  for (const FaultEvent& event : standby_.said) {
    EXPECT_EQ(event.episode_id, Said(Kind::kDetected, 102, 102).episode_id);
    EXPECT_EQ(event.transition.detection_stamp_ns, PlantSample(102).stamp_ns);
  }
}

TEST_F(PairEpisodeTest, ATakeOverTellsWhatTheLeaderLeftUnsaid) {
  Run(0, 100, 150, 105);
  ASSERT_THAT(leader_.Kinds(), ElementsAre(Kind::kDetected));
  for (; k_ < 120; ++k_) {
    standby_.Feed(k_, kF7Offset);  // The leader is dead.
  }
  EXPECT_THAT(standby_.Kinds(), IsEmpty());
  standby_.valve.StandBy(false, standby_);
  for (; k_ < 125; ++k_) {
    standby_.Feed(k_, kF7Offset);
  }
  ASSERT_THAT(standby_.Kinds(), ElementsAre(Kind::kIsolated));
  EXPECT_EQ(standby_.said[0].episode_id, leader_.said[0].episode_id);
}

TEST_F(PairEpisodeTest, AnEndThatTheLeaderLeftUnsaidIsToldOnce) {
  Run(0, 100, 150, 150);
  for (; k_ < 180; ++k_) {
    standby_.Feed(k_, 0.0);  // The leader is dead.
  }
  EXPECT_THAT(standby_.Kinds(), IsEmpty());
  standby_.valve.StandBy(false, standby_);
  for (; k_ < 300; ++k_) {
    standby_.Feed(k_, 0.0);
  }
  ASSERT_THAT(standby_.Kinds(), ElementsAre(Kind::kCleared, Kind::kClosed));
  EXPECT_EQ(standby_.said[1].episode_id, leader_.said[0].episode_id);
  EXPECT_EQ(standby_.said[1].transition.reason, EndReason::kCleared);
}

// Its observers say f7; the leader's look said f1.
TEST_F(PairEpisodeTest, ANameThatDiffersFromTheLeadersIsAnnounced) {
  for (std::uint64_t k = 0; k < 120; ++k) {
    standby_.Feed(k, k >= 100 ? kF7Offset : 0.0);
  }
  standby_.valve.Adopt(Said(Kind::kDetected, 100, 100), standby_);
  FaultEvent named = Said(Kind::kIsolated, 100, 106);
  named.transition.faults = 0b01;
  standby_.valve.Adopt(named, standby_);
  standby_.Feed(120, kF7Offset);
  standby_.valve.StandBy(false, standby_);
  for (std::uint64_t k = 121; k < 125; ++k) {
    standby_.Feed(k, kF7Offset);
  }
  ASSERT_THAT(standby_.Kinds(), ElementsAre(Kind::kReisolated));
  EXPECT_EQ(standby_.said[0].transition.faults, 0b10U);
}

TEST_F(PairEpisodeTest, AnEpisodeThatTheLeaderNeverFindsIsRecordedIfItLasts) {
  for (std::uint64_t k = 0; k < 110; ++k) {
    standby_.Feed(k, k >= 100 ? kF7Offset : 0.0);
  }
  EXPECT_THAT(standby_.Kinds(), IsEmpty());
  for (std::uint64_t k = 110; k < 170; ++k) {
    standby_.Feed(k, kF7Offset);
  }
  EXPECT_THAT(standby_.Kinds(), ElementsAre(Kind::kDetected, Kind::kIsolated));
  for (std::uint64_t k = 170; k < 200; ++k) {
    standby_.Feed(k, 0.0);
  }
  EXPECT_EQ(standby_.Kinds().back(), Kind::kClosed);
}

TEST_F(PairEpisodeTest, ABlipThatTheLeaderDoesNotSeeIsNoEpisode) {
  for (std::uint64_t k = 0; k < 250; ++k) {
    standby_.Feed(k, k >= 100 && k < 120 ? kF7Offset : 0.0);
  }
  standby_.valve.StandBy(false, standby_);
  EXPECT_THAT(standby_.Kinds(), IsEmpty());
}

// Each repeat of a transition, in any order, changes nothing.
TEST_F(PairEpisodeTest, RepeatsInAnyOrderDoNotReviveWhatHasEnded) {
  std::vector<FaultEvent> repeats = Episode(100);
  for (const FaultEvent& event : Episode(200)) {
    repeats.push_back(event);
  }
  std::mt19937 generator(1);
  for (int round = 0; round < 50; ++round) {
    PairMember restarted(round % 2 == 0);
    EpisodeTracker tracker("V1", {});
    tracker.StandBy(round % 2 == 0, restarted);
    tracker.Recover(EndedEpisode{"V1", 1, repeats.back().episode_id,
                                 repeats.back().transition.stamp_ns});
    restarted.valve.Recover(std::move(tracker));
    std::ranges::shuffle(repeats, generator);
    for (std::uint64_t k = 250; k < 400; ++k) {
      restarted.Feed(k, k >= 300 && k < 340 ? kF7Offset : 0.0);
      if (k >= 280 && k - 280 < repeats.size()) {
        restarted.valve.Adopt(repeats[k - 280], restarted);
      }
    }
    restarted.valve.StandBy(false, restarted);
    for (std::uint64_t k = 400; k < 500; ++k) {
      restarted.Feed(k, k >= 410 ? kF7Offset : 0.0);
    }
    ASSERT_FALSE(restarted.said.empty());
    for (const FaultEvent& event : restarted.said) {
      EXPECT_GE(event.transition.detection_stamp_ns, PlantSample(300).stamp_ns)
          << TransitionName(event.transition.kind);
    }
    std::ranges::sort(repeats, {}, [](const FaultEvent& event) {
      return std::pair(event.transition.stamp_ns, event.transition.kind);
    });
  }
}

// An own end is remembered as well as one of the last session.
TEST_F(PairEpisodeTest, RepeatsDoNotReviveWhatEndedHere) {
  Run(1000, 100, 150, 200);
  const std::vector<FaultEvent> own = leader_.said;
  ASSERT_EQ(own.size(), 4U);
  for (const FaultEvent& event : own) {
    leader_.valve.Adopt(event, leader_);
  }
  leader_.valve.Adopt(own[0], leader_);
  Run(1000, 220, 240, 400);
  ASSERT_EQ(leader_.said.size(), 8U);
  EXPECT_NE(leader_.said[4].episode_id, own[0].episode_id);
  EXPECT_EQ(leader_.said[4].transition.kind, Kind::kDetected);
}

// Each has opened one, for instance while the link between them was cut.
TEST_F(PairEpisodeTest, OfTwoOpenEpisodesTheLeadersStaysInBothHistories) {
  PairMember other(false);
  for (; k_ < 120; ++k_) {
    leader_.Feed(k_, k_ >= 100 ? kF7Offset : 0.0);
    other.Feed(k_, k_ >= 102 ? kF7Offset : 0.0);
  }
  ASSERT_NE(leader_.said[0].episode_id, other.said[0].episode_id);
  leader_.Hear(other);
  other.Hear(leader_);
  ASSERT_EQ(other.said.size(), 2U);
  other.valve.StandBy(true, other);
  const std::vector<FaultEvent> told = other.said;
  ASSERT_EQ(told.size(), 3U);
  EXPECT_EQ(told.back().episode_id, told.front().episode_id);
  // The leader says the same if it never hears of that.
  for (; k_ < 200; ++k_) {
    leader_.Feed(k_, kF7Offset);
    other.Feed(k_, kF7Offset);
  }
  ASSERT_EQ(leader_.said.size(), 3U);
  for (const FaultEvent& closed : {told.back(), leader_.said.back()}) {
    EXPECT_EQ(closed.transition.kind, Kind::kClosed);
    EXPECT_EQ(closed.transition.reason, EndReason::kSuperseded);
    EXPECT_EQ(closed.episode_id, told.front().episode_id);
    EXPECT_EQ(closed.transition.stamp_ns, PlantSample(102).stamp_ns);
  }
  leader_.Hear(other);
  EXPECT_EQ(leader_.said.size(), 3U);
  // It goes on under the id of the leader.
  other.valve.StandBy(false, other);
  for (; k_ < 240; ++k_) {
    other.Feed(k_, 0.0);
  }
  EXPECT_EQ(other.said.back().episode_id, leader_.said[0].episode_id);
  EXPECT_EQ(other.said.back().transition.reason, EndReason::kCleared);
}

// It was suspended meanwhile, and goes on as the standby.
TEST_F(PairEpisodeTest, ALeaderWhoseEpisodeTheOtherOneEndedDoesNotResumeIt) {
  Run(1000, 100, 1000, 120);
  leader_.valve.Adopt(Said(Kind::kClosed, 100, 140), leader_);
  leader_.valve.StandBy(true, leader_);
  for (k_ = 150; k_ < 250; ++k_) {  // Its engine begins again after the gap.
    leader_.Feed(k_, k_ >= 200 ? kF7Offset : 0.0);
  }
  EXPECT_TRUE(leader_.resumed.empty());
  leader_.valve.StandBy(false, leader_);
  ASSERT_EQ(leader_.said.size(), 4U);
  EXPECT_EQ(leader_.said[2].transition.kind, Kind::kDetected);
  EXPECT_NE(leader_.said[2].episode_id, leader_.said[0].episode_id);
}

// A leader was killed before anybody heard of its episode, which it finds open
// when it starts again.
TEST_F(PairEpisodeTest, AnEpisodeThatNobodyHeardOfGivesWayToTheLeaders) {
  OpenEpisode unheard = OpenEpisodeOf(Said(Kind::kDetected, 98, 98));
  standby_.valve.Recover(unheard);
  Run(100, 100, 300, 120);
  ASSERT_THAT(standby_.Kinds(), ElementsAre(Kind::kClosed));
  EXPECT_EQ(standby_.said[0].episode_id, unheard.episode_id);
  EXPECT_EQ(standby_.said[0].transition.reason, EndReason::kSuperseded);
  EXPECT_EQ(standby_.said[0].transition.stamp_ns, PlantSample(100).stamp_ns);
}

// Both find it open when they start again, the standby some samples earlier.
TEST_F(PairEpisodeTest, TheLeaderEndsWhatBothFoundOpenAndIsGone) {
  const OpenEpisode open = OpenEpisodeOf(Said(Kind::kIsolated, 10, 15));
  leader_.valve.Recover(open);
  standby_.valve.Recover(open);
  for (; k_ < 180; ++k_) {
    standby_.Feed(k_, 0.0);
    if (k_ >= 20) {
      leader_.Feed(k_, 0.0);
    }
    standby_.Hear(leader_);
  }
  ASSERT_THAT(leader_.Kinds(), ElementsAre(Kind::kClosed));
  EXPECT_EQ(leader_.said[0].transition.reason, EndReason::kUnknown);
  EXPECT_THAT(standby_.Kinds(), IsEmpty());

  // It was closed while this one was away: there is no word of it any more.
  PairMember alone(true);
  alone.valve.Recover(open);
  for (std::uint64_t k = 0; k < 180; ++k) {
    alone.Feed(k, 0.0);
  }
  EXPECT_THAT(alone.Kinds(), ElementsAre(Kind::kClosed));
}

// The leader has seen it end, and dies; here it has not ended for a minute.
TEST_F(PairEpisodeTest, AFaultThatOutlastsTheLeadersEndIsDetectedAnew) {
  Run(0, 100, 1000, 120);
  standby_.valve.Adopt(Said(Kind::kClosed, 100, 120), standby_);
  standby_.valve.StandBy(false, standby_);
  for (; k_ < 180; ++k_) {
    standby_.Feed(k_, kF7Offset);
  }
  EXPECT_THAT(standby_.Kinds(), IsEmpty());
  for (; k_ < 220; ++k_) {
    standby_.Feed(k_, kF7Offset);
  }
  ASSERT_THAT(standby_.Kinds(), ElementsAre(Kind::kDetected, Kind::kIsolated));
  EXPECT_NE(standby_.said[0].episode_id, leader_.said[0].episode_id);
}

}  // namespace
}  // namespace fdi::monitor
