#include "gateway/duties.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace fdi::gateway {
namespace {

using ::testing::ElementsAre;

class CalmLogTest : public ::testing::Test {
 protected:
  std::vector<std::string> lines_;
  CalmLog log_{
      [this](LogLevel, std::string_view line) { lines_.emplace_back(line); }};
};

TEST_F(CalmLogTest, OneThingIsSaidOnceAMinute) {
  for (int i = 0; i < 10; ++i) {
    log_.Warn("tag_unknown", "A", {{"tag", "A"}});
    log_.Warn("tag_unknown", "B", {{"tag", "B"}});
    log_.Warn("tag_silent", "A", {{"tag", "A"}});
  }
  EXPECT_THAT(lines_, ElementsAre("tag_unknown tag=A", "tag_unknown tag=B",
                                  "tag_silent tag=A"));
}

TEST_F(CalmLogTest, NamesThatSomebodyMakesUpFillNoDisk) {
  for (int i = 0; i < 50'000; ++i) {
    log_.Warn("tag_unknown", std::to_string(i), {{"tag", std::to_string(i)}});
  }
  EXPECT_EQ(lines_.size(), 10'000U);
  lines_.clear();
  CalmLog other{
      [this](LogLevel, std::string_view line) { lines_.emplace_back(line); }};
  other.Warn("tag_unknown", "", {{"tag", std::string(60'000, 'x')}});
  EXPECT_EQ(lines_.front().size(), 1024U);
}

}  // namespace
}  // namespace fdi::gateway
