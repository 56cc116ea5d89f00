#include <filesystem>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "diagnosis/model/fault_catalogue.h"
#include "import/csv.h"
#include "simulator/scenario/scenario_toml.h"
#include "storage/runs/runs.h"
#include "tests/programs/simulator/process.h"

// The binary without DDS: what it computes, stores and refuses.
namespace fdi::simulator {
namespace {

using testing::AllOf;
using testing::HasSubstr;

class AppRunTest : public testing::Test {
 protected:
  std::string Data() const { return folder_.path().string(); }

  // Records a run and loads it.
  storage::StoredRun Record(std::vector<std::string> options) {
    options.insert(options.begin(), {"run", "--no-publish", "--record",
                                     "--json", "--data", Data()});
    const Ended ended = RunProgram(options);
    EXPECT_EQ(ended.code, 0) << ended.err;
    const auto summary = nlohmann::json::parse(ended.out);
    storage::RunStore store(folder_.path() / "runs.db");
    return store.Load(summary["sources"][0]["run_id"].get<std::string>());
  }

  storage::TemporaryDirectory folder_;
};

TEST_F(AppRunTest, TheSameSeedGivesTheSameSamplesBitForBit) {
  const std::vector<std::string> options = {
      "--duration", "2m",      "--seed",
      "9",          "--fault", "f7:abrupt@60:strength=0.5"};
  auto other_seed = options;
  other_seed[3] = "10";

  const storage::StoredRun a = Record(options);
  const storage::StoredRun b = Record(options);
  const storage::StoredRun c = Record(other_seed);

  ASSERT_EQ(a.samples.size(), 120U);
  ASSERT_EQ(b.samples.size(), 120U);
  int different = 0;
  for (std::size_t i = 0; i < a.samples.size(); ++i) {
    EXPECT_EQ(a.samples[i].sample.values, b.samples[i].sample.values) << i;
    EXPECT_EQ(a.samples[i].sample.seq, i);
    EXPECT_EQ(a.samples[i].truth->fault, i < 60 ? 0 : 7);
    different +=
        a.samples[i].sample.values != c.samples[i].sample.values ? 1 : 0;
  }
  EXPECT_GT(different, 110);
  EXPECT_NE(a.info.run.source_id, b.info.run.source_id);
}

TEST_F(AppRunTest, AStoredScenarioRepeatsItsRun) {
  const storage::StoredRun first =
      Record({"--duration", "100", "--seed", "4", "--excitation", "level-loop",
              "--parameters", "paper-operating-point", "--set",
              "excitation.proportional_gain=3", "--start",
              "2026-01-02T03:04:05Z", "--valve", "LC1"});
  const std::string file =
      WriteFile(folder_.path() / "again.toml", first.info.run.scenario);

  const storage::StoredRun again = Record({"--scenario", file});

  EXPECT_EQ(again.info.run.valve_id, "LC1");
  EXPECT_EQ(again.info.run.seed, 4U);
  EXPECT_EQ(again.info.run.scenario, first.info.run.scenario);
  EXPECT_EQ(again.info.run.flow_unit, FlowUnit::kM3PerHour);
  ASSERT_EQ(again.samples.size(), first.samples.size());
  for (std::size_t i = 0; i < first.samples.size(); ++i) {
    EXPECT_EQ(again.samples[i].sample.values, first.samples[i].sample.values);
    EXPECT_EQ(again.samples[i].sample.stamp_ns,
              first.samples[i].sample.stamp_ns);
  }
}

TEST_F(AppRunTest, EachOfManyValvesIsARunOfItsOwn) {
  const Ended ended = RunProgram({"run", "--no-publish", "--record", "--data",
                                  Data(), "--count", "3", "--valve", "LC",
                                  "--duration", "10", "--seed", "5"});

  ASSERT_EQ(ended.code, 0) << ended.err;
  storage::RunStore store(folder_.path() / "runs.db");
  const auto runs = store.List();
  ASSERT_EQ(runs.size(), 3U);
  std::vector<std::string> valves;
  for (const storage::RunInfo& info : runs) {
    valves.push_back(info.run.valve_id);
    EXPECT_EQ(info.samples, 10);
    EXPECT_EQ(info.state, storage::RunState::kComplete);
    EXPECT_EQ("LC-" + std::to_string(*info.run.seed - 4), info.run.valve_id);
  }
  EXPECT_THAT(valves, testing::UnorderedElementsAre("LC-1", "LC-2", "LC-3"));
}

TEST_F(AppRunTest, TheExportedCsvHasTheBitsOfTheRun) {
  const std::string file = (folder_.path() / "run.csv").string();
  const storage::StoredRun run =
      Record({"--duration", "50", "-o", file, "--fault",
              "f19:abrupt@20:strength=-0.5"});

  const importer::CsvTable table = importer::ReadCsvFile(file);

  ASSERT_EQ(table.runs.size(), 1U);
  ASSERT_EQ(table.runs[0].samples.size(), run.samples.size());
  for (std::size_t i = 0; i < run.samples.size(); ++i) {
    const LabelledSample& read = table.runs[0].samples[i];
    EXPECT_EQ(read.sample.values, run.samples[i].sample.values);
    EXPECT_EQ(read.truth->strength, run.samples[i].truth->strength);
  }
}

struct Refusal {
  std::vector<std::string> arguments;
  int code;
  std::vector<std::string> words;
};

TEST_F(AppRunTest, WhatItRefusesItNamesWithWhatIsAccepted) {
  const std::string bad_key =
      WriteFile(folder_.path() / "bad.toml", "seed = 1\nspeedy = 2\n");
  const std::string text = WriteFile(folder_.path() / "text.csv",
                                     "t_s,CV_pct,X_pct\n0,50,50\n1,fifty,50\n");
  const std::string missing =
      WriteFile(folder_.path() / "missing.csv", "t_s,X_pct\n0,50\n1,50\n");
  const std::string jump = WriteFile(folder_.path() / "jump.csv",
                                     "t_s,CV_pct,X_pct\n0,50,50\n1,50,50\n"
                                     "2,50,50\n9,50,50\n10,50,50\n");
  const std::string empty = WriteFile(folder_.path() / "empty.csv", "");
  const std::vector<Refusal> refusals = {
      {{"run", "--no-publish", "--fault", "f99:abrupt@3"}, 2, {"f1..f19"}},
      {{"run", "--no-publish", "--fault", "f1:sudden@3"}, 2, {"abrupt"}},
      {{"run", "--no-publish", "--fault", "f19@100"}, 2, {"profile"}},
      {{"run", "--no-publish", "--duration", "100", "--fault",
        "f19:abrupt@100"},
       2,
       {"f19:abrupt@100", "after the end of the run"}},
      {{"run", "--no-publish", "--excitation", "x"}, 2, {"level-loop"}},
      {{"run", "--no-publish", "--excitation", "csv:" + text}, 3, {"P1_kPa"}},
      {{"run", "--no-publish", "--parameters", "x"}, 2, {"lublin-actuator-3"}},
      {{"run", "--no-publish", "--scenario", bad_key}, 2, {":2:", "speedy"}},
      {{"run", "--no-publish", "--scenario", "no.toml"}, 5, {"no.toml"}},
      {{"run", "--no-publish", "--set", "a.b=1"}, 2, {"a.b=1"}},
      {{"run", "--no-publish", "--duration", "-1"}, 2, {"duration_s"}},
      {{"run", "--no-publish", "--duration", "5x"},
       2,
       {"error: --duration: '5x'"}},
      {{"run", "--no-publish", "--start", "noon"}, 2, {"noon"}},
      {{"run", "--speed", "fast"}, 2, {"fast", "max"}},
      {{"run", "--no-publish", "--valve", std::string(65, 'v')}, 2, {"64"}},
      {{"run", "--no-publish", "--count", "2", "-o", "x.csv"}, 2, {"-o"}},
      {{"run", "--no-publish", "--seed", "9223372036854775807", "--count", "2"},
       2,
       {"--count 2", "9223372036854775807"}},
      {{"replay", "--valve", "V"}, 2, {"--file", "--run"}},
      {{"replay", "--file", text}, 2, {"--valve"}},
      {{"replay", "--valve", "V", "--file", text}, 3, {"text.csv:3", "fifty"}},
      {{"replay", "--valve", "V", "--file", missing}, 3, {"CV_pct"}},
      {{"replay", "--valve", "V", "--file", jump}, 3, {"jump.csv:5"}},
      {{"replay", "--valve", "V", "--file", empty}, 3, {"empty"}},
      {{"replay", "--valve", "V", "--file", "no.csv"}, 5, {"no.csv"}},
      {{"replay", "--run", "0123456789ab", "--data", Data()},
       5,
       {"0123456789ab"}},
  };
  for (const Refusal& refusal : refusals) {
    const Ended ended = RunProgram(refusal.arguments);

    EXPECT_EQ(ended.code, refusal.code)
        << testing::PrintToString(refusal.arguments) << ended.err;
    for (const std::string& word : refusal.words) {
      EXPECT_THAT(ended.err, HasSubstr(word))
          << testing::PrintToString(refusal.arguments);
    }
    EXPECT_EQ(ended.out, "");
  }
  EXPECT_FALSE(std::filesystem::exists(folder_.path() / "runs.db"));
}

TEST_F(AppRunTest, AnUnknownRunOfAStoreIsNotFound) {
  Record({"--duration", "5"});

  const Ended ended =
      RunProgram({"replay", "--run", "0123456789ab", "--data", Data()});

  EXPECT_EQ(ended.code, 5) << ended.err;
}

}  // namespace
}  // namespace fdi::simulator
