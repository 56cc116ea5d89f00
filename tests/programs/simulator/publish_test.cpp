#include <array>
#include <bit>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <cstdlib>
#include <fstream>
#include <set>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "import/csv.h"
#include "import/sniff.h"
#include "import/tag_map.h"
#include "tests/programs/simulator/publish_fixture.h"

namespace fdi::simulator {
namespace {

using testing::HasSubstr;

using AppPublishTest = PublishTest;

TEST_F(AppPublishTest, AReplayedCsvArrivesInOrderBitForBit) {
  const std::string file = MakeCsv("300");
  const importer::CsvTable table = importer::ReadCsvFile(file);
  Reader reader(domain_);

  Process process(With({"replay", "--file", file, "--valve", "LC1", "--speed",
                        "max", "--start", "2026-03-01T00:00:00Z"}));
  ASSERT_TRUE(reader.TakeUntilEnded());
  const Ended ended = process.Wait();

  ASSERT_EQ(ended.code, 0) << ended.err;
  const auto& got = reader.Samples("LC1");
  const auto& sent = table.runs[0].samples;
  ASSERT_EQ(got.size(), sent.size());
  for (std::size_t i = 0; i < sent.size(); ++i) {
    EXPECT_EQ(got[i].seq, i);
    EXPECT_EQ(got[i].stamp_ns - 1'772'323'200'000'000'000,
              static_cast<std::int64_t>(i) * 1'000'000'000);
    EXPECT_EQ(got[i].source_id, got[0].source_id);
    EXPECT_EQ(got[i].present, kBasicSignals);
    EXPECT_EQ(got[i].flow_unit, FlowUnit::kTPerHour);
    for (std::size_t s = 0; s < kSignalCount; ++s) {
      EXPECT_EQ(std::bit_cast<std::uint64_t>(got[i].values[s]),
                std::bit_cast<std::uint64_t>(sent[i].sample.values[s]));
    }
  }
  const auto summary = nlohmann::json::parse(ended.out);
  EXPECT_EQ(summary["published"], 300);
  EXPECT_EQ(summary["acknowledged"], true);
}

TEST_F(AppPublishTest, StampsThatEndNowAreNeverAheadOfTheClock) {
  const std::string file = MakeCsv("300");
  for (const std::vector<std::string>& what :
       std::vector<std::vector<std::string>>{{"run", "--duration", "300"},
                                             {"replay", "--file", file}}) {
    Reader reader(domain_);
    std::vector<std::string> words = what;
    words.insert(words.end(), {"--valve", "E", "--speed", "300"});
    const std::int64_t began_ns = NowNs();
    Process process(With(words));
    ASSERT_TRUE(reader.TakeUntilEnded());
    ASSERT_EQ(process.Wait().code, 0);
    const std::int64_t last_ns = reader.Samples("E").back().stamp_ns;
    EXPECT_LE(last_ns, NowNs());
    EXPECT_GE(last_ns, began_ns - 1'000'000'000);
  }
}

TEST_F(AppPublishTest, AtMaxSpeedASlowReaderLosesNothing) {
  Reader reader(domain_);
  Process process(With(
      {"replay", "--file", MakeLongCsv(), "--valve", "S", "--speed", "max"}));

  ASSERT_TRUE(reader.AwaitFull());
  ASSERT_TRUE(reader.TakeUntilEnded(1, 1000));
  const Ended ended = process.Wait();

  ASSERT_EQ(ended.code, 0) << ended.err;
  const auto& got = reader.Samples("S");
  ASSERT_EQ(got.size(), kManySamples);
  for (std::size_t i = 0; i < got.size(); ++i) {
    ASSERT_EQ(got[i].seq, i);
  }
  EXPECT_EQ(reader.status().lost, 0U);
  EXPECT_EQ(nlohmann::json::parse(ended.out)["published"], kManySamples);
}

TEST_F(AppPublishTest, ManyValvesArriveWholeEachFromItsOwnSource) {
  Reader reader(domain_);

  Process process(
      With({"run", "--count", "20", "--duration", "200", "--speed", "max"}));
  ASSERT_TRUE(reader.TakeUntilEnded(20));
  const Ended ended = process.Wait();

  ASSERT_EQ(ended.code, 0) << ended.err;
  std::set<std::uint64_t> sources;
  for (int v = 1; v <= 20; ++v) {
    char name[16];
    std::snprintf(name, sizeof name, "VALVE-%04d", v);
    const auto& got = reader.Samples(name);
    ASSERT_EQ(got.size(), 200U) << name;
    for (std::size_t i = 0; i < got.size(); ++i) {
      ASSERT_EQ(got[i].seq, i) << name;
    }
    sources.insert(got[0].source_id);
  }
  EXPECT_EQ(sources.size(), 20U);
}

TEST_F(AppPublishTest, AStoredRunIsReplayedFromNowOrWithItsStamps) {
  const Ended recorded =
      RunProgram({"run", "--no-publish", "--record", "--json", "--data",
                  folder_.path().string(), "--duration", "100", "--valve",
                  "LC7", "--start", "2026-01-01T00:00:00Z"});
  ASSERT_EQ(recorded.code, 0) << recorded.err;
  const std::string id =
      nlohmann::json::parse(recorded.out)["sources"][0]["run_id"];
  constexpr std::int64_t kStart = 1'767'225'600'000'000'000;
  Reader reader(domain_);

  Process kept(With(
      {"replay", "--run", id + "@20:30", "--speed", "max", "--keep-stamps"}));
  ASSERT_TRUE(reader.TakeUntilEnded(1));
  EXPECT_EQ(kept.Wait().code, 0);
  Process now(With({"replay", "--run", id + "@20:30", "--speed", "max",
                    "--valve", "OTHER"}));
  ASSERT_TRUE(reader.TakeUntilEnded(2));
  EXPECT_EQ(now.Wait().code, 0);

  const auto& old = reader.Samples("LC7");
  const auto& young = reader.Samples("OTHER");
  ASSERT_EQ(old.size(), 10U);
  ASSERT_EQ(young.size(), 10U);
  EXPECT_EQ(old[0].stamp_ns, kStart + 20'000'000'000);
  EXPECT_GT(young[0].stamp_ns, old[0].stamp_ns + 1'000'000'000'000);
  EXPECT_EQ(young[9].stamp_ns - young[0].stamp_ns, 9'000'000'000);
  EXPECT_EQ(young[3].values, old[3].values);
  EXPECT_NE(young[0].source_id, old[0].source_id);
}

TEST_F(AppPublishTest, GapsOfAFileAreKept) {
  const std::string file = WriteFile(folder_.path() / "gap.csv",
                                     "t_s,CV_pct,X_pct\n0,1,1\n1,2,2\n"
                                     "2,3,3\n60,4,4\n61,5,5\n");
  Reader reader(domain_);

  Process process(With({"replay", "--file", file, "--valve", "G", "--speed",
                        "max", "--split-gaps"}));
  ASSERT_TRUE(reader.TakeUntilEnded());

  EXPECT_EQ(process.Wait().code, 0);
  const auto& got = reader.Samples("G");
  ASSERT_EQ(got.size(), 5U);
  EXPECT_EQ(got[3].stamp_ns - got[2].stamp_ns, 58'000'000'000);
  EXPECT_EQ(got[4].seq, 4U);
}

// Exports, with the map that sniff writes: what the reader makes of them is on
// the bus.
TEST_F(AppPublishTest, ReferenceFilesAreReplayedAsTheyAreRead) {
  const char* folder = std::getenv("FDI_REFERENCE_DATA");
  if (folder == nullptr) {
    GTEST_SKIP() << "FDI_REFERENCE_DATA is not set";
  }
  const std::string tags = (folder_.path() / "tags.toml").string();
  for (const std::string name :
       {"a01_wincc_archive", "a05_grafana_units", "a11_s7_counts"}) {
    SCOPED_TRACE(name);
    const std::string file = std::string(folder) + "/cases/" + name + ".csv";
    importer::ColumnMap map;
    map.zone = "Europe/Berlin";
    std::ofstream(tags) << importer::MapText(
        importer::Sniff(ReadTextFile(file), file, map), file);
    const importer::CsvTable table =
        importer::ReadCsvFile(file, {.map = importer::ReadTagMap(tags)});
    Reader reader(domain_);

    Process process(With({"replay", "--file", file, "--map", tags, "--valve",
                          name, "--speed", "max"}));
    ASSERT_TRUE(reader.TakeUntilEnded());

    EXPECT_EQ(process.Wait().code, 0);
    const auto& got = reader.Samples(name);
    const auto& sent = table.runs.at(0).samples;
    ASSERT_EQ(got.size(), sent.size());
    for (std::size_t k = 0; k < sent.size(); ++k) {
      ASSERT_EQ(got[k].present, sent[k].sample.present) << k;
      ASSERT_EQ(got[k].values, sent[k].sample.values) << k;
    }
  }
}

class AppPublishSignalTest : public PublishTest,
                             public testing::WithParamInterface<int> {};

// SIGHUP: its terminal was closed. Nobody would see what it goes on to send.
INSTANTIATE_TEST_SUITE_P(Stop, AppPublishSignalTest,
                         testing::Values(SIGTERM, SIGHUP));

TEST_P(AppPublishSignalTest, EndsALiveRunAndItsStream) {
  Reader reader(domain_);
  Process process(With({"run", "--valve", "S", "--duration", "1e6", "--speed",
                        "20", "--record"}));
  ASSERT_TRUE(
      reader.TakeUntil([&] { return reader.Samples("S").size() > 20; }));

  const auto start = steady_clock::now();
  process.Signal(GetParam());
  ASSERT_TRUE(reader.TakeUntilEnded());
  const Ended ended = process.Wait();

  EXPECT_LT(steady_clock::now() - start, std::chrono::seconds(2));
  EXPECT_EQ(ended.code, 0) << ended.err;
  const auto summary = nlohmann::json::parse(ended.out);
  EXPECT_EQ(summary["interrupted"], true);
  EXPECT_EQ(summary["published"], reader.Samples("S").size());
}

// A log that is full because nobody reads it, and one whose reader has ended;
// it gets a line because of the column that is not used.
TEST_F(AppPublishTest, WhatBecomesOfItsLogHoldsNothingUp) {
  std::string rows = "t_s,CV_pct,X_pct,note\n";
  for (int t = 0; t < 100; ++t) {
    rows += std::to_string(t) + ",50,50,x\n";
  }
  const std::string file = WriteFile(folder_.path() / "run.csv", rows);
  for (const bool read_by_nobody : {true, false}) {
    std::array<int, 2> log{};
    ASSERT_EQ(pipe2(log.data(), O_CLOEXEC), 0);
    if (read_by_nobody) {
      fcntl(log[1], F_SETFL, O_NONBLOCK);
      const std::string page(4096, 'x');
      while (write(log[1], page.data(), page.size()) > 0) {
      }
      fcntl(log[1], F_SETFL, 0);
    } else {
      close(log[0]);
    }
    Reader reader(domain_);
    Process process(
        With({"replay", "--file", file, "--valve", "L", "--speed", "max"}),
        log[1]);
    close(log[1]);

    EXPECT_TRUE(reader.TakeUntilEnded());
    EXPECT_EQ(process.Wait().code, 0);
    EXPECT_EQ(reader.Samples("L").size(), 100U);
    if (read_by_nobody) {
      close(log[0]);
    }
  }
}

TEST_F(AppPublishTest, SigtermEndsAWriterWhoseReaderTakesNothing) {
  Reader reader(domain_);
  Process process(With(
      {"replay", "--file", MakeLongCsv(), "--valve", "S", "--speed", "max"}));
  ASSERT_TRUE(
      reader.TakeUntil([&] { return !reader.Samples("S").empty(); }, 1));
  ASSERT_TRUE(reader.AwaitFull());

  const auto start = steady_clock::now();
  process.Signal(SIGTERM);
  const Ended ended = process.Wait();

  EXPECT_LT(steady_clock::now() - start, std::chrono::seconds(2));
  EXPECT_EQ(ended.code, 0) << ended.err;
}

TEST_F(AppPublishTest, MaxSpeedWithoutAReaderIsATransportFailure) {
  const Ended ended = RunProgram(
      With({"run", "--speed", "max", "--wait-reader", "0.3", "--record"}));

  EXPECT_EQ(ended.code, 4);
  EXPECT_THAT(ended.err, HasSubstr("--wait-reader"));
}

TEST_F(AppPublishTest, RealTimeIsKept) {
  Reader reader(domain_);

  const auto start = steady_clock::now();
  Process process(With({"run", "--duration", "41", "--speed", "20"}));
  ASSERT_TRUE(reader.TakeUntilEnded());

  EXPECT_GE(steady_clock::now() - start, milliseconds(2000));
  EXPECT_EQ(reader.Samples("VALVE-0001").size(), 41U);
  EXPECT_EQ(process.Wait().code, 0);
}

}  // namespace
}  // namespace fdi::simulator
