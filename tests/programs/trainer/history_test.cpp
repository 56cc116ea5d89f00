// Runs the built program: months of files, here minutes, against work orders.
#include <sstream>
#include <vector>

#include <gmock/gmock.h>

#include "import/csv.h"
#include "storage/runs/runs.h"
#include "tests/programs/trainer/fixture.h"

namespace fdi::trainer {
namespace {

using nlohmann::json;
using testing::AllOf;
using testing::HasSubstr;

class AppHistoryTest : public TrainerProgram {
 protected:
  // Fifteen minutes of LV-1 in two files; the flow sensor reads half from
  // 600 s on.
  void SetUp() override {
    Write("c.toml", Quick() + TwoConditions());
    ASSERT_EQ(Run("train --campaign c.toml").code, 0) << Read("err.txt");
    storage::RunStore store(Path("data") / "runs.db");
    for (const storage::RunInfo& info : store.List()) {
      if (info.samples == 900) {
        for (storage::StoredSample& stored : store.Load(info.id).samples) {
          if (stored.sample.seq >= 600) {
            stored.sample.Set(Signal::kF, 0.5 * stored.sample[Signal::kF]);
          }
          samples_.push_back({stored.sample, {}});
        }
      }
    }
    ASSERT_EQ(samples_.size(), 900U);
    std::filesystem::create_directories(Path("plant") / "LV-1");
    WriteFile("plant/LV-1/b_2026-03-01.csv", 0, 450);
    WriteFile("plant/LV-1/a_2026-03-01T000730.csv", 450, 900);
  }
  // t_s counts from the first sample of the file.
  void WriteFile(const std::string& name, std::size_t from,
                 std::size_t to) const {
    std::ostringstream text;
    const std::vector<LabelledSample> part(
        samples_.begin() + static_cast<std::ptrdiff_t>(from),
        samples_.begin() + static_cast<std::ptrdiff_t>(to));
    importer::WriteCsv(text, part, part[0].sample.flow_unit,
                       part[0].sample.stamp_ns);
    Write(name, text.str());
  }
  void WriteOrders(const std::string& rows) const {
    Write("orders.csv", "valve,time,found\n" + rows);
  }
  static std::string Call(const std::string& history = "plant") {
    return "evaluate --model-set quick --work-orders orders.csv --history " +
           history;
  }

  std::vector<LabelledSample> samples_;
};

TEST_F(AppHistoryTest, OneEngineFollowsTheFilesInOrderOfTime) {
  WriteOrders("LV-1,2026-03-01T00:14:00Z,f19\nLV-2,2026-03-01,f3\n");

  const json result = RunJson(Call());

  const json& order = result["orders"][0];
  EXPECT_EQ(order["outcome"], "exact");
  EXPECT_EQ(order["said"], "f19");
  EXPECT_EQ(order["ahead_s"], 240.0);
  EXPECT_EQ(result["orders"][1]["outcome"], "no data");
  EXPECT_EQ(result["by_fault"]["f19"]["exact"], 1);
  EXPECT_TRUE(result["false_episodes"].empty());
  EXPECT_NEAR(result["hours"], 900.0 / 3600.0, 1e-9);
  // It settles once, not anew at the border of the files.
  EXPECT_NEAR(result["live_hours"], 870.0 / 3600.0, 1e-9);
  EXPECT_THAT(Run(Call() + " --utc").out,
              AllOf(HasSubstr("2026-03-01T00:10:00Z"), HasSubstr("4 min"),
                    HasSubstr("0 false episodes")));
}

TEST_F(AppHistoryTest, EpisodeThatNoRepairFollowsIsFalseOrUndecided) {
  WriteOrders("LV-1,2026-03-01T00:14:00Z,nothing\n");
  const json nothing = RunJson(Call());
  EXPECT_EQ(nothing["orders"][0]["outcome"], "false");
  EXPECT_EQ(nothing["false_episodes"].size(), 1U);
  EXPECT_EQ(nothing["false_episodes"][0]["said"], "f19");

  WriteOrders("LV-2,2026-03-01,f3\n");
  EXPECT_EQ(RunJson(Call())["undecided_episodes"].size(), 1U);
}

TEST_F(AppHistoryTest, PatternsAndSecondsServeOneValve) {
  WriteFile("whole.csv", 0, 900);
  WriteOrders("X-7,840,f19\n");
  const json result = RunJson(Call("'who*.csv'") + " --valve X-7");
  EXPECT_EQ(result["orders"][0]["outcome"], "exact");
  EXPECT_EQ(result["orders"][0]["first_s"], 600.0);
}

TEST_F(AppHistoryTest, WhatCannotBeUsedIsNamedWithItsExitCode) {
  WriteOrders("LV-1,yesterday,f19\n");
  const Outcome time = Run(Call());
  EXPECT_EQ(time.code, 3);
  EXPECT_THAT(time.err, HasSubstr("orders.csv:2"));
  WriteOrders("LV-1,1772323200000,f19\n");  // ms
  const Outcome late = Run(Call());
  EXPECT_EQ(late.code, 3);
  EXPECT_THAT(late.err, AllOf(HasSubstr("orders.csv:2"), HasSubstr("9e9 s")));
  WriteOrders("LV-1,2026-03-01,rust\n");
  EXPECT_THAT(Run(Call()).err, HasSubstr("'rust' is neither nothing nor"));
  WriteOrders("LV-1,2026-03-01,f19\n");
  EXPECT_EQ(Run(Call("nowhere")).code, 5);
  EXPECT_EQ(Run("evaluate --model-set quick --history plant").code, 2);
  EXPECT_EQ(Run("evaluate --work-orders orders.csv --history plant").code, 5);

  WriteFile("plant/LV-1/c_2026-03-01T0001.csv", 0, 100);
  const Outcome overlap = Run(Call());
  EXPECT_EQ(overlap.code, 3);
  EXPECT_THAT(overlap.err, AllOf(HasSubstr("c_2026-03-01T0001.csv"),
                                 HasSubstr("2026-03-01T00:07:29Z")));

  WriteFile("plant/LV-1/pump_1234-56-78.csv", 0, 100);
  const Outcome date = Run(Call());
  EXPECT_EQ(date.code, 3);
  EXPECT_THAT(date.err, AllOf(HasSubstr("pump_1234-56-78.csv"),
                              HasSubstr("1234-56-78, does not exist")));
}

}  // namespace
}  // namespace fdi::trainer
