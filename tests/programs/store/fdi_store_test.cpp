// Runs the built program: exit codes, messages, JSON keys, nothing stored.
#include <algorithm>
#include <cmath>
#include <iterator>

#include <gmock/gmock.h>

#include "diagnosis/model/fault_catalogue.h"
#include "storage/history/history_database.h"
#include "storage/models/models.h"
#include "storage/runs/runs.h"
#include "tests/programs/store/store_program_fixture.h"
#include "tests/storage/model_set_fixture.h"

namespace fdi::storage {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

TEST_F(FdiStoreTest, ImportedRunIsListedAndExportedAsItWas) {
  Write("a.csv", header_ + Rows(5));

  const json imported = StoreJson("runs import a.csv --valve LV-1");

  EXPECT_EQ(imported["samples"], 5);
  EXPECT_EQ(imported["flow_unit"], "t/h");
  EXPECT_EQ(imported["period_s"], 1.0);
  const std::string id = imported["run_id"];
  EXPECT_EQ(id.size(), 12U);
  const json listed = StoreJson("runs list");
  ASSERT_EQ(listed["runs"].size(), 1U);
  EXPECT_EQ(listed["runs"][0]["run_id"], id);
  EXPECT_EQ(Store("runs export " + id).out, header_ + Rows(5));
  EXPECT_EQ(Store("runs export " + id + "@1:3").out, header_ + Rows(2, 1));
}

// A valve of play 3 % in a flow loop whose set point steps; the loop's own
// words for its signals, and a stretch in manual.
std::string StickyLoop(double band) {
  std::string text = "Time,FIC7.OP,FIC7.PV,FIC7.SP,FIC7.MODE\n";
  double op = 50.0;
  double stem = 50.0;
  double flow = 50.0;
  double last = 0.0;
  for (int k = 0; k < 800; ++k) {
    const double sp = k / 120 % 2 == 0 ? 50.0 : 53.0;
    const double e = sp - flow;
    op += 0.5 * (e - last) + 0.1 * e;
    last = e;
    stem = std::clamp(stem, op - 0.5 * band, op + 0.5 * band);
    flow += 0.4 * (stem - flow) + 0.02 * std::sin(1e4 * k * k);
    text += std::to_string(10 * k) + ',' + std::to_string(op) + ',' +
            std::to_string(3.0 * flow) + ',' + std::to_string(3.0 * sp) +
            (k < 760 ? ",CAS\n" : ",MAN\n");
  }
  return text;
}

TEST_F(FdiStoreTest, AuditJudgesLoopsAndGoesOnAfterWhatItCannotRead) {
  Write("FIC7.csv", StickyLoop(3.0));
  Write("FIC8.csv", StickyLoop(0.0));
  Write("words.csv", "t_s,OP,PV,mode\n0,1,2,AUTO\n10,1,2,HAND\n");
  Write("no_pv.csv", "t_s,OP,remark\n0,1,2\n10,1,2\n");

  const json audit =
      StoreJson("audit FIC8.csv FIC7.csv words.csv no_pv.csv gone.csv");

  ASSERT_EQ(audit["windows"].size(), 2U);
  const json& sticky = audit["windows"][0];
  EXPECT_EQ(sticky["loop"], "FIC7");
  EXPECT_EQ(sticky["service"], "F");
  EXPECT_EQ(sticky["samples"], 760);
  EXPECT_EQ(sticky["verdict"], "stiction");
  EXPECT_EQ(sticky["certainty"], "sure");
  EXPECT_NEAR(sticky["band_pct"].get<double>(), 3.0, 1.0);
  EXPECT_EQ(audit["windows"][1]["verdict"], "undetermined");
  ASSERT_EQ(audit["skipped"].size(), 3U);
  EXPECT_THAT(audit["skipped"][0]["reason"], HasSubstr("\"HAND\" is none of"));
  EXPECT_THAT(audit["skipped"][1]["reason"], HasSubstr("try --pv COLUMN"));
  EXPECT_THAT(Store("audit").err, HasSubstr("nothing to read"));
}

// A file may have any name; its columns are tags.
TEST_F(FdiStoreTest, AuditTakesTheServiceFromTheTagOfOp) {
  std::string text = StickyLoop(0.0);
  for (std::size_t at; (at = text.find("FIC7")) != std::string::npos;) {
    text[at] = 'T';
  }
  Write("trend_1.csv", text);
  EXPECT_EQ(StoreJson("audit trend_1.csv")["windows"][0]["service"], "T");
}

// Verbs and options of earlier versions answer with what to do instead.
TEST_F(FdiStoreTest, RemovedVerbsAndOptionsNameWhatReplacesThem) {
  const std::vector<std::pair<std::string, std::string>> removed{
      {"audit --ps PS a.csv", "--ps is gone: stroke tests"},
      {"history shadow --from 1d", "shadow is gone: fdi-trainer compare"},
      {"audit --date m/d/y a.csv", "--date is gone: date = \"d/m/y\" under"},
      {"runs import a.csv --skip=3", "--skip is gone: skip = 3 under [file]"},
      {"runs sniff a.csv --decimal ,", "--decimal is gone: decimal = "},
      {"history shadow --help", "shadow is gone: fdi-trainer compare"},
      {"keys init keys --days 30", "keys is gone: the script fdi-keys"},
      {"prune --shadow-age 90d", "--shadow-age is gone: differences"}};
  for (const auto& [call, instead] : removed) {
    const Outcome outcome = Store(call);
    EXPECT_EQ(outcome.code, 2) << call;
    EXPECT_THAT(outcome.err, HasSubstr(instead));
  }
}

TEST_F(FdiStoreTest, AuditSaysWhatIsUnusualAndWhatToType) {
  Write("FIC7.csv", StickyLoop(3.0));
  EXPECT_TRUE(StoreJson("audit FIC7.csv")["windows"][0]["hint"].is_null());
  const json exchanged =
      StoreJson("audit FIC7.csv --op FIC7.PV --pv FIC7.OP")["windows"][0];
  EXPECT_EQ(exchanged["verdict"], "undetermined");
  EXPECT_THAT(exchanged["hint"], HasSubstr("try --op and --pv"));
  std::string minutes = "t_s,OP,PV\n";
  std::string constant = minutes;
  for (int k = 0; k < 100; ++k) {
    const std::string op = std::to_string(50.0 + 3.0 * std::sin(0.3 * k));
    minutes += std::to_string(60 * k) + ',' + op + ',' +
               std::to_string(40.0 + std::cos(0.3 * k)) + '\n';
    constant += std::to_string(k) + ',' + op + ",4\n";
  }
  Write("minutes.csv", minutes);
  Write("constant.csv", constant);
  const json windows = StoreJson("audit minutes.csv constant.csv")["windows"];
  ASSERT_EQ(windows.size(), 2U);
  EXPECT_EQ(windows[0]["verdict"], "no_response");
  EXPECT_THAT(windows[0]["hint"], HasSubstr("always 4.00; try --pv"));
  EXPECT_EQ(windows[1]["sample_period_s"], 60.0);
  EXPECT_THAT(windows[1]["hint"], HasSubstr("try --sp COLUMN"));
}

// Not m3/h: that would be stored without a word.
TEST_F(FdiStoreTest, SniffTakesTheUnitThatTheNameOfAColumnEndsWith) {
  Write("a.csv", header_ + Rows(30));

  const json sniffed = StoreJson("runs sniff a.csv -o tags.toml");

  EXPECT_THAT(header_, HasSubstr("F_t_h"));
  const json& columns = sniffed["columns"];
  const auto flow = std::ranges::find(columns, "F_t_h", [](const json& column) {
    return column["column"].get<std::string>();
  });
  ASSERT_NE(flow, columns.end());
  EXPECT_EQ((*flow)["unit"], "t/h");
}

TEST_F(FdiStoreTest, SniffDoesNotTakeSecondsForDaysOfASpreadsheet) {
  const std::string row = ",40.5,3500,2500,130,41,22\n";
  Write("t.csv", header_ + "30000.5" + row + "30001.5" + row + "30002.5" + row);
  Write("late.csv", "Time" + header_.substr(3) + "29999.5" + row + "30000" +
                        row + "30000.5" + row + "30001" + row);

  EXPECT_EQ(StoreJson("runs sniff t.csv")["period_s"], 1.0);
  // As in the importer, the first row decides for all.
  EXPECT_EQ(StoreJson("runs sniff late.csv")["period_s"], 0.5);
}

TEST_F(FdiStoreTest, TheMapOfSniffTakesNamesOfSeveralLines) {
  std::string rows;
  for (int i = 0; i < 30; ++i) {
    rows += std::to_string(i) + "," + std::to_string(20 + i % 7) + "," +
            std::to_string(50 - i % 7) + "\n";
  }
  Write("lines.csv", "t_s,CV_pct,\"Flow\n[m3/h]\"\n" + rows);

  StoreJson("runs sniff lines.csv -o lines.toml");
  const json imported = StoreJson(
      "runs import lines.csv --valve V1 --map lines.toml --signals CV,F");
  EXPECT_EQ(imported["samples"], 30);
}

TEST_F(FdiStoreTest, AFileThatIsImportedAgainIsSaidToBe) {
  Write("a.csv", header_ + Rows(5));
  const std::string import =
      "runs import a.csv --start 2026-11-20T00:00:00Z --valve ";
  EXPECT_THAT(Store(import + "LV-1").err, Not(HasSubstr("import_repeated")));
  EXPECT_THAT(Store(import + "LV-2").err, Not(HasSubstr("import_repeated")));
  const std::string first =
      StoreJson("runs list --valve LV-1")["runs"][0]["run_id"];

  const Outcome again = Store(import + "LV-1");
  EXPECT_EQ(again.code, 0);
  EXPECT_THAT(again.err, HasSubstr("same_as=" + first));
}

TEST_F(FdiStoreTest, AValveThatNoSampleCanHaveIsRefused) {
  Write("a.csv", header_ + Rows(5));
  for (const std::string& valve :
       {std::string("''"), std::string(65, 'V'), std::string("'V\n1'")}) {
    EXPECT_EQ(Store("runs import a.csv --valve " + valve).code, 2) << valve;
  }
}

TEST_F(FdiStoreTest, CsvWithoutAColumnIsRefusedAndNothingIsStored) {
  Write("a.csv", "t_s,CV_pct,P1_kPa,P2_kPa,T1_degC,F_t_h\n0,1,2,3,4,5\n");

  const Outcome outcome = Store("runs import a.csv --valve LV-1");

  EXPECT_EQ(outcome.code, 3);
  EXPECT_THAT(outcome.err, AllOf(HasSubstr("a.csv"), HasSubstr("X_pct")));
  EXPECT_FALSE(RunsAreStored());
}

TEST_F(FdiStoreTest, TextInANumberIsRefusedWithItsLine) {
  Write("a.csv", header_ + Rows(3) + "3,40.5,3500,x12,130,41,22\n");

  const Outcome outcome = Store("runs import a.csv --valve LV-1");

  EXPECT_EQ(outcome.code, 3);
  EXPECT_THAT(outcome.err, AllOf(HasSubstr("a.csv:5"), HasSubstr("P2_kPa")));
  EXPECT_FALSE(RunsAreStored());
}

TEST_F(FdiStoreTest, JumpInTimeIsRefusedUnlessGapsMaySplitTheRun) {
  Write("a.csv", header_ + Rows(5) + Rows(4, 10));

  const Outcome outcome = Store("runs import a.csv --valve LV-1");
  EXPECT_EQ(outcome.code, 3);
  EXPECT_THAT(outcome.err, HasSubstr("a.csv:7"));
  EXPECT_FALSE(RunsAreStored());

  const json split = StoreJson("runs import a.csv --valve LV-1 --split-gaps");
  ASSERT_EQ(split["runs"].size(), 2U);
  EXPECT_EQ(split["runs"][0]["samples"], 5);
  EXPECT_EQ(split["runs"][1]["samples"], 4);
  EXPECT_EQ(split["samples"], 9);
}

TEST_F(FdiStoreTest, EmptyFileIsRefused) {
  Write("empty.csv", "");
  Write("header.csv", header_);

  for (const char* file : {"empty.csv", "header.csv"}) {
    const Outcome outcome =
        Store("runs import " + std::string(file) + " --valve LV-1");
    EXPECT_EQ(outcome.code, 3);
    EXPECT_THAT(outcome.err, HasSubstr(file));
  }
  EXPECT_FALSE(RunsAreStored());
}

TEST_F(FdiStoreTest, MapGivesForeignColumnsTheirSignalUnitAndSense) {
  Write("foreign.csv",
        "ms,MV,PI1,PI2,TI,ZI,FI\n0,59.5,35,26,403.15,0.59,6\n"
        "1000,59.5,35,26,403.15,0.59,6\n");
  Write("tags.toml",
        "[time]\ncolumn = \"ms\"\nunit = \"ms\"\n"
        "[signal.CV]\ncolumn = \"MV\"\nsense = \"opening\"\n"
        "[signal.P1]\ncolumn = \"PI1\"\nunit = \"bar\"\n"
        "[signal.P2]\ncolumn = \"PI2\"\nunit = \"bar\"\n"
        "[signal.T1]\ncolumn = \"TI\"\nunit = \"K\"\n"
        "[signal.X]\ncolumn = \"ZI\"\nunit = \"1\"\nsense = \"opening\"\n"
        "[signal.F]\ncolumn = \"FI\"\nunit = \"kg/s\"\nscale = 2\n");

  const json run =
      StoreJson("runs import foreign.csv --valve V --map tags.toml");

  const std::string id = run["run_id"];
  EXPECT_EQ(run["flow_unit"], "t/h");
  std::istringstream lines(Store("runs export " + id).out);
  std::string header;
  std::string row;
  std::getline(lines, header);
  std::getline(lines, row);
  std::replace(row.begin(), row.end(), ',', ' ');
  std::istringstream cells(row);
  std::vector<double> values((std::istream_iterator<double>(cells)), {});
  using testing::DoubleNear;
  EXPECT_THAT(values,
              ElementsAre(0.0, DoubleNear(40.5, 1e-9), DoubleNear(3500, 1e-9),
                          DoubleNear(2600, 1e-9), DoubleNear(130, 1e-9),
                          DoubleNear(41, 1e-9), DoubleNear(43.2, 1e-9)));
}

TEST_F(FdiStoreTest, UnknownKeyOrUnitInAMapIsAConfigurationError) {
  Write("a.csv", header_ + Rows(5));
  Write("key.toml", "[signal.CV]\ncolumn = \"CV_pct\"\nscal = 2.0\n");
  Write("unit.toml", "[signal.P1]\ncolumn = \"P1_kPa\"\nunit = \"atm\"\n");

  const Outcome key = Store("runs import a.csv --valve V --map key.toml");
  const Outcome unit = Store("runs import a.csv --valve V --map unit.toml");

  EXPECT_EQ(key.code, 2);
  EXPECT_THAT(key.err, HasSubstr("key.toml:3: unknown key 'scal'"));
  EXPECT_EQ(unit.code, 2);
  EXPECT_THAT(unit.err, AllOf(HasSubstr("atm"), HasSubstr("kPa Pa mbar bar")));
  EXPECT_FALSE(RunsAreStored());
}

TEST_F(FdiStoreTest, UsageErrorsExitWithTwo) {
  EXPECT_EQ(Store("runs list --no-such-option").code, 2);
  EXPECT_EQ(Store("runs").code, 2);
  EXPECT_EQ(Store("history lsit").code, 2);
  EXPECT_EQ(Store("runs import a.csv").code, 2);  // --valve is missing.
  EXPECT_EQ(Store("runs list --from yesterday").code, 2);
  Write("bad.toml", "domian = 3\n");
  const Outcome outcome = Store("runs list --config bad.toml");
  EXPECT_EQ(outcome.code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("unknown key 'domian'"));
}

TEST_F(FdiStoreTest, WhatIsNotThereExitsWithFive) {
  Write("a.csv", header_ + Rows(5));
  Store("runs import a.csv --valve LV-1");
  Store("valves add LV-1");
  { HistoryWriter writer(path_); }

  EXPECT_EQ(Store("runs show 0123456789ab").code, 5);
  EXPECT_EQ(Store("runs import no.csv --valve LV-1").code, 5);
  EXPECT_EQ(Store("models show nothing").code, 5);
  EXPECT_EQ(Store("models activate nothing@1").code, 5);
  EXPECT_EQ(Store("valves show PV-9").code, 5);
  EXPECT_EQ(Store("valves assign LV-1 nothing").code, 5);
  EXPECT_EQ(Store("history show 0123456789abcdef").code, 5);
  EXPECT_EQ(Store("history ack last").code, 5);
}

TEST_F(FdiStoreTest, DataDirectoryThatIsAFileExitsWithThree) {
  Write("a.csv", header_ + Rows(5));
  Write("file", "");

  const Outcome outcome = Store("runs import a.csv --valve V --data ./file");

  EXPECT_EQ(outcome.code, 3);
  EXPECT_THAT(outcome.err, HasSubstr("file"));
}

TEST_F(FdiStoreTest, DatabaseOfANewerVersionIsRefusedWithBothVersions) {
  Schema newer = RunsSchema();
  const int version = newer.version();
  newer.migrations.push_back("CREATE TABLE later (x INTEGER) STRICT;");
  { Database(directory_.path() / "runs.db", newer, Access::kWriter); }

  const Outcome outcome = Store("runs list");

  EXPECT_EQ(outcome.code, 3);
  EXPECT_THAT(outcome.err,
              AllOf(HasSubstr("version " + std::to_string(version + 1)),
                    HasSubstr("up to " + std::to_string(version))));
}

TEST_F(FdiStoreTest, DatabasesThatWereNeverReleasedAreRefusedInOneSentence) {
  const std::pair<Schema, const char*> files[] = {
      {RunsSchema(), "runs.db"},
      {ModelsSchema(), "models.db"},
      {HistorySchema(), "history.db"}};
  for (auto [schema, name] : files) {
    schema.migrations = {"CREATE TABLE t (x INTEGER) STRICT;"};
    --schema.baseline;
    { Database(directory_.path() / name, schema, Access::kWriter); }
  }
  const auto refusal = [this](const std::string& command) {
    const Outcome outcome = Store(command);
    EXPECT_EQ(outcome.code, 3) << command;
    EXPECT_EQ(std::ranges::count(outcome.err, '\n'), 1) << outcome.err;
    return outcome.err;
  };
  EXPECT_THAT(refusal("runs list"), HasSubstr("`fdi-store runs import`"));
  EXPECT_THAT(refusal("models list"), HasSubstr("`fdi-trainer onboard`"));
  EXPECT_THAT(refusal("history list"), HasSubstr("start without its episodes"));
}

TEST_F(FdiStoreTest, DoctorBringsDatabasesUpToDate) {
  Schema baseline = HistorySchema();
  baseline.migrations.resize(1);
  { Database(directory_.path() / "history.db", baseline, Access::kWriter); }
  Write("runs.db", "");  // Its first writer was killed.
  for (const char* command : {"history list", "runs list"}) {
    const Outcome outcome = Store(command);
    EXPECT_EQ(outcome.code, 3);
    EXPECT_THAT(outcome.err, HasSubstr("`fdi-store doctor`"));
  }
  EXPECT_EQ(Store("doctor").code, 0);
  EXPECT_EQ(Store("history list").code, 0);
  EXPECT_EQ(Store("runs list").code, 0);

  const Outcome gone = Store("migrate");
  EXPECT_EQ(gone.code, 2);
  EXPECT_THAT(gone.err, HasSubstr("migrate is gone: fdi-store doctor"));
}

TEST_F(FdiStoreTest, LabelsAreShownAndRemoved) {
  Write("a.csv", header_ + Rows(5));
  const std::string id =
      StoreJson("runs import a.csv --valve V --assume-normal")["run_id"];
  EXPECT_EQ(Store("runs label " + id + "@2:4 F7 --strength 0.5").code, 0);

  const json labels = StoreJson("runs show " + id)["labels"];
  ASSERT_EQ(labels.size(), 2U);
  EXPECT_EQ(labels[0]["fault"], "normal");
  EXPECT_EQ(labels[1]["fault"], "f7");
  EXPECT_EQ(labels[1]["from_s"], 2.0);

  EXPECT_EQ(Store("runs label " + id + " --remove").code, 0);
  EXPECT_THAT(StoreJson("runs show " + id)["labels"], IsEmpty());
  EXPECT_EQ(Store("runs delete " + id + "@0:2").code, 2);
  EXPECT_EQ(StoreJson("runs list")["runs"].size(), 1U);
  EXPECT_EQ(Store("runs delete " + id).code, 0);
  EXPECT_THAT(StoreJson("runs list")["runs"], IsEmpty());
}

TEST_F(FdiStoreTest, BuiltInTypesNeedNoData) {
  EXPECT_THAT(Store("types show gas-globe").out, HasSubstr("built in: gas"));
}

TEST_F(FdiStoreTest, ValvesAreDescribedAndTheirEpochCounts) {
  EXPECT_EQ(Store("valves add 'LV-*' --flow-unit t/h --sense opening").code, 0);
  EXPECT_EQ(Store("valves repaired 'LV-*' replaced --comment 'DN80 now' "
                  "--at 2026-01-02T03:04:05Z --by me")
                .code,
            0);
  EXPECT_EQ(Store("valves repaired 'LV-*'").code, 2);
  EXPECT_EQ(Store("valves repaired 'LV-*' painted").code, 2);
  // The work restores the valve of which the models were made: names stay.
  EXPECT_EQ(Store("valves repaired 'LV-*' repacked").code, 0);
  EXPECT_THAT(Store("--utc valves repaired 'LV-*' ordered --order 4711 "
                    "--expected 2026-12-03T06:00:00Z")
                  .out,
              HasSubstr("in work, order 4711, expected back 2026-12-03"));
  EXPECT_THAT(Store("valves repaired 'LV-*' repacked --order 4711").err,
              HasSubstr("are of `ordered`"));
  // A valve of the default set has no entry.
  EXPECT_THAT(Store("valves repaired OTHER recalibrated").out,
              HasSubstr("OTHER: recalibrated is noted"));

  const json valve = StoreJson("valves show LV-7");

  EXPECT_EQ(valve["valve"], "LV-*");
  EXPECT_EQ(valve["flow_unit"], "t/h");
  EXPECT_EQ(valve["sense"], "opening");
  EXPECT_EQ(valve["epoch"], 1);
  EXPECT_EQ(valve["baseline"], "provisional");
  EXPECT_TRUE(valve["diagnosed_with"].is_null());
  ASSERT_EQ(valve["events"].size(), 3U);
  EXPECT_EQ(valve["events"][1]["kind"], "repacked");
  EXPECT_EQ(valve["events"][1]["epoch"], 1);
  EXPECT_EQ(valve["events"][0]["kind"], "replaced");
  EXPECT_EQ(valve["events"][0]["at_utc"], "2026-01-02T03:04:05Z");
}

TEST_F(FdiStoreTest, BaselinesOfEpochsAreShownSideBySide) {
  {
    ModelStore models(directory_.path() / "models.db",
                      Access::kOccasionalWriter);
    models.Save(RandomModelSet("pump", 3, 1));
    BaselineRecord record{0,   "pump",           1,
                          1.5, {{"kv", 118.25}}, {{"X", 0.25, 0.001, 99.5}}};
    models.SetBaseline("LV-1", record);
    models.AddValveEvent("LV-1", {});
    record.epoch = 1;
    record.parameters = {{"kv", 131.5}, {"play", 0.02}, {"air", 2.498e-6}};
    models.SetBaseline("LV-1", record);
    models.SaveTemplate("globe", std::vector<std::byte>(7), "19 faults");
  }
  const std::string shown = Store("valves show LV-1").out;
  EXPECT_THAT(shown, AllOf(HasSubstr("epoch 0: pump@1"),
                           HasSubstr("epoch 1: pump@1"), HasSubstr("valid"),
                           testing::ContainsRegex("kv +118.25[0-9]* +131.5"),
                           testing::ContainsRegex("play +- +0.02"),
                           testing::ContainsRegex("air +- +2.498e-06")));
  const json valve = StoreJson("valves show LV-1");
  EXPECT_EQ(valve["baselines"][1]["parameters"]["kv"], 131.5);
  EXPECT_EQ(valve["baselines"][0]["channels"][0]["vaf"], 99.5);

  EXPECT_EQ(StoreJson("types list")["types"][0]["name"], "globe");
  EXPECT_EQ(StoreJson("types show globe")["bytes"], 7);
}

// T1 of a water loop is one number all day: a variance of nothing but rounding.
TEST_F(FdiStoreTest, OutputThatStoodStillHasNoVaf) {
  {
    ModelSet models = RandomModelSet("still", 2, 1);
    models.observers[0].channels[1].validation.vaf = -1.3e29;
    ModelStore(directory_.path() / "models.db", Access::kOccasionalWriter)
        .Save(models);
  }

  EXPECT_TRUE(
      StoreJson("models list")["model_sets"][0]["lowest_vaf"].is_null());
  EXPECT_THAT(Store("models list").out,
              testing::Not(HasSubstr("0000000000000000000")));
  EXPECT_THAT(Store("models show still").out,
              HasSubstr("fdi-trainer show still@1"));
}

TEST_F(FdiStoreTest, WhatTakesOutputTakesMinusO) {
  Write("a.csv", header_ + Rows(5));
  const std::string id = StoreJson("runs import a.csv --valve LV-1")["run_id"];
  ModelStore(directory_.path() / "models.db", Access::kOccasionalWriter)
      .Save(RandomModelSet("pump", 2, 1));
  { HistoryWriter writer(path_); }

  EXPECT_EQ(Store("runs export " + id + " -o run.csv").code, 0);
  EXPECT_EQ(Slurp(directory_.path() / "run.csv"), header_ + Rows(5));
  EXPECT_EQ(Store("models export pump -o pump.fdm").code, 0);
  EXPECT_EQ(Store("models import pump.fdm").code, 0);
  EXPECT_EQ(Store("history list --csv").code, 0);
}

TEST_F(FdiStoreTest, CatalogueIsListedAndOverridden) {
  EXPECT_EQ(StoreJson("faults")["faults"].size(),
            kFaultsAndFindings.size() + 1);  // And unknown.
  EXPECT_EQ(StoreJson("faults f4")["faults"][0]["strength_min"], -1.0);
  EXPECT_THAT(Store("faults f19").out, HasSubstr("flow reading x 0"));
  Write("faults.toml", "[f9]\nname = 'West header leaks'\n");
  EXPECT_EQ(StoreJson("faults f9")["faults"][0]["name"], "West header leaks");
  Write("faults.toml", "[f9]\nnane = 'x'\n");
  const Outcome outcome = Store("faults");
  EXPECT_EQ(outcome.code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("did you mean 'name'"));
}

}  // namespace
}  // namespace fdi::storage
