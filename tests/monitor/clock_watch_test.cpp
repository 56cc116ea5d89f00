#include "monitor/clock_watch.h"

#include <vector>

#include <gmock/gmock.h>

#include "tests/monitor/linear_models.h"

namespace fdi::monitor {
namespace {

using testing::ElementsAre;

constexpr std::int64_t kHourNs = 3'600'000'000'000;

class ClockWatchTest : public testing::Test {
 protected:
  void Sees(const std::string& valve, std::int64_t off_ns,
            std::uint64_t source = 1) {
    Sample sample = PlantSample(0, 0.0, source);
    sample.stamp_ns += off_ns;
    watch_.OnVerdict(valve, sample, {verdict_, nullptr, false});
  }

  const Verdict verdict_{};
  std::vector<std::string> lines_;
  ClockWatch watch_{
      [] { return PlantSample(0).stamp_ns; },
      [this](LogLevel, std::string_view line) { lines_.emplace_back(line); }};
};

TEST_F(ClockWatchTest, AClockThatIsFarOffIsSaidOnceForEachSource) {
  Sees("good", -kHourNs + 1);
  Sees("good", 50 * kHourNs);  // A replay that runs ahead.
  for (int i = 0; i < 3; ++i) {
    Sees("battery", -PlantSample(0).stamp_ns);
    Sees("ahead", 365 * 24 * kHourNs);
  }
  EXPECT_THAT(lines_, ElementsAre("stamps_far_from_clock valve=battery "
                                  "stamp=1970-01-01T00:00:00Z "
                                  "clock=2023-11-14T22:13:20Z",
                                  "stamps_far_from_clock valve=ahead "
                                  "stamp=2024-11-13T22:13:20Z "
                                  "clock=2023-11-14T22:13:20Z"));
  Sees("ahead", 365 * 24 * kHourNs, 2);
  EXPECT_EQ(lines_.size(), 3U);
}

}  // namespace
}  // namespace fdi::monitor
