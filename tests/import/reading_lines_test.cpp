// Lines of readings.
#include "import/reading_lines.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/time_units.h"

namespace fdi::importer {
namespace {

using ::testing::HasSubstr;

constexpr std::int64_t kStampNs = 1'767'607'200 * kNsPerSecond;

TEST(ReadingLines, AnObjectIsAReading) {
  ReadingLines lines;
  const Said& said = lines.Take(
      R"({"tag":"FIC101.OP","t":"2026-01-05T10:00:00.2Z","v":41.2,"q":"good"})");
  ASSERT_EQ(said.kind, Said::Kind::kReading);
  EXPECT_EQ(said.reading.tag, "FIC101.OP");
  EXPECT_EQ(said.reading.stamp_ns, kStampNs + 200'000'000);
  EXPECT_EQ(said.reading.value, 41.2);
  EXPECT_EQ(said.reading.quality, SignalQuality::kGood);
}

TEST(ReadingLines, StampsAreTextsOrSecondsOrMilliseconds) {
  ReadingLines lines;
  for (const char* stamp :
       {"1767607200", "1767607200000", "\"2026-01-05T11:00:00+01:00\"",
        "\"1767607200.0\""}) {
    const Said& said =
        lines.Take(std::string("{\"tag\":\"A\",\"v\":1,\"t\":") + stamp + "}");
    EXPECT_EQ(said.reading.stamp_ns, kStampNs) << stamp;
  }
  EXPECT_EQ(lines.Take(R"({"tag":"A","v":1})").reading.stamp_ns, std::nullopt);
  const Said& wrong = lines.Take(R"({"tag":"A","v":1,"t":"noon"})");
  EXPECT_EQ(wrong.kind, Said::Kind::kWrong);
  EXPECT_EQ(wrong.reading.tag, "A");
  EXPECT_THAT(wrong.why, HasSubstr("noon"));
}

TEST(ReadingLines, WithoutAValueATagIsBad) {
  ReadingLines lines;
  for (const char* line :
       {R"({"tag":"A","q":"bad"})", R"({"tag":"A","v":null})",
        R"({"tag":"A","v":"I/O Timeout"})", R"({"tag":"A","v":1,"q":"Bad"})",
        R"({"tag":"A","v":1,"q":0})", R"({"tag":"A","v":1,"q":"who knows"})"}) {
    const Said& said = lines.Take(line);
    EXPECT_EQ(said.kind, Said::Kind::kReading) << line;
    EXPECT_EQ(said.reading.quality, SignalQuality::kBad) << line;
  }
  EXPECT_EQ(lines.Take(R"({"tag":"A","v":1,"q":192})").reading.quality,
            SignalQuality::kGood);
  EXPECT_EQ(lines.Take(R"({"tag":"A","v":1,"q":"uncertain"})").reading.quality,
            SignalQuality::kUncertain);
}

TEST(ReadingLines, AModeIsAWord) {
  ReadingLines lines;
  const Said& said = lines.Take(R"({"tag":"A.MODE","v":"MAN"})");
  EXPECT_EQ(said.reading.word, "MAN");
  EXPECT_EQ(said.reading.quality, SignalQuality::kGood);
}

TEST(ReadingLines, AliveNamesASource) {
  ReadingLines lines;
  const Said& said =
      lines.Take(R"({"alive":"2026-01-05T10:00:00Z","source":"plc1"})");
  ASSERT_EQ(said.kind, Said::Kind::kAlive);
  EXPECT_EQ(said.reading.source, "plc1");
  EXPECT_EQ(said.reading.stamp_ns, kStampNs);
}

TEST(ReadingLines, CsvHasAHeader) {
  ReadingLines lines;
  EXPECT_EQ(lines.Take("\xEF\xBB\xBFtime,tag,value,quality\r").kind,
            Said::Kind::kNothing);
  const Said& said = lines.Take("2026-01-05T10:00:00Z,A.OP,41.5,Good\r");
  ASSERT_EQ(said.kind, Said::Kind::kReading);
  EXPECT_EQ(said.reading.tag, "A.OP");
  EXPECT_EQ(said.reading.value, 41.5);
  EXPECT_EQ(lines.Take("2026-01-05T10:00:00Z,A.OP,,Bad").reading.quality,
            SignalQuality::kBad);
  EXPECT_EQ(lines.Take("2026-01-05T10:00:00Z,,,").kind, Said::Kind::kAlive);
  EXPECT_EQ(lines.Take("").kind, Said::Kind::kNothing);
}

TEST(ReadingLines, OtherTextIsRefusedAndTheNextLineIsRead) {
  ReadingLines lines;
  EXPECT_EQ(lines.Take("hello, world").kind, Said::Kind::kWrong);
  EXPECT_EQ(lines.Take("tag,value").kind, Said::Kind::kNothing);
  EXPECT_EQ(lines.Take("A,1").kind, Said::Kind::kReading);
  ReadingLines objects;
  EXPECT_EQ(objects.Take("{\"tag\":\"A\",").kind, Said::Kind::kWrong);
  EXPECT_EQ(objects.Take("[1]").kind, Said::Kind::kWrong);
  EXPECT_EQ(objects.Take("{\"v\":1}").kind, Said::Kind::kWrong);
  EXPECT_EQ(objects.Take("{\"tag\":\"A\",\"v\":1}").kind, Said::Kind::kReading);
}

}  // namespace
}  // namespace fdi::importer
