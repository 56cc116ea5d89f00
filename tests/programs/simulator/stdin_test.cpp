#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/programs/simulator/publish_fixture.h"

// CSV and JSON lines from a pipe.
namespace fdi::simulator {
namespace {

using testing::HasSubstr;

using AppStdinTest = PublishTest;

TEST_F(AppStdinTest, EachJsonLineIsPublishedAtOnce) {
  Reader reader(domain_);
  Process process(
      With({"replay", "--file", "-", "--valve", "J", "--wait-reader", "20"}));

  process.Send(
      "{\"t_s\": 0, \"CV_pct\": 70.1, \"X_pct\": 0.1, \"F_t_h\": 12}\n");
  ASSERT_TRUE(
      reader.TakeUntil([&] { return reader.Samples("J").size() == 1; }));
  process.Send(
      "\n{\"t_s\": 1, \"CV_pct\": 71, \"X_pct\": null, \"F_t_h\": 13, "
      "\"mode\": \"MANUAL\"}\n");
  ASSERT_TRUE(
      reader.TakeUntil([&] { return reader.Samples("J").size() == 2; }));
  process.CloseInput();
  ASSERT_TRUE(reader.TakeUntilEnded());

  EXPECT_EQ(process.Wait().code, 0);
  const auto& got = reader.Samples("J");
  EXPECT_EQ(got[0][Signal::kCv], 70.1);
  EXPECT_TRUE(got[0].Has(Signal::kX));
  EXPECT_FALSE(got[0].Has(Signal::kP1));
  EXPECT_FALSE(got[1].Has(Signal::kX));
  EXPECT_EQ(got[0].mode, ValveMode::kAuto);
  EXPECT_EQ(got[1].mode, ValveMode::kManual);
  EXPECT_EQ(got[1].flow_unit, FlowUnit::kTPerHour);
  EXPECT_EQ(got[1].stamp_ns - got[0].stamp_ns, 1'000'000'000);
}

TEST_F(AppStdinTest, APvOfJsonLinesIsPublishedWithItsSetPoint) {
  Reader reader(domain_);
  Process process(With({"replay", "--file", "-", "--valve", "J"}));
  process.Send(
      "{\"CV_pct\": 70, \"F_t_h\": 12, \"sp\": 40}\n"
      "{\"CV_pct\": 71, \"pv\": 3.1, \"sp\": 3.25}\n"
      "{\"CV_pct\": 72, \"pv\": null, \"F_t_h\": 12, \"sp\": 3.25}\n");
  process.CloseInput();
  ASSERT_TRUE(reader.TakeUntil([&] { return !reader.ended().empty(); }));

  EXPECT_EQ(process.Wait().code, 0);
  const auto& got = reader.Samples("J");
  ASSERT_EQ(got.size(), 3U);
  // "sp" without "pv" is no key of ours.
  EXPECT_EQ(got[0].present, MaskOf(Signal::kCv) | MaskOf(Signal::kF));
  EXPECT_EQ(got[1].present,
            MaskOf(Signal::kCv) | MaskOf(Signal::kPv) | MaskOf(Signal::kSp));
  EXPECT_EQ(got[1][Signal::kPv], 3.1);
  EXPECT_EQ(got[1][Signal::kSp], 3.25);
  EXPECT_EQ(got[2].present, MaskOf(Signal::kCv) | MaskOf(Signal::kF));
  EXPECT_EQ(got[2].seq, 2U);
}

TEST_F(AppStdinTest, JsonLinesWithoutTimeAreStampedOnTheGridOfThePeriod) {
  Reader reader(domain_);
  Process process(With({"replay", "--file", "-", "--valve", "J", "--period",
                        "0.25", "--start", "2026-03-01T00:00:00Z"}));

  process.Send(
      "{\"CV_pct\": 1, \"X_pct\": 1}\n{\"CV_pct\": 2, \"X_pct\": 2}\n");
  process.CloseInput();
  ASSERT_TRUE(reader.TakeUntilEnded());

  EXPECT_EQ(process.Wait().code, 0);
  const auto& got = reader.Samples("J");
  ASSERT_EQ(got.size(), 2U);
  EXPECT_EQ(got[0].stamp_ns, 1'772'323'200'000'000'000);
  EXPECT_EQ((got[1].stamp_ns - got[0].stamp_ns) % 250'000'000, 0);
  EXPECT_GT(got[1].stamp_ns, got[0].stamp_ns);
}

TEST_F(AppStdinTest, AFilePipedThroughStdinLosesNothing) {
  Reader reader(domain_);
  Process process(With({"replay", "--file", "-", "--valve", "P"}));
  std::string lines = "t_s,CV_pct,X_pct,colour\n";
  for (int i = 0; i < 3000; ++i) {
    lines += std::to_string(i) + ",50,50,red\n";
  }

  process.Send(lines);
  process.CloseInput();
  ASSERT_TRUE(reader.TakeUntilEnded(1, 10));

  const Ended ended = process.Wait();
  EXPECT_EQ(ended.code, 0);
  EXPECT_THAT(ended.err, HasSubstr("not used: colour"));
  EXPECT_EQ(reader.Samples("P").size(), 3000U);
  EXPECT_EQ(reader.status().lost, 0U);
}

TEST_F(AppStdinTest, AGapMayBeTheFirstStepIfThePeriodIsGiven) {
  Reader reader(domain_);
  Process process(With({"replay", "--file", "-", "--valve", "G", "--period",
                        "1", "--split-gaps"}));

  process.Send("t_s,CV_pct,X_pct\n0,50,50\n9,51,51\n10,52,52\n11,53,53\n");
  process.CloseInput();
  ASSERT_TRUE(reader.TakeUntilEnded());

  EXPECT_EQ(process.Wait().code, 0);
  EXPECT_EQ(reader.Samples("G").size(), 4U);
}

TEST_F(AppStdinTest, AByteOrderMarkMayPrecedeJson) {
  Process process(With({"replay", "--file", "-", "--valve", "J",
                        "--wait-reader", "0", "--json"}));

  process.Send("\xEF\xBB\xBF{\"CV_pct\": 1, \"X_pct\": 1}\n");
  process.CloseInput();

  const Ended ended = process.Wait();
  EXPECT_EQ(ended.code, 0) << ended.err;
  EXPECT_THAT(ended.out, HasSubstr("\"samples\": 1"));
}

TEST_F(AppStdinTest, WithoutSamplesThereIsNoStart) {
  Process process(With({"replay", "--file", "-", "--valve", "E",
                        "--wait-reader", "0", "--json"}));

  process.CloseInput();

  EXPECT_THAT(process.Wait().out, HasSubstr("\"start_utc\": null"));
}

TEST_F(AppStdinTest, ABadLineOnStdinEndsTheStreamBehindTheGoodOnes) {
  Reader reader(domain_);
  Process process(
      With({"replay", "--file", "-", "--valve", "B", "--speed", "max"}));

  process.Send("t_s,CV_pct,X_pct\n0,50,50\n1,51,51\n2,x,52\n3,53,53\n");
  ASSERT_TRUE(reader.TakeUntilEnded());
  const Ended ended = process.Wait();

  EXPECT_EQ(ended.code, 3);
  EXPECT_THAT(ended.err, HasSubstr("stdin:4"));
  EXPECT_EQ(reader.Samples("B").size(), 2U);
}

TEST_F(AppStdinTest, JsonLinesAreRefusedWithLineAndKey) {
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"{\"t_s\":0,\"X_pct\":1}", "CV_pct"},
      {"{\"t_s\":0,\"CV_pct\":1}", "X_pct"},
      {"{\"t_s\":0,\"CV_pct\":\"a\",\"X_pct\":1}", "not a finite number"},
      {"{\"t_s\":0,\"CV_pct\":1,\"X_pct\":1e999}", "stdin:1"},
      {"{\"t_s\":0,\"CV_pct\":1,\"X_pct\":1,\"mode\":\"HAND\"}",
       "none of AUTO, MANUAL"},
      {"{\"t_s\":0,", "not a JSON object"},
      {"{\"CV_pct\":1,\"F_t_h\":1,\"F_m3_h\":1}", "F_"},
      {"{\"t_s\":0,\"CV_pct\":1,\"X_pct\":1}\n{\"CV_pct\":1,\"X_pct\":1}",
       "stdin:2: t_s"},
      {"{\"t_s\":0,\"CV_pct\":1,\"X_pct\":1}\n"
       "{\"t_s\":1,\"CV_pct\":1,\"X_pct\":1}\n"
       "{\"t_s\":9,\"CV_pct\":1,\"X_pct\":1}",
       "stdin:3: time jumps"}};
  Reader reader(domain_);
  for (const auto& [lines, word] : cases) {
    Process process(With({"replay", "--file", "-", "--valve", "B"}));
    process.Send(lines + "\n");
    process.CloseInput();

    const Ended ended = process.Wait();

    EXPECT_EQ(ended.code, 3) << lines;
    EXPECT_THAT(ended.err, HasSubstr(word)) << lines;
  }
}

}  // namespace
}  // namespace fdi::simulator
