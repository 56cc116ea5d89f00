#include "monitor/bus/share_watch.h"

#include <algorithm>
#include <array>
#include <string>

#include <gtest/gtest.h>
#include <sched.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/error.h"
#include "diagnosis/records/partitions.h"
#include "monitor/service/status.h"

namespace fdi::monitor {
namespace {

const MonitorShare kOwn{"host:1", "V*", ""};

std::size_t Contested(const MonitorShare& own, const MonitorShare& other) {
  return FindContested(own, {other}, {"V1", "V2", "W1"}).count;
}

TEST(FindContestedTest, AnotherMonitorContestsWhatItsGlobMatches) {
  const ContestedValves found =
      FindContested(kOwn, {{"host:2", "*1", ""}}, {"V2", "V1"});
  EXPECT_EQ(found.count, 1U);
  EXPECT_EQ(found.example, "V1");
  EXPECT_EQ(found.monitor, "host:2");
  EXPECT_EQ(Contested(kOwn, {"host:2", "X*", ""}), 0U);
}

TEST(FindContestedTest, TheMonitorItselfDoesNot) {
  EXPECT_EQ(Contested(kOwn, kOwn), 0U);
  EXPECT_EQ(Contested(kOwn, {"host:2", "V*", ""}), 2U);
}

TEST(FindContestedTest, OnlyWherePartitionsOverlap) {
  const auto contested = [](const char* a, const char* b) {
    return Contested({"host:1", "V*", a}, {"host:2", "V*", b}) > 0;
  };
  EXPECT_TRUE(contested("hall-1", "hall-1"));
  EXPECT_TRUE(contested("hall-*", "yard,hall-1"));
  EXPECT_TRUE(contested("hall-1", "hall-?"));
  EXPECT_FALSE(contested("hall-1", "hall-2"));
  EXPECT_FALSE(contested("", "hall-1"));
}

// NewMonitorName() in a pid namespace of its own, where it is process 1; empty
// where namespaces are not permitted.
std::string NameInAContainer() {
  std::array<int, 2> ends{};
  if (pipe(ends.data()) != 0) {
    return {};
  }
  const pid_t child = fork();
  if (child == 0) {
    if (unshare(CLONE_NEWPID) != 0 &&
        unshare(CLONE_NEWUSER | CLONE_NEWPID) != 0) {
      _exit(0);
    }
    const pid_t first = fork();
    if (first == 0) {
      const std::string name = NewMonitorName();
      _exit(write(ends[1], name.data(), name.size()) < 0 ? 1 : 0);
    }
    waitpid(first, nullptr, 0);
    _exit(0);
  }
  close(ends[1]);
  std::array<char, 128> name{};
  const ssize_t length = read(ends[0], name.data(), name.size());
  close(ends[0]);
  waitpid(child, nullptr, 0);
  return {name.data(), static_cast<std::size_t>(std::max<ssize_t>(length, 0))};
}

TEST(MonitorNameTest, InContainersOfOneHostNameItIsUnique) {
  const std::string first = NameInAContainer();
  if (first.empty()) {
    GTEST_SKIP() << "no pid namespaces here";
  }
  const std::string second = NameInAContainer();

  EXPECT_NE(first.find(":1-"), std::string::npos) << first;
  EXPECT_NE(first, second);
  EXPECT_EQ(Contested({first, "V*", ""}, {second, "V*", ""}), 2U);
}

StatusFacts NoFacts(const Counters& counters) {
  return {.counters = counters,
          .census = {},
          .samples = {},
          .datagrams = {},
          .refused_participants = 0,
          .refused_permissions = 0,
          .decisions = {},
          .journal = {}};
}

// A service that runs and judges nothing is not OK.
TEST(StatusTest, ATenthOfTheValvesMayBeUnjudged) {
  const Counters counters;
  StatusFacts facts = NoFacts(counters);
  facts.census.valves = 20;
  facts.census.unjudged = 2;
  facts.census.unjudged_valve = "V3";
  facts.census.unjudged_ns = 60'000'000'000;
  facts.census.unjudged_reason = "UNCOVERED cv";
  EXPECT_EQ(StatusOf(facts).health, idl::Health::kOk);
  facts.census.unjudged = 3;
  EXPECT_EQ(StatusOf(facts).health, idl::Health::kDegraded);
  EXPECT_EQ(StatusOf(facts).text,
            "not judged: 3 of 20 valves, for longest V3 since "
            "1970-01-01T00:01:00Z (UNCOVERED cv)");
}

// Whatever others call themselves, the status goes out.
TEST(ContestedStatusTest, LongAndStrangeNamesFitTheWire) {
  const Counters counters;
  StatusFacts facts = NoFacts(counters);
  EXPECT_EQ(StatusOf(facts).health, idl::Health::kOk);
  facts.contested = {2, "V1", "host:2"};
  EXPECT_EQ(StatusOf(facts).health, idl::Health::kDegraded);
  EXPECT_EQ(StatusOf(facts).text, "host:2 takes 2 of these valves, too: V1");
  facts.census.contested = 3;
  facts.census.contested_valve = "V7";
  EXPECT_EQ(StatusOf(facts).text,
            "host:2 takes 2 of these valves, too: V1; two publishers send V7 "
            "and 2 more valves");
  facts.contested = {100'000, std::string(64, 'V'), std::string(64, '\n')};
  EXPECT_EQ(StatusOf(facts).text.size(), idl::kMaxTextLength);
  EXPECT_EQ(StatusOf(facts).text.find('\n'), std::string::npos);
}

TEST(ParsePartitionsTest, NamesAreCheckedAndPatternsOnlyWhereTheyMakeSense) {
  EXPECT_TRUE(ParsePartitions("", false).empty());
  EXPECT_EQ(ParsePartitions("hall-1,a/b.c_2", false),
            (std::vector<std::string>{"hall-1", "a/b.c_2"}));
  EXPECT_EQ(ParsePartitions("hall-[!2]*", true).size(), 1U);
  for (const char* text :
       {"hall-*", "a,,b", ",", "a b", "<x>", "1,2,3,4,5,6,7,8,9",
        "0123456789012345678901234567890"}) {
    EXPECT_THROW(ParsePartitions(text, false), ConfigError) << text;
  }
}

}  // namespace
}  // namespace fdi::monitor
