#include "monitor/pair/pair_election.h"

#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

namespace fdi::monitor {
namespace {

using std::chrono::milliseconds;

constexpr milliseconds kPatience{300};
constexpr milliseconds kListenTime{1500};
constexpr milliseconds kStep{20};

// Monitors that step every 20 ms and hear each other's words at once.
class PairElectionTest : public testing::Test {
 protected:
  struct Member {
    std::unique_ptr<PairElection> election;
    bool runs{true};
    bool hears_samples{true};
    std::uint64_t received{0};
    int judged{0};
  };

  void Add(int rank, int judged = 10, const std::string& name = {}) {
    PairState self;
    self.pair = "p";
    self.rank = rank;
    self.instance = 100 + members_.size();
    self.monitor = name.empty() ? "m" + std::to_string(members_.size()) : name;
    Member& member = members_.emplace_back();
    member.judged = judged;
    member.election =
        std::make_unique<PairElection>(self, kPatience, kListenTime, now_);
  }

  void Say(std::size_t from) {
    for (std::size_t to = 0; to < members_.size(); ++to) {
      if (members_[to].runs && !cut_.contains({from, to})) {
        members_[to].election->OnState(members_[from].election->self(), now_);
      }
    }
  }

  /// @returns the longest time without a leader.
  milliseconds Pass(milliseconds time) {
    milliseconds longest{0};
    milliseconds silent{0};
    for (milliseconds t{0}; t < time; t += kStep) {
      now_ += kStep;
      for (std::size_t i = 0; i < members_.size(); ++i) {
        Member& member = members_[i];
        if (!member.runs) {
          continue;
        }
        member.received += member.hears_samples ? 10 : 0;
        member.election->Step(member.received, member.judged, now_);
        Say(i);
      }
      silent = Leaders().empty() ? silent + kStep : milliseconds(0);
      longest = std::max(longest, silent);
    }
    return longest;
  }

  std::vector<int> Leaders() const {
    std::vector<int> leaders;
    for (std::size_t i = 0; i < members_.size(); ++i) {
      if (members_[i].runs && members_[i].election->leads()) {
        leaders.push_back(static_cast<int>(i));
      }
    }
    return leaders;
  }

  void Cut(std::size_t from, std::size_t to) { cut_.insert({from, to}); }

