#include "storage/models/models.h"

#include <cmath>
#include <fstream>
#include <set>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "storage/models/model_codec.h"
#include "storage/models/repairs.h"
#include "tests/storage/message_of.h"
#include "tests/storage/model_set_fixture.h"
#include "tests/storage/temporary_directory.h"

namespace fdi::storage {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class ModelsTest : public ::testing::Test {
 protected:
  ValveEntry Entry(const std::string& pattern, const std::string& set = "") {
    ValveEntry entry;
    entry.pattern = pattern;
    if (!set.empty()) {
      entry.model_set = ParseModelReference(set);
    }
    return entry;
  }
  std::string Assigned(const std::string& valve) {
    const auto reference = store_.AssignedModelSet(valve);
    return reference ? ToString(*reference) : "UNASSIGNED";
  }

  TemporaryDirectory directory_;
  std::filesystem::path file_{directory_.path() / "models.db"};
  ModelStore store_{file_, Access::kOccasionalWriter};
};

TEST_F(ModelsTest, SavedSetsGetVersionsAndReadBackBitForBit) {
  const ModelSet first = store_.Save(RandomModelSet("pump", 3, 1));
  const ModelSet second = store_.Save(RandomModelSet("pump", 3, 2));

  EXPECT_EQ(first.version, 1);
  EXPECT_EQ(second.version, 2);
  EXPECT_NE(first.content_hash, second.content_hash);
  EXPECT_EQ(first.content_hash, ContentHash(first));
  const ModelSet back = store_.Load("pump@2");
  EXPECT_EQ(back.version, 2);
  EXPECT_EQ(back.content_hash, second.content_hash);
  EXPECT_EQ(EncodeModelSet(back), EncodeModelSet(RandomModelSet("pump", 3, 2)));
}

TEST_F(ModelsTest, OneVersionOfANameIsActive) {
  store_.Save(RandomModelSet("a"));
  store_.Save(RandomModelSet("a"));
  store_.Save(RandomModelSet("b"));
  EXPECT_EQ(store_.Load("a").version, 1);

  store_.Activate(ParseModelReference("a@2"));
  EXPECT_EQ(store_.Load("a").version, 2);
  store_.Save(RandomModelSet("a"), Activation::kAlways);
  EXPECT_EQ(store_.Load("a").version, 3);
  store_.Activate(ParseModelReference("a@1"));
  store_.Activate(ParseModelReference("a"));  // the newest
  EXPECT_EQ(store_.Load("a").version, 3);
  EXPECT_EQ(store_.Load("b").version, 1);
}

TEST_F(ModelsTest, UnknownSetsAreNotFoundAndTheStoredOnesNamed) {
  EXPECT_THAT(MessageOf<NotFoundError>([&] { store_.Load("x"); }),
              HasSubstr("stored: none"));
  store_.Save(RandomModelSet("a"));
  for (const std::string text : {"x", "a@2"}) {
    EXPECT_THAT(MessageOf<NotFoundError>([&] { store_.Load(text); }),
                AllOf(HasSubstr("no model set " + text), HasSubstr("a@1")));
  }
  EXPECT_THROW(store_.Activate({"a", 2}), NotFoundError);
  for (const std::string text :
       {"", "@1", "a@", "a@0", "a@x", "a b", "a@1@2"}) {
    EXPECT_THROW(store_.Load(text), ConfigError) << text;
  }
}

TEST_F(ModelsTest, TwoTrainersGetVersionsOfTheirOwn) {
  const auto save_five = [this](unsigned seed) {
    ModelStore store(file_, Access::kOccasionalWriter);
    for (unsigned i = 0; i < 5; ++i) {
      store.Save(RandomModelSet("pump", 3, seed + i));
    }
  };
  std::thread other(save_five, 10U);
  save_five(20);
  other.join();

  std::set<int> versions;
  for (const ModelSummary& summary : store_.List()) {
    versions.insert(summary.version);
  }
  EXPECT_THAT(versions, ElementsAre(1, 2, 3, 4, 5, 6, 7, 8, 9, 10));
}

TEST_F(ModelsTest, AnUnusableSetIsNotStored) {
  ModelSet models = RandomModelSet("a");
  models.observers[0].channels.clear();
  EXPECT_THROW(store_.Save(models), DataError);
  EXPECT_THROW(store_.Save(RandomModelSet("a@2")), ConfigError);
  EXPECT_THAT(store_.List(), IsEmpty());
}

TEST_F(ModelsTest, SummaryViewAndTablesTellWhatIsInTheSet) {
  ModelSet models = RandomModelSet("pump");
  models.observers[1].channels[1].validation = {9.5, 12.25, -3.5, 100};
  models.observers[2].channels[0].validation.vaf =
      std::numeric_limits<double>::quiet_NaN();
  const ModelSet saved = store_.Save(models);

  Database database(file_, ModelsSchema(), Access::kReader);
  Statement row = database.Prepare(
      "SELECT model_set, version, created_utc, content_hash, observers,"
      " training_runs, lowest_vaf, greatest_mse, greatest_bias, active"
      " FROM model_summary");
  ASSERT_TRUE(row.Step());
  EXPECT_EQ(row.Text(0), "pump");
  EXPECT_EQ(row.Int(1), 1);
  EXPECT_EQ(row.Text(2), "2023-11-14T22:13:20.250Z");
  EXPECT_EQ(std::stoull(row.Text(3), nullptr, 16), saved.content_hash);
  EXPECT_EQ(row.Int(4), 3);
  EXPECT_EQ(row.Text(5), "0123456789ab,ba9876543210@0:1500");
  EXPECT_LE(row.Double(6), 12.25);
  EXPECT_EQ(row.Double(7), 9.5);
  EXPECT_EQ(row.Double(8), 3.5);
  EXPECT_EQ(row.Int(9), 1);
  Statement channel = database.Prepare(
      "SELECT regressors, rules, mse FROM channel"
      " WHERE observer = 1 AND name = 'F'");
  ASSERT_TRUE(channel.Step());
  EXPECT_EQ(channel.Text(0), "CV(k) F(k-1)");
  EXPECT_EQ(channel.Int(1), 2);
  EXPECT_EQ(channel.Double(2), 9.5);
  const ModelSummary summary = store_.List().at(0);
  EXPECT_EQ(summary.training_runs, 2);
  EXPECT_EQ(summary.content_hash, saved.content_hash);
  EXPECT_EQ(summary.flow_unit, FlowUnit::kTPerHour);
  EXPECT_EQ(store_.Summary({"pump", 1}).greatest_bias, 3.5);
}

TEST_F(ModelsTest, DamagedBytesAreReportedWithTheirPlace) {
  store_.Save(RandomModelSet("pump"));
  const auto corrupt = [&](const std::string& sql) {
    Transaction transaction(store_.database());
    store_.database().Run(sql);
    transaction.Commit();
  };
  corrupt("UPDATE model_set SET bytes = substr(bytes, 1, 100)");
  EXPECT_THAT(MessageOf<DataError>([&] { store_.Load("pump"); }),
              AllOf(HasSubstr(file_.string()), HasSubstr("pump@1"),
                    HasSubstr("damaged")));
  store_.Save(RandomModelSet("other"));
  corrupt("UPDATE model_set SET content_hash = '0123456789abcdef'");
  EXPECT_THAT(MessageOf<DataError>([&] { store_.Load("other"); }),
              HasSubstr("content hash differs"));
}

TEST_F(ModelsTest, AFaultThatIsNotKnownIsNotTakenForNormalOperation) {
  Lineage lineage;
  lineage.episodes = {
      {"00c0ffee12345678", "LV-1", "f1", "anna", 2, 1, 0.5, "0123456789ab", 9},
      {"00c0ffee12345679", "LV-1", "false", "anna", 2, 0, 0.0, "", 9}};
  store_.Save(RandomModelSet("pump"), Activation::kAlways, lineage);
  EXPECT_EQ(store_.LineageOf({"pump", 1}).episodes, lineage.episodes);

  Transaction transaction(store_.database());
  store_.database().Run(
      "UPDATE training_episode SET fault = 'f99' WHERE fault = 'f1'");
  transaction.Commit();

  EXPECT_THAT(MessageOf<DataError>([&] {
                store_.LineageOf({"pump", 1});
              }),
              AllOf(HasSubstr("00c0ffee12345678"),
                    HasSubstr("no fault is called f99")));
}

TEST_F(ModelsTest, AnExportedFileImportsElsewhereWithTheSameHash) {
  const ModelSet saved = store_.Save(RandomModelSet("pump"));
  const auto path = directory_.path() / "pump.fdimodel";
  store_.ExportFile({"pump", 1}, path);
  EXPECT_THROW(store_.ExportFile({"pump", 1}, path), DataError);

  ModelStore other(directory_.path() / "other.db", Access::kOccasionalWriter);
  const ModelSet imported = other.ImportFile(path);
  EXPECT_EQ(imported.content_hash, saved.content_hash);
  EXPECT_EQ(store_.ImportFile(path).version, 2);

  std::ofstream(path, std::ios::app) << "x";
  EXPECT_THAT(MessageOf<DataError>([&] { other.ImportFile(path); }),
              AllOf(HasSubstr(path.string()), HasSubstr("CRC-32")));
  EXPECT_THAT(
      MessageOf<DataError>([&] { other.ImportFile(path.string() + "x"); }),
      HasSubstr("No such file"));
}

TEST_F(ModelsTest, TheFirstMatchingEntryAssignsTheModelSet) {
  store_.Save(RandomModelSet("pump"));
  store_.Save(RandomModelSet("pump"));
  store_.Save(RandomModelSet("boiler"));
  store_.Save(RandomModelSet("FV-900"));
  store_.PutValve(Entry("FV-101", "pump@2"));
  store_.PutValve(Entry("FV-10?", "pump"));
  store_.PutValve(Entry("FV-2*"));  // known, but not assigned here
  store_.PutValve(Entry("FV-[12]*", "boiler"));

  EXPECT_EQ(Assigned("FV-101"), "pump@2");
  EXPECT_EQ(Assigned("FV-102"), "pump@1");
  store_.Activate({"pump", 2});
  EXPECT_EQ(Assigned("FV-102"), "pump@2");
  EXPECT_EQ(Assigned("FV-199"), "boiler@1");
  EXPECT_EQ(Assigned("FV-201"), "boiler@1");
  EXPECT_EQ(Assigned("FV-900"), "FV-900@1");  // the set of that name
  EXPECT_EQ(Assigned("FV-300"), "UNASSIGNED");
  EXPECT_EQ(store_.FindValve("FV-201")->pattern, "FV-2*");
  EXPECT_FALSE(store_.FindValve("FV-300"));
}

TEST_F(ModelsTest, ValveEntriesReadBackAndKeepTheirPlaceWhenReplaced) {
  store_.Save(RandomModelSet("pump"));
  ValveEntry entry = Entry("FV-1", "pump@1");
  entry.type = "globe DN100";
  entry.flow_unit = FlowUnit::kTPerHour;
  entry.sense = Sense::kOpening;
  entry.signals = MaskOf(Signal::kCv) | MaskOf(Signal::kX);
  entry.period_s = 0.5;
  entry.epoch = 4'000'000'000;
  store_.PutValve(entry);
  store_.PutValve(Entry("*"));
  entry.type = "changed";
  store_.PutValve(entry);

  const auto entries = store_.Valves();
  ASSERT_EQ(entries.size(), 2U);
  EXPECT_EQ(entries[0].pattern, "FV-1");
  EXPECT_EQ(entries[0].type, "changed");
  EXPECT_EQ(entries[0].flow_unit, FlowUnit::kTPerHour);
  EXPECT_EQ(entries[0].sense, Sense::kOpening);
  EXPECT_EQ(entries[0].signals, entry.signals);
  EXPECT_EQ(entries[0].period_s, 0.5);
  EXPECT_EQ(entries[0].epoch, 4'000'000'000);
  EXPECT_EQ(entries[0].model_set, (ModelReference{"pump", 1}));
  store_.RemoveValve("FV-1");
  EXPECT_EQ(store_.Valves().size(), 1U);
  EXPECT_THROW(store_.RemoveValve("FV-1"), NotFoundError);
}

TEST_F(ModelsTest, AssigningAddsOrChangesTheEntry) {
  store_.Save(RandomModelSet("pump"));
  EXPECT_THROW(store_.AssignModelSet("FV-1", ModelReference{"none", {}}),
               NotFoundError);
  EXPECT_THAT(store_.Valves(), IsEmpty());

  store_.AssignModelSet("FV-1", ModelReference{"pump", {}});
  EXPECT_EQ(Assigned("FV-1"), "pump@1");
  EXPECT_EQ(store_.Valves().at(0).flow_unit, FlowUnit::kTPerHour);
  store_.AssignModelSet("FV-1", std::nullopt);
  EXPECT_EQ(Assigned("FV-1"), "UNASSIGNED");
  EXPECT_EQ(store_.Valves().size(), 1U);
}

TEST_F(ModelsTest, ChangeCounterTellsOfActivationsAndAssignmentsOnly) {
  store_.Save(RandomModelSet("pump"));
  ChangeCounter counter(file_);
  EXPECT_FALSE(counter.Changed());

  store_.Save(RandomModelSet("pump"));  // not active: nothing to reload
  EXPECT_FALSE(counter.Changed());
  store_.Activate({"pump", 2});
  EXPECT_TRUE(counter.Changed());
  EXPECT_FALSE(counter.Changed());
  store_.Save(RandomModelSet("pump"));
  EXPECT_FALSE(counter.Changed());
  store_.AssignModelSet("FV-1", ModelReference{"pump", {}});
  EXPECT_TRUE(counter.Changed());
}

// A stored set is in the log as long as the service looks for changes.
TEST_F(ModelsTest, WhatWasStoredStaysIfItsLogIsDeleted) {
  const auto file = file_.parent_path() / "other.db";
  { ModelStore(file, Access::kOccasionalWriter); }
  ChangeCounter counter(file);
  ModelStore(file, Access::kOccasionalWriter)
      .Save(RandomModelSet("pump"), Activation::kAlways);
  for (const char* suffix : {"-wal", "-shm"}) {
    ASSERT_TRUE(std::filesystem::remove(file.string() + suffix)) << suffix;
  }
  ModelStore(file, Access::kOccasionalWriter)
      .Save(RandomModelSet("valve"), Activation::kAlways);
  EXPECT_TRUE(counter.Changed());
  EXPECT_EQ(ModelStore(file).List().size(), 2U);
}

TEST_F(ModelsTest, AnEventMakesTheBaselineProvisionalUntilTheNextOnboarding) {
  store_.Save(RandomModelSet("pump", 3, 1));
  store_.Save(RandomModelSet("pump", 3, 2));
  BaselineRecord found;
  found.model_set = "pump";
  found.version = 1;
  found.hours = 1.5;
  found.parameters = {{"kv", 118.25}, {"a \"b\"", -1e-9}};
  found.channels = {{"X", 0.25, -0.001, 99.5}, {"F|X", 1.0, 0.5, std::nan("")}};
  store_.SetBaseline("V1", found);
  EXPECT_EQ(Assigned("V1"), "pump@1");
  EXPECT_EQ(store_.FindValve("V1")->baseline(), BaselineState::kValid);

  const auto generation = store_.Generation();
  for (const ValveEventKind kind :
       {ValveEventKind::kRepacked, ValveEventKind::kRecalibrated}) {
    EXPECT_EQ(store_.AddValveEvent("V1", {0, kind, "", 4, "me"})->epoch, 0U);
    EXPECT_EQ(store_.FindValve("V1")->baseline(), BaselineState::kValid);
  }
  const auto after = store_.AddValveEvent(
      "V1", {0, ValveEventKind::kReplaced, "new trim", 5, "me"});
  EXPECT_EQ(after->epoch, 1U);
  EXPECT_GT(store_.Generation(), generation);
  EXPECT_EQ(Assigned("V1"), "pump@1");
  EXPECT_EQ(store_.FindValve("V1")->baseline(), BaselineState::kProvisional);
  EXPECT_THROW(store_.SetBaseline("V1", found), ConfigError);  // Epoch 0.

  BaselineRecord left = found;
  left.epoch = 1;
  left.version = 2;
  store_.SetBaseline("V1", left);
  EXPECT_EQ(store_.FindValve("V1")->baseline(), BaselineState::kValid);
  const auto baselines = store_.Baselines("V1");
  ASSERT_EQ(baselines.size(), 2U);
  EXPECT_EQ(baselines[0].epoch, 0U);
  EXPECT_EQ(baselines[0].parameters, found.parameters);
  EXPECT_EQ(baselines[0].channels[0].rmse, 0.25);
  EXPECT_EQ(baselines[0].channels[1].name, "F|X");
  EXPECT_TRUE(std::isnan(baselines[0].channels[1].vaf));
  EXPECT_EQ(baselines[1].version, 2);
  const auto events = store_.ValveEvents("V1");
  ASSERT_EQ(events.size(), 3U);
  EXPECT_EQ(events[2].epoch, 1U);
  EXPECT_EQ(events[2].kind, ValveEventKind::kReplaced);
  EXPECT_EQ(events[2].note, "new trim");
}

TEST_F(ModelsTest, ASetThatTheUserAssignsHasNoBaseline) {
  store_.Save(RandomModelSet("pump", 3, 1));
  store_.Save(RandomModelSet("pump", 3, 2));
  store_.AssignModelSet("V1", ParseModelReference("pump@1"));
  EXPECT_EQ(store_.FindValve("V1")->baseline(), BaselineState::kNone);
  store_.AddValveEvent("V1", {});
  EXPECT_EQ(store_.FindValve("V1")->baseline(), BaselineState::kProvisional);
  store_.AssignModelSet("V1", ParseModelReference("pump@1"));  // The same one.
  EXPECT_EQ(store_.FindValve("V1")->baseline(), BaselineState::kProvisional);
  store_.AssignModelSet("V1", ParseModelReference("pump@2"));
  EXPECT_EQ(store_.FindValve("V1")->baseline(), BaselineState::kNone);
  EXPECT_FALSE(store_.AddValveEvent("V2", {.at_ns = 7}));
  ASSERT_EQ(store_.Repairs().size(), 2U);
  EXPECT_EQ(store_.Repairs()[1].first, "V2");
  EXPECT_EQ(store_.Repairs()[1].second.at_ns, 7);
  EXPECT_FALSE(store_.FindValve("V2"));
  store_.AddValveEvent("V*", {.at_ns = 9});
  EXPECT_EQ(RepairsOf(store_, "V2").size(), 2U);
  EXPECT_EQ(RepairsOf(store_, "W").size(), 0U);
}

TEST_F(ModelsTest, ValveTypesKeepTheirBytes) {
  const std::vector<std::byte> bytes{std::byte{0}, std::byte{255}};
  store_.SaveTemplate("globe", std::vector<std::byte>(9), "old");
  store_.SaveTemplate("globe", bytes, "DN100, 19 faults");
  EXPECT_EQ(store_.LoadTemplate("globe").bytes, bytes);
  const auto list = store_.ListTemplates();
  ASSERT_EQ(list.size(), 1U);
  EXPECT_EQ(list[0].summary, "DN100, 19 faults");
  EXPECT_EQ(list[0].size, 2U);
  EXPECT_TRUE(list[0].bytes.empty());
  EXPECT_THAT(
      MessageOf<NotFoundError>([&] { store_.LoadTemplate("butterfly"); }),
      HasSubstr("there are globe"));
  EXPECT_THROW(store_.SaveTemplate("a@1", bytes, ""), ConfigError);
}

}  // namespace
}  // namespace fdi::storage
