// Runs the built program: files that are scored without storing them.
#include <filesystem>
#include <fstream>
#include <stdexcept>

#include <gmock/gmock.h>

#include "import/csv.h"
#include "storage/runs/runs.h"
#include "tests/programs/trainer/trained_runs.h"

namespace fdi::trainer {
namespace {

using nlohmann::json;
using testing::AllOf;
using testing::HasSubstr;

class AppFilesTest : public TrainedRuns {};

TEST_F(AppFilesTest, FileIsScoredAsTheSameRunWouldBeOnceStored) {
  WriteFile("f.csv", FaultySamples());
  storage::NewRun row;
  row.valve_id = "V";
  const std::string id =
      storage::RunStore(Runs(), storage::Access::kOccasionalWriter)
          .Import(importer::ReadCsvFile(Path("f.csv")).runs, row)
          .front();
  const std::size_t stored = storage::RunStore(Runs()).List().size();

  json result = RunJson("evaluate --model-set quick --runs " + id +
                        " --file f.csv --file f.csv@:700");

  json& runs = result["runs"];
  ASSERT_EQ(runs.size(), 3U);
  EXPECT_EQ(runs[1]["run_id"], "f.csv");
  EXPECT_EQ(runs[2]["run_id"], "f.csv@:700");
  EXPECT_EQ(runs[1]["final_set"], json::array({"f19"}));
  runs[1]["run_id"] = runs[0]["run_id"];
  EXPECT_EQ(runs[1], runs[0]);
  EXPECT_EQ(runs[2]["t_dt"], runs[0]["t_dt"]);
  EXPECT_EQ(storage::RunStore(Runs()).List().size(), stored);
}

TEST_F(AppFilesTest, MapTellsWhereTheSignalsOfAFileStand) {
  WriteFile("f.csv", FaultySamples());
  std::string text = Read("f.csv");
  text.replace(text.find("F_m3_h"), 6, "FLOW");
  Write("foreign.csv", text);
  Write("tags.toml", "[signal.F]\ncolumn = \"FLOW\"\nunit = \"m3/h\"\n");
  const std::string call = "evaluate --model-set quick --file foreign.csv";

  const Outcome refused = Run(call);
  EXPECT_EQ(refused.code, 3);
  EXPECT_THAT(refused.err,
              AllOf(HasSubstr("foreign.csv"), HasSubstr("F_m3_h")));

  json mapped = RunJson(call + " --map tags.toml");
  json plain = RunJson("evaluate --model-set quick --file f.csv");
  mapped["runs"][0].erase("run_id");
  plain["runs"][0].erase("run_id");
  EXPECT_EQ(mapped["runs"], plain["runs"]);
}

TEST_F(AppFilesTest, BadFilesAreNamedWithTheirExitCode) {
  WriteFile("f.csv", FaultySamples());
  const auto outcome = [&](const std::string& arguments) {
    return Run("evaluate --model-set quick " + arguments);
  };
  EXPECT_EQ(outcome("").code, 2);
  EXPECT_EQ(outcome("--map m.toml --runs abcdef").code, 2);
  EXPECT_EQ(outcome("--file no.csv").code, 5);
  EXPECT_THAT(outcome("--file no.csv").err, HasSubstr("no.csv"));
  EXPECT_EQ(outcome("--file f.csv@x:1").code, 2);
  EXPECT_THAT(outcome("--file f.csv@x:1").err, HasSubstr("FILE@from:to"));
  EXPECT_EQ(outcome("--file f.csv@5000:").code, 5);
}

}  // namespace
}  // namespace fdi::trainer
