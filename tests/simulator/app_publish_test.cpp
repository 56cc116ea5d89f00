#include <algorithm>
#include <bit>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <fstream>
#include <functional>
#include <map>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "idl/endpoint.h"
#include "storage/csv.h"
#include "tests/idl/dds_fixture.h"
#include "tests/simulator/app_process.h"

// The binary as publisher, a Subscriber of this process as reader.
namespace fdi::simulator {
namespace {

using std::chrono::milliseconds;
using std::chrono::steady_clock;
using testing::HasSubstr;

// What a reader got.
class Reader {
 public:
  explicit Reader(const idl::TestDomain& domain)
      : participant_(domain.Options(), {}, "reader"),
        subscriber_(participant_) {}

  // Takes until `done`, at most `limit` messages a time.
  // @returns false if patience ran out.
  bool TakeUntil(const std::function<bool()>& done, int limit = 1'000'000) {
    const auto deadline = steady_clock::now() + idl::kPatience;
    while (!done()) {
      if (steady_clock::now() > deadline) {
        return false;
      }
      subscriber_.Take(handlers_, milliseconds(50), limit);
    }
    return true;
  }
  bool TakeUntilEnded(std::size_t valves = 1, int limit = 1'000'000) {
    return TakeUntil([&] { return ended_.size() >= valves; }, limit);
  }

  // Takes nothing until all buffers are full.
  bool AwaitFull() {
    const auto deadline = steady_clock::now() + idl::kPatience;
    while (status().rejected_samples == 0) {
      if (steady_clock::now() > deadline) {
        return false;
      }
      std::this_thread::sleep_for(milliseconds(10));
    }
    return true;
  }

  const std::vector<Sample>& Samples(const std::string& valve) {
    return samples_[valve];
  }
  const std::vector<std::string>& ended() const { return ended_; }
  idl::SubscriberStatus status() const { return subscriber_.status(); }

 private:
  idl::Participant participant_;
  idl::Subscriber<idl::ValveSampleMessage> subscriber_;
  std::map<std::string, std::vector<Sample>> samples_;
  std::vector<std::string> ended_;
  idl::Handlers<idl::ValveSampleMessage> handlers_{
      [this](const idl::ValveSampleMessage& message, const idl::Reception&) {
        samples_[message.valve_id].push_back(message.sample);
      },
      [this](const idl::ValveSampleMessage& message, const idl::Reception&) {
        ended_.push_back(message.valve_id);
      }};
};

class AppPublishTest : public testing::Test {
 protected:
  std::vector<std::string> With(std::vector<std::string> arguments) const {
    arguments.insert(arguments.end(),
                     {"--domain", std::to_string(domain_.id()), "--json",
                      "--data", folder_.path().string()});
    return arguments;
  }
  // A run of the program as CSV.
  std::string MakeCsv(const std::string& duration_s) const {
    const std::string file = (folder_.path() / "run.csv").string();
    const Ended ended = RunProgram(
        {"run", "--no-publish", "--export", file, "--duration", duration_s});
    EXPECT_EQ(ended.code, 0) << ended.err;
    return file;
  }

  // More samples than all buffers of a reader hold.
  static constexpr std::size_t kManySamples = 120'000;
  std::string MakeLongCsv() const {
    const std::string file = (folder_.path() / "long.csv").string();
    std::ofstream csv(file);
    csv << "t_s,CV_pct,X_pct\n";
    for (std::size_t i = 0; i < kManySamples; ++i) {
      csv << i << ",50,50\n";
    }
    return file;
  }

