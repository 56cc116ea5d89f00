// Runs the built program: files that are scored without storing them.
#include <filesystem>
#include <fstream>
#include <stdexcept>

#include <gmock/gmock.h>

#include "import/csv.h"
#include "storage/runs/runs.h"
#include "tests/programs/trainer/fixture.h"

namespace fdi::trainer {
namespace {

using nlohmann::json;
using testing::AllOf;
using testing::HasSubstr;

class AppFilesTest : public TrainerProgram {
 protected:
  void SetUp() override {
    Write("c.toml", Quick() + TwoConditions());
    ASSERT_EQ(Run("train --campaign c.toml").code, 0) << Read("err.txt");
  }
  std::filesystem::path Runs() const { return Path("data") / "runs.db"; }
  storage::StoredRun NormalRun() const {
    storage::RunStore store(Runs());
    for (const storage::RunInfo& run : store.List()) {
      if (run.samples == 900) {
        return store.Load(run.id);
      }
    }
    throw std::runtime_error("no normal run");
  }
  // `copies` of the normal run, one after another; in the last 300 samples the
  // flow sensor reads half.
  std::vector<LabelledSample> FaultySamples(std::size_t copies = 1) const {
    const storage::StoredRun normal = NormalRun();
    std::vector<LabelledSample> samples;
    for (std::size_t k = 0; k < copies * normal.samples.size(); ++k) {
      LabelledSample labelled{normal.samples[k % normal.samples.size()].sample,
                              FaultTruth{}};
      labelled.sample.seq = k;
      labelled.sample.stamp_ns = static_cast<std::int64_t>(k) * 1'000'000'000;
      if (k + 300 >= copies * normal.samples.size()) {
        labelled.truth = FaultTruth{19, 0.5};
        labelled.sample.Set(Signal::kF, 0.5 * labelled.sample[Signal::kF]);
      }
      samples.push_back(labelled);
    }
    return samples;
  }
  void WriteFile(const std::string& name,
                 const std::vector<LabelledSample>& samples) const {
    std::ofstream file(Path(name));
    importer::WriteCsv(file, samples, FlowUnit::kM3PerHour, 0);
  }
};

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
