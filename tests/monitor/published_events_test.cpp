#include "monitor/pair/published_events.h"

#include <memory>

#include <gmock/gmock.h>

#include "tests/monitor/linear_models.h"

namespace fdi::monitor {
namespace {

using std::chrono::hours;
using std::chrono::seconds;
using testing::IsEmpty;
using testing::SizeIs;
using Kind = TransitionKind;

FaultEvent EventOf(const std::string& valve, Kind kind, std::int64_t stamp_ns) {
  FaultEvent event;
  event.valve_id = valve;
  event.episode_id = 7;
  event.transition.kind = kind;
  event.transition.stamp_ns = stamp_ns;
  return event;
}

class PublishedEventsTest : public testing::Test {
 protected:
  bool Add(const FaultEvent& event) { return events_.Add(event, now_); }
  std::vector<FaultEvent> All() const { return events_.Since({}); }

  PublishedEvents events_;
  PublishedEvents::TimePoint now_{hours(1)};
};

TEST_F(PublishedEventsTest, AnEventIsKnownByEpisodeTransitionAndStamp) {
  EXPECT_TRUE(Add(EventOf("V", Kind::kIsolated, 2)));
  EXPECT_TRUE(Add(EventOf("V", Kind::kDetected, 1))) << "it came late";
  EXPECT_FALSE(Add(EventOf("V", Kind::kIsolated, 2)));
  EXPECT_TRUE(Add(EventOf("V", Kind::kClosed, 3)));
  EXPECT_TRUE(Add(EventOf("W", Kind::kDetected, 1)));

  ASSERT_THAT(All(), SizeIs(4));
  for (std::int64_t i = 0; i < 3; ++i) {
    EXPECT_EQ(All()[static_cast<std::size_t>(i)].transition.stamp_ns, i + 1);
  }
  EXPECT_TRUE(events_.Cover(EventOf("V", Kind::kCleared, 3)));
  EXPECT_FALSE(events_.Cover(EventOf("W", Kind::kCleared, 3)));
  EXPECT_THAT(events_.Since(now_ + seconds(1)), IsEmpty());
}

TEST_F(PublishedEventsTest, OfAValveItKeepsTheLastAndNoModelSet) {
  std::weak_ptr<const ModelSet> retired;
  for (int i = 0; i < 20; ++i) {
    FaultEvent event = EventOf("V", Kind::kReisolated, i);
    event.models = SharedLinearModels();
    retired = event.models;
    Add(event);
  }

  ASSERT_THAT(All(), SizeIs(PublishedEvents::kEventsPerValve));
  EXPECT_EQ(All().front().transition.stamp_ns, 4);
  EXPECT_TRUE(retired.expired());
}

TEST_F(PublishedEventsTest, BeyondItsSizeTheValvesSilentForLongestGo) {
  for (std::size_t i = 0; i < PublishedEvents::kMaxValves; ++i) {
    now_ += seconds(1);
    Add(EventOf(std::to_string(i), Kind::kDetected, 1));
  }
  const FaultEvent first = EventOf("0", Kind::kCleared, 2);
  EXPECT_TRUE(Add(first));
  EXPECT_EQ(events_.size(), PublishedEvents::kMaxValves) << "one that it knew";
  now_ += seconds(1);
  Add(first);
  Add(EventOf("new", Kind::kDetected, 1));

  EXPECT_EQ(events_.size(), PublishedEvents::kMaxValves / 2 + 1);
  EXPECT_FALSE(Add(first)) << "known still";
  EXPECT_TRUE(Add(EventOf("1", Kind::kDetected, 1)));
}

TEST_F(PublishedEventsTest, AnHourAfterItsEndAnEpisodeIsForgotten) {
  Add(EventOf("open", Kind::kDetected, 1));
  Add(EventOf("ended", Kind::kDetected, 1));
  Add(EventOf("ended", Kind::kClosed, 2));

  events_.ForgetEnded(now_ + PublishedEvents::kMaxRepeatAge);
  EXPECT_EQ(events_.size(), 2U);
  events_.ForgetEnded(now_ + PublishedEvents::kMaxRepeatAge + seconds(1));
  ASSERT_THAT(All(), SizeIs(1));
  EXPECT_EQ(All().front().valve_id, "open");
}

}  // namespace
}  // namespace fdi::monitor
