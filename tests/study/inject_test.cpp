// Runs the built program: faults put onto stored runs and files.
#include <gmock/gmock.h>

#include "import/csv.h"
#include "storage/runs/runs.h"
#include "tests/study/fixture.h"

namespace fdi::trainer::study {
namespace {

using nlohmann::json;
using testing::AllOf;
using testing::HasSubstr;

class StudyInjectTest : public StudyProgram {
 protected:
  void SetUp() override {
    std::string text = "t_s,CV_pct,P1_kPa,P2_kPa,T1_degC,X_pct,F_t_h\n";
    for (int t = 100; t < 400; ++t) {
      text += std::to_string(t) + ",60,3550,2620,105,60,17\n";
    }
    Write("healthy.csv", text);
  }
  std::vector<LabelledSample> Samples(const std::string& file) const {
    return importer::ReadCsvFile(Path(file)).runs.front().samples;
  }
};

TEST_F(StudyInjectTest, FileComesOutWithTheFaultAndItsTruth) {
  const Outcome outcome = Study(
      "inject --file healthy.csv --fault f19:abrupt@200:strength=0.25 -o "
      "f.csv");

  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(outcome.out,
              AllOf(HasSubstr("f.csv: f19:abrupt@200:strength=0.25 on 100 of "
                              "300 samples of healthy.csv"),
                    HasSubstr("left out: the reaction of the loop")));
  const std::vector<LabelledSample> samples = Samples("f.csv");
  ASSERT_EQ(samples.size(), 300U);
  EXPECT_EQ(samples[199].sample[Signal::kF], 17.0);
  EXPECT_EQ(samples[199].truth->fault, 0);
  EXPECT_EQ(samples[200].sample[Signal::kF], 0.75 * 17.0);
  EXPECT_EQ(samples[200].truth->fault, 19);
  EXPECT_EQ(samples[200].truth->strength, 0.25);
  EXPECT_FALSE(std::filesystem::exists(Path("data")));
}

TEST_F(StudyInjectTest, NothingIsWrittenOfWhatCannotBeStored) {
  const Outcome outcome = Study(
      "inject --file healthy.csv --fault f19:abrupt@200 -o f.csv --store");
  EXPECT_EQ(outcome.code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("--valve ID"));
  EXPECT_FALSE(std::filesystem::exists(Path("f.csv")));
}

TEST_F(StudyInjectTest, StoredRunNamesItsSourceAndCanBeCut) {
  const std::string first = StudyJson(
      "inject --file healthy.csv --valve LV-1 --fault "
      "f6:abrupt@299:strength=0.3")["run_id"];
  const json result = StudyJson("inject --run " + first +
                                "@100:200 --fault t1:flatline@10 -o t.csv "
                                "--store");

  EXPECT_EQ(result["samples"], 100);
  EXPECT_EQ(result["faulty_samples"], 90);
  EXPECT_EQ(result["left_out"], json::array());
  const storage::StoredRun run = storage::RunStore(Path("data") / "runs.db")
                                     .Load(std::string(result["run_id"]));
  EXPECT_EQ(run.info.run.valve_id, "LV-1");
  EXPECT_EQ(run.info.run.scenario, first + "@100:200 with t1:flatline@10");
  EXPECT_EQ(run.samples.front().sample.stamp_ns, run.info.run.start_ns);
  EXPECT_EQ(run.samples[10].truth->fault, 20);
  EXPECT_EQ(Samples("t.csv").size(), 100U);
}

TEST_F(StudyInjectTest, WhatCannotBeDoneIsNamedWithItsExitCode) {
  const std::string call = "inject --file healthy.csv -o x.csv --fault ";
  const Outcome rod = Study(call + "f10:abrupt@50");
  EXPECT_EQ(rod.code, 2);
  EXPECT_THAT(rod.err, AllOf(HasSubstr("f10"), HasSubstr("f19")));
  EXPECT_EQ(Study("inject --fault f19:abrupt@50").code, 2);
  EXPECT_EQ(Study("inject --file healthy.csv --fault f19:abrupt@50").code, 2);
  EXPECT_EQ(Study(call + "f19:abrupt@5000").code, 2);
  EXPECT_EQ(Study(call + "f19:abrupt@50:strength=2").code, 2);
  EXPECT_EQ(Study(call + "f19:abrupt@50 --flow-range 40").code, 2);
  EXPECT_EQ(Study("inject --file no.csv -o x.csv --fault f5:abrupt@5").code, 5);

  ASSERT_EQ(Study(call + "f5:abrupt@50").code, 0);
  const Outcome again =
      Study("inject --file x.csv -o y.csv --fault f19:abrupt@50");
  EXPECT_EQ(again.code, 3);
  EXPECT_THAT(again.err, AllOf(HasSubstr("x.csv"), HasSubstr("f5 already")));
  EXPECT_FALSE(std::filesystem::exists(Path("y.csv")));
}

TEST_F(StudyInjectTest, FlowInAnotherUnitNeedsTheRangeOfItsTransmitter) {
  std::string text = Read("healthy.csv");
  text.replace(text.find("F_t_h"), 5, "F_m3_h");
  Write("volume.csv", text);
  const std::string call =
      "inject --file volume.csv -o v.csv --fault f19:abrupt@0:strength=-0.5";
  const Outcome refused = Study(call);
  EXPECT_EQ(refused.code, 2);
  EXPECT_THAT(refused.err, AllOf(HasSubstr("m3/h"), HasSubstr("--flow-range")));

  const json result = StudyJson(call + " --flow-range 0:20");
  EXPECT_EQ(result["samples_at_flow_limit"], 300);
  EXPECT_EQ(Samples("v.csv")[0].sample[Signal::kF], 20.0);
}

}  // namespace
}  // namespace fdi::trainer::study
