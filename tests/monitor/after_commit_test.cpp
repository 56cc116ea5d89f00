#include "monitor/after_commit.h"

#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"

namespace fdi::monitor {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

// Notes its name, and answers as a test wants.
struct Noting : EventSink {
  Noting(std::string its_name, std::vector<std::string>& its_notes)
      : name(std::move(its_name)), notes(its_notes) {}
  bool Publish(const FaultEvent& event, bool persisted) override {
    notes.push_back(name + (event.resent ? " again" : "") +
                    (persisted ? "" : " unstored"));
    if (event.valve_id.empty()) {
      throw DataError("no valve");
    }
    return sent;
  }

  std::string name;
  std::vector<std::string>& notes;
  bool sent{true};
};

class AfterCommitTest : public testing::Test {
 protected:
  AfterCommit::Tell Tell(const std::string& name) {
    return [this, name](const FaultEvent&, bool) { notes_.push_back(name); };
  }

  std::vector<std::string> notes_;
  Counters counters_;
  std::string log_;
  ThrottledLog throttled_{
      [this](LogLevel, std::string_view line) { log_.append(line); }};
  AfterCommit list_{counters_, throttled_};
  Noting bus_{"bus", notes_};
};

TEST_F(AfterCommitTest, StepsAreTakenInTheirOrderByNewAndResentEvents) {
  list_.Add("page", Tell("page"));
  list_.Add(bus_);
  list_.Add("hook", Tell("hook"));
  FaultEvent event;
  event.valve_id = "V1";

  EXPECT_TRUE(list_.Publish(event, false));
  EXPECT_THAT(notes_, ElementsAre("page", "bus unstored", "hook"));
  notes_.clear();
  event.resent = true;
  bus_.sent = false;
  EXPECT_FALSE(list_.Publish(event, true));
  EXPECT_THAT(notes_, ElementsAre("page", "bus again", "hook"));
}

TEST_F(AfterCommitTest, AStepThatFailsIsCountedAndStopsNothing) {
  list_.Add("page", [](const FaultEvent&, bool) {
    throw std::runtime_error("no page");
  });
  list_.Add(bus_);
  FaultEvent event;
  event.valve_id = "V1";

  EXPECT_TRUE(list_.Publish(event, true));

  EXPECT_THAT(notes_, ElementsAre("bus"));
  EXPECT_EQ(counters_[Counter::kPartFailures], 1U);
  EXPECT_THAT(log_,
              HasSubstr("part_failed id=M155 part=page reason=\"no page\""));
}

TEST_F(AfterCommitTest, AnEventThatTheBusCannotTakeIsNotSentAndStopsNothing) {
  list_.Add(bus_);
  list_.Add("hook", Tell("hook"));

  EXPECT_FALSE(list_.Publish({}, true));

  EXPECT_THAT(notes_, ElementsAre("bus", "hook"));
  EXPECT_EQ(counters_[Counter::kPartFailures], 1U);
  EXPECT_THAT(log_, HasSubstr("part=bus reason=\"no valve\""));
}

}  // namespace
}  // namespace fdi::monitor