  idl::TestDomain domain_;
  storage::TemporaryDirectory folder_;
};

TEST_F(AppPublishTest, AReplayedCsvArrivesInOrderBitForBit) {
  const std::string file = MakeCsv("300");
  const storage::CsvTable table = storage::ReadCsvFile(file);
  Reader reader(domain_);

  Process process(With({"replay", "--csv", file, "--valve", "LC1", "--speed",
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

TEST_F(AppPublishTest, AtMaxSpeedASlowReaderLosesNothing) {
  Reader reader(domain_);
  Process process(With(
      {"replay", "--csv", MakeLongCsv(), "--valve", "S", "--speed", "max"}));

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
      With({"run", "--valves", "20", "--duration", "200", "--speed", "max"}));
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

  Process process(With({"replay", "--csv", file, "--valve", "G", "--speed",
                        "max", "--split-gaps"}));
  ASSERT_TRUE(reader.TakeUntilEnded());

  EXPECT_EQ(process.Wait().code, 0);
  const auto& got = reader.Samples("G");
  ASSERT_EQ(got.size(), 5U);
  EXPECT_EQ(got[3].stamp_ns - got[2].stamp_ns, 58'000'000'000);
  EXPECT_EQ(got[4].seq, 4U);
}

TEST_F(AppPublishTest, EachJsonLineIsPublishedAtOnce) {
  Reader reader(domain_);
  Process process(
      With({"replay", "--csv", "-", "--valve", "J", "--wait-reader", "20"}));

  process.Send(
      "{\"t_s\": 0, \"CV_pct\": 70.1, \"X_pct\": 0.1, \"F_t_h\": 12}\n");
  ASSERT_TRUE(
      reader.TakeUntil([&] { return reader.Samples("J").size() == 1; }));
  process.Send(
      "\n{\"t_s\": 1, \"CV_pct\": 71, \"X_pct\": null, \"F_t_h\": 13}\n");
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
  EXPECT_EQ(got[1].flow_unit, FlowUnit::kTPerHour);
  EXPECT_EQ(got[1].stamp_ns - got[0].stamp_ns, 1'000'000'000);
}

TEST_F(AppPublishTest, JsonLinesWithoutTimeAreStampedOnTheGridOfThePeriod) {
  Reader reader(domain_);
  Process process(With({"replay", "--csv", "-", "--valve", "J", "--period",
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

TEST_F(AppPublishTest, AFilePipedThroughStdinLosesNothing) {
  Reader reader(domain_);
  Process process(With({"replay", "--csv", "-", "--valve", "P"}));
  std::string lines = "t_s,CV_pct,X_pct,colour\n";
  for (int i = 0; i < 3000; ++i) {
    lines += std::to_string(i) + ",50,50,red\n";
  }

  process.Send(lines);
  process.CloseInput();
  ASSERT_TRUE(reader.TakeUntilEnded(1, 10));

  const Ended ended = process.Wait();
  EXPECT_EQ(ended.code, 0);
  EXPECT_THAT(ended.err, HasSubstr("names=colour"));
  EXPECT_EQ(reader.Samples("P").size(), 3000U);
  EXPECT_EQ(reader.status().lost, 0U);
}

TEST_F(AppPublishTest, ABadLineOnStdinEndsTheStreamBehindTheGoodOnes) {
  Reader reader(domain_);
  Process process(
      With({"replay", "--csv", "-", "--valve", "B", "--speed", "max"}));

  process.Send("t_s,CV_pct,X_pct\n0,50,50\n1,51,51\n2,x,52\n3,53,53\n");
  ASSERT_TRUE(reader.TakeUntilEnded());
  const Ended ended = process.Wait();

  EXPECT_EQ(ended.code, 3);
  EXPECT_THAT(ended.err, HasSubstr("stdin:4"));
  EXPECT_EQ(reader.Samples("B").size(), 2U);
}

TEST_F(AppPublishTest, JsonLinesAreRefusedWithLineAndKey) {
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"{\"t_s\":0,\"X_pct\":1}", "CV_pct"},
      {"{\"t_s\":0,\"CV_pct\":1}", "X_pct"},
      {"{\"t_s\":0,\"CV_pct\":\"a\",\"X_pct\":1}", "not a finite number"},
      {"{\"t_s\":0,\"CV_pct\":1,\"X_pct\":1e999}", "stdin:1"},
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
    Process process(With({"replay", "--csv", "-", "--valve", "B"}));
    process.Send(lines + "\n");
    process.CloseInput();

    const Ended ended = process.Wait();

    EXPECT_EQ(ended.code, 3) << lines;
    EXPECT_THAT(ended.err, HasSubstr(word)) << lines;
  }
}

TEST_F(AppPublishTest, SigtermEndsALiveRunAndItsStream) {
  Reader reader(domain_);
  Process process(With({"run", "--valve", "S", "--duration", "1e6", "--speed",
                        "20", "--record"}));
  ASSERT_TRUE(
      reader.TakeUntil([&] { return reader.Samples("S").size() > 20; }));

  const auto start = steady_clock::now();
  process.Signal(SIGTERM);
  ASSERT_TRUE(reader.TakeUntilEnded());
  const Ended ended = process.Wait();

  EXPECT_LT(steady_clock::now() - start, std::chrono::seconds(2));
  EXPECT_EQ(ended.code, 0) << ended.err;
  const auto summary = nlohmann::json::parse(ended.out);
  EXPECT_EQ(summary["interrupted"], true);
  EXPECT_EQ(summary["published"], reader.Samples("S").size());
}

TEST_F(AppPublishTest, SigtermEndsAWriterWhoseReaderTakesNothing) {
  Reader reader(domain_);
  Process process(With(
      {"replay", "--csv", MakeLongCsv(), "--valve", "S", "--speed", "max"}));
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