  using Who = std::vector<int>;
  PairElection::TimePoint now_{std::chrono::hours(1)};
  std::vector<Member> members_;
  std::set<std::pair<std::size_t, std::size_t>> cut_;
};

TEST_F(PairElectionTest, OfTwoThatStartTogetherTheLowerRankLeads) {
  Add(2);
  Add(1);
  Pass(kListenTime - kStep);
  EXPECT_EQ(Leaders(), Who{});
  Pass(2 * kStep);
  EXPECT_EQ(Leaders(), Who{1});
  EXPECT_EQ(members_[0].election->leader(), "m1");
}

TEST_F(PairElectionTest, WhoIsAloneLeads) {
  Add(2);
  Pass(kListenTime + kStep);
  EXPECT_EQ(Leaders(), Who{0});
  members_[0].election->StepDown(now_);
  EXPECT_TRUE(members_[0].election->leads()) << "nobody could take over";
}

TEST_F(PairElectionTest, ASilentLeaderIsReplacedWithinItsPatience) {
  Add(1);
  Add(2);
  Pass(milliseconds(2000));
  members_[0].runs = false;
  EXPECT_LE(Pass(milliseconds(2000)), kPatience + 2 * kStep);
  EXPECT_EQ(Leaders(), Who{1});
}

TEST_F(PairElectionTest, WhoWasStoppedListensBeforeItLeads) {
  Add(1);
  Add(2);
  Pass(milliseconds(2000));
  members_[0].runs = false;
  Pass(milliseconds(1000));
  cut_ = {{0, 1}, {1, 0}};  // It does not even hear that it was replaced.
  members_[0].runs = true;
  Pass(kStep);
  EXPECT_EQ(Leaders(), Who{1});
  cut_.clear();
  Pass(milliseconds(2000));
  EXPECT_EQ(Leaders(), Who{1}) << "a sound leader keeps the word";
}

TEST_F(PairElectionTest, ALowerRankThatComesBackDoesNotTakeTheWord) {
  Add(2);
  Pass(milliseconds(2000));
  Add(1);
  Pass(milliseconds(5000));
  EXPECT_EQ(Leaders(), Who{0});
}

TEST_F(PairElectionTest, ALeaderThatLeavesIsReplacedAtOnce) {
  Add(1);
  Add(2);
  Pass(milliseconds(2000));
  members_[0].election->StepDown(now_);
  EXPECT_FALSE(members_[0].election->leads());
  Say(0);
  members_[0].runs = false;
  Pass(kStep);
  EXPECT_EQ(Leaders(), Who{1});
}

TEST_F(PairElectionTest, ALeaderThatIsDeafIsReplaced) {
  Add(1);
  Add(2);
  Pass(milliseconds(2000));
  members_[0].hears_samples = false;
  Pass(kPatience + kPatience / 2 + 3 * kStep);
  EXPECT_TRUE(members_[1].election->leads());
}

TEST_F(PairElectionTest, WithoutSamplesNobodyIsDeaf) {
  Add(1);
  Add(2);
  Pass(milliseconds(2000));
  members_[0].hears_samples = members_[1].hears_samples = false;
  Pass(milliseconds(5000));
  EXPECT_EQ(Leaders(), Who{0});
}

// Samples of all valves come once a second, first here or first there.
TEST_F(PairElectionTest, BurstsDoNotMakeALeaderDeaf) {
  for (const int lead : {-2, 0, 2}) {
    members_.clear();
    Add(1);
    Add(2);
    for (int step = 0; step < 500; ++step) {
      members_[0].hears_samples = (step + lead) % 50 == 10;
      members_[1].hears_samples = step % 50 == 10;
      Pass(kStep);
      EXPECT_TRUE(step < 100 || Leaders() == Who{0}) << step;
    }
  }
}

TEST_F(PairElectionTest, AfterASplitBrainTheBetterOneGoesOn) {
  for (const int judged : {10, 9}) {
    members_.clear();
    Add(1, judged);
    Add(2, 10);
    Pass(milliseconds(2000));
    Cut(0, 1);
    Cut(1, 0);
    Pass(milliseconds(60'000));
    EXPECT_EQ(Leaders(), (Who{0, 1}));
    cut_.clear();
    Pass(2 * kStep);
    EXPECT_EQ(Leaders(), Who{judged == 10 ? 0 : 1});
  }
}

TEST_F(PairElectionTest, ACutInOneDirectionHealsToOneLeader) {
  Add(1);
  Add(2);
  Pass(milliseconds(2000));
  Cut(0, 1);
  EXPECT_EQ(Pass(milliseconds(2000)), milliseconds(0));
  cut_.clear();
  Pass(2 * kStep);
  EXPECT_EQ(Leaders().size(), 1U);
}

TEST_F(PairElectionTest, TheSameRankTwiceIsToldAndOneOfThemLeads) {
  Add(1);
  Add(1);
  Pass(milliseconds(2000));
  EXPECT_EQ(Leaders().size(), 1U);
  EXPECT_EQ(members_[0].election->same_rank(), "m1");
  EXPECT_EQ(members_[1].election->same_rank(), "m0");
}

// Containers of one host name, in which every monitor is HOST:1.
TEST_F(PairElectionTest, MonitorsOfOneNameAreTwo) {
  Add(1, 10, "host:1");
  Add(2, 10, "host:1");
  Pass(milliseconds(2000));
  EXPECT_EQ(Leaders(), Who{0});
  EXPECT_EQ(members_[0].election->others(), 1);
  EXPECT_EQ(members_[1].election->others(), 1);
  members_[0].runs = false;
  Pass(milliseconds(1000));
  EXPECT_EQ(Leaders(), Who{1});
}

TEST_F(PairElectionTest, WordsOfAnotherPairDoNotCount) {
  Add(1);
  PairState word;
  word.pair = "q";
  word.instance = 7;
  word.leads = true;
  for (int i = 0; i < 100; ++i) {
    members_[0].election->OnState(word, now_);
    Pass(kStep);
  }
  EXPECT_EQ(Leaders(), Who{0});
  EXPECT_EQ(members_[0].election->others(), 0);
}

TEST_F(PairElectionTest, AThirdOneTakesOverWhenTheSecondDoesNot) {
  Add(1);
  Add(2);
  Add(3);
  Pass(milliseconds(2000));
  members_[0].runs = members_[1].runs = false;
  EXPECT_LE(Pass(milliseconds(2000)), 2 * kPatience + 2 * kStep);
  EXPECT_EQ(Leaders(), Who{2});
}

// Stopped for just so long that another one took over.
TEST_F(PairElectionTest, WhoseLeaseHasRunOutFollowsWhoLeadsByNow) {
  for (const bool lapses : {false, true}) {
    members_.clear();
    Add(1);
    Add(2);
    Pass(kListenTime + 2 * kStep);
    ASSERT_EQ(Leaders(), Who{0});
    Cut(0, 1);
    Cut(1, 0);
    Pass(3 * kPatience);
    ASSERT_EQ(Leaders(), (Who{0, 1}));
    cut_.clear();
    if (lapses) {
      members_[0].election->OnLeaseExpired(now_);
      EXPECT_FALSE(members_[0].election->leads());
    }
    Pass(3 * kPatience);
    EXPECT_EQ(Leaders(), Who{lapses ? 1 : 0});
  }
}

}  // namespace
}  // namespace fdi::monitor
