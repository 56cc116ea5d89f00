#include <cmath>
#include <cstdlib>
#include <sstream>

#include <gmock/gmock.h>

#include "base/error.h"
#include "diagnosis/model/fault_catalogue.h"
#include "import/csv.h"
#include "storage/runs/run_recorder.h"
#include "tests/storage/runs_fixture.h"

namespace fdi::storage {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

using RunsTest = RunsFixture;

std::vector<SampleSeries> TableOf(const std::string& text,
                                  bool split_gaps = false) {
  importer::CsvOptions options;
  options.required = 0;
  options.start_ns = kStart;
  options.split_gaps = split_gaps;
  return importer::ReadCsv(text, options).runs;
}

TEST_F(RunsTest, AStretchIsHalfOpenAndInSecondsFromTheStart) {
  RunRecorder recorder(file_, {4});
  const auto key = recorder.Begin(RunOf("V1"));
  const std::string id = recorder.Id(key);
  for (int k = 0; k < 10; ++k) {
    recorder.Append(key, SampleAt(k));
  }
  recorder.Close();

  EXPECT_THAT(Positions(id + "@2:5"), ElementsAre(2, 3, 4));
  EXPECT_THAT(Positions(id + "@7.5:"), ElementsAre(8, 9));
  EXPECT_THAT(Positions(id + "@:1"), ElementsAre(0));
  EXPECT_THAT(Positions(id + "@-1e300:1e300"), SizeIs(10));
  EXPECT_THROW(Positions(id + "@10:20"), NotFoundError);
}

TEST_F(RunsTest, SelectorsThatSayNothingAreUsageErrors) {
  for (const std::string text :
       {"", "@1:2", "xyz", "abc@", "abc@1", "abc@2:1", "abc@1:1", "abc@x:1",
        "abc@nan:1", "0123456789abc"}) {
    EXPECT_THAT(MessageOf<ConfigError>([&] { ParseRunSelector(text); }),
                HasSubstr("accepted are ID"))
        << text;
  }
  EXPECT_EQ(ParseRunSelector("ABC@1:2").id, "abc");
}

TEST_F(RunsTest, AUniqueBeginningOfAnIdSelectsTheRun) {
  RunStore store(file_, Access::kOccasionalWriter);
  const auto table = TableOf("t_s,CV_pct,X_pct\n0,1,2\n1,1,2\n");
  // 17 runs: two at least begin alike.
  std::vector<std::string> ids;
  for (int i = 0; i < 17; ++i) {
    ids.push_back(store.Import(table, RunOf("V")).at(0));
  }
  EXPECT_EQ(store.Info("last").id, ids.back());
  EXPECT_EQ(store.Info("last@1:2").id, ids.back());
  std::sort(ids.begin(), ids.end());
  std::size_t twin = 1;
  while (ids[twin][0] != ids[twin - 1][0]) {
    ++twin;
  }

  EXPECT_EQ(store.Info(ids[3].substr(0, 11)).id, ids[3]);
  EXPECT_THAT(
      MessageOf<NotFoundError>([&] { store.Info(ids[twin].substr(0, 1)); }),
      AllOf(HasSubstr("ambiguous"), HasSubstr(ids[twin - 1])));
  store.Delete(ids[3]);
  EXPECT_THAT(MessageOf<NotFoundError>([&] { store.Info(ids[3]); }),
              HasSubstr("no run " + ids[3]));
  EXPECT_EQ(Query("SELECT count(*) FROM chunk"), 16);
}

TEST_F(RunsTest, ImportKeepsTruthAndSplitTablesBecomeRunsOfTheirOwn) {
  RunStore store(file_, Access::kOccasionalWriter);
  const std::string text =
      "t_s,CV_pct,X_pct,fault,fault_strength\n"
      "0,1,2,f19,0\n1,1,2,f19,0.5\n5,1,2,f19,0.5\n6,1,2,f19,0.75\n";
  const auto ids = store.Import(TableOf(text, true), RunOf("V"));

  ASSERT_THAT(ids, SizeIs(2));
  const StoredRun second = store.Load(ids[1]);
  EXPECT_EQ(second.info.run.origin, RunOrigin::kImported);
  EXPECT_EQ(second.info.run.start_ns, kStart + 5 * kSecond);
  EXPECT_TRUE(second.info.has_truth);
  ASSERT_THAT(second.samples, SizeIs(2));
  EXPECT_EQ(second.samples[1].truth->fault, 19);
  EXPECT_EQ(second.samples[1].truth->strength, 0.75);
  EXPECT_EQ(second.samples[0].sample.source_id, RunOf("V").source_id);
}

TEST_F(RunsTest, AnImportThatFailsStoresNothing) {
  RunStore store(file_, Access::kOccasionalWriter);
  auto table = TableOf("t_s,CV_pct,X_pct\n0,1,2\n1,1,2\n5,1,2\n", true);
  table[1].period_s = -1.0;  // refused by the schema, after run 1

  EXPECT_THROW(store.Import(table, RunOf("V")), SqliteError);
  EXPECT_THAT(store.List(), IsEmpty());
}

TEST_F(RunsTest, LabelsOverrideTheTruthOfTheirStretch) {
  RunStore store(file_, Access::kOccasionalWriter);
  const std::string id = store.Import(
      TableOf("t_s,CV_pct,X_pct\n0,1,2\n1,1,2\n2,1,2\n3,1,2\n"), RunOf("V"))[0];
  EXPECT_FALSE(store.Load(id).samples[0].truth);

  store.Label(id, 0, 0.0);
  store.Label(id + "@1:3", 18, -0.5);
  const StoredRun run = store.Load(id);
  EXPECT_EQ(run.samples[0].truth->fault, 0);
  EXPECT_EQ(run.samples[1].truth->fault, 18);
  EXPECT_EQ(run.samples[2].truth->strength, -0.5);
  EXPECT_EQ(run.samples[3].truth->fault, 0);
  Database database(file_, RunsSchema(), Access::kReader);
  Statement labels = database.Prepare("SELECT labels FROM run_summary");
  ASSERT_TRUE(labels.Step());
  EXPECT_EQ(labels.Text(0), "normal, f18 -0.5 @1.0:3.0");

  EXPECT_THROW(store.Label(id, kLastFault + 1, 0.5), ConfigError);
  EXPECT_THROW(store.Label(id, 1, -1.5), ConfigError);
  EXPECT_THROW(store.Label(id, 1, 0.0), ConfigError);
  EXPECT_THROW(store.Label(id, 0, 0.5), ConfigError);
  EXPECT_THROW(store.Label(id + "@4:9", 1, 0.5), NotFoundError);
  EXPECT_EQ(store.RemoveLabels(id), 2);
  EXPECT_FALSE(store.Load(id).samples[0].truth);
}

TEST_F(RunsTest, ListSelectsByValveOriginAndTime) {
  {
    RunStore store(file_, Access::kOccasionalWriter);
    store.Import(TableOf("t_s,CV_pct,X_pct\n0,1,2\n1,1,2\n"), RunOf("FV-1"));
    RunRecorder recorder(file_);
    NewRun late = RunOf("FV-2");
    late.start_ns += 100 * kSecond;
    late.seed = ~std::uint64_t{0};
    recorder.Append(recorder.Begin(late), SampleAt(100));
    recorder.Close();
  }
  RunStore store(file_);
  RunFilter filter;
  EXPECT_THAT(store.List(), SizeIs(2));
  filter.valve_glob = "*-2";
  EXPECT_EQ(store.List(filter).at(0).run.seed, ~std::uint64_t{0});
  filter = {};
  filter.origin = RunOrigin::kImported;
  EXPECT_EQ(store.List(filter).at(0).run.valve_id, "FV-1");
  filter = {};
  filter.since_ns = kStart + kSecond;
  EXPECT_EQ(store.List(filter).at(0).run.valve_id, "FV-2");
  filter.until_ns = kStart + 100 * kSecond;
  EXPECT_THAT(store.List(filter), IsEmpty());
}

TEST_F(RunsTest, SummaryViewAnswersWithReadableTimes) {
  RunStore store(file_, Access::kOccasionalWriter);
  store.Import(TableOf("t_s,CV_pct,X_pct\n0,1,2\n0.5,1,2\n"), RunOf("V"));
  Database database(file_, RunsSchema(), Access::kReader);
  Statement row = database.Prepare(
      "SELECT valve_id, start_utc, end_utc, duration_s, samples, rejected,"
      " period_s, flow_unit, origin, state, has_truth, stored_bytes"
      " FROM run_summary");
  ASSERT_TRUE(row.Step());
  EXPECT_EQ(row.Text(1), "2023-11-14T22:13:20.000Z");  // date -ud @1700000000
  EXPECT_EQ(row.Text(2), "2023-11-14T22:13:20.500Z");
  EXPECT_EQ(row.Double(3), 1.0);
  EXPECT_EQ(row.Int(4), 2);
  EXPECT_EQ(row.Text(7), "m3/h");
  EXPECT_EQ(row.Text(8), "imported");
  EXPECT_EQ(row.Text(9), "complete");
  EXPECT_EQ(row.Int(10), 0);
  EXPECT_GT(row.Int(11), 0);
}

TEST_F(RunsTest, DamagedChunksAreReportedWithTheirPlace) {
  RunStore store(file_, Access::kOccasionalWriter);
  const std::string id =
      store.Import(TableOf("t_s,CV_pct,X_pct\n0,1,2\n1,1,2\n"), RunOf("V"))[0];
  {
    Transaction transaction(store.database());
    store.database().Run("UPDATE chunk SET bytes = zeroblob(length(bytes))");
    transaction.Commit();
  }
  EXPECT_THAT(
      MessageOf<DataError>([&] { store.Load(id); }),
      AllOf(HasSubstr(file_.string()), HasSubstr(id), HasSubstr("CRC-32")));
}

TEST_F(RunsTest, PlantRecordReadsBackExactly) {
  const char* reference = std::getenv("FDI_REFERENCE_DATA");
  if (reference == nullptr) {
    GTEST_SKIP() << "set FDI_REFERENCE_DATA to the folder of reference data";
  }
  const auto csv = std::filesystem::path(reference) / "plant" /
                   "lublin_actuator3_2001-10-11_first40min.csv";
  const auto table = importer::ReadCsvFile(csv);
  RunStore store(file_, Access::kOccasionalWriter);
  const std::string id = store.Import(table.runs, RunOf("V"))[0];
  const StoredRun run = store.Load(id);
  ASSERT_EQ(run.samples.size(), table.runs.at(0).samples.size());
  for (std::size_t k = 0; k < run.samples.size(); ++k) {
    ASSERT_EQ(run.samples[k].sample.values,
              table.runs[0].samples[k].sample.values);
  }
  EXPECT_THAT(table.header.ignored_columns, SizeIs(4));
}

}  // namespace
}  // namespace fdi::storage
