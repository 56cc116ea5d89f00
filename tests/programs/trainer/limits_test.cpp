// Runs the built program on a plant whose residuals are noise of known size:
// limits become closer with hours, and wider after alarms that were false.
#include "trainer/learning/limits.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <gmock/gmock.h>

#include "base/error.h"
#include "base/time_units.h"
#include "storage/history/history_editor.h"
#include "storage/history/history_reader.h"
#include "storage/models/model_codec.h"
#include "storage/models/models.h"
#include "storage/runs/run_recorder.h"
#include "storage/runs/runs.h"
#include "tests/diagnosis/linear_plant.h"
#include "tests/programs/trainer/fixture.h"
#include "tests/trainer/recorded_episodes.h"
#include "trainer/evaluation.h"

namespace fdi::trainer {
namespace {

using nlohmann::json;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::SizeIs;

constexpr std::int64_t kMadeNs = 1'700'000'000 * kNsPerSecond;
constexpr int kTwoHours = 7200;
constexpr int kDay = 86400;
// Beyond the limits on means of windows, within the thresholds.
constexpr double kBias = 1.1;

using Change = std::function<void(std::size_t k, Sample& sample)>;

// `seconds` of the plant in AUTO, its noise by `seed`.
storage::StoredRun PlantRun(int seconds, std::uint64_t seed,
                            std::int64_t start_ns, const Change& change = {}) {
  storage::StoredRun run;
  run.info.id = "run";
  run.info.run.valve_id = "LV1";
  run.info.run.source_id = 7;
  run.info.run.start_ns = start_ns;
  fdi::tests::Noise noise(seed);
  for (int k = 0; k < seconds; ++k) {
    const auto at = static_cast<std::size_t>(k);
    Sample sample = fdi::tests::PlantSample(at);
    sample.stamp_ns += start_ns;
    noise.Add(sample);
    if (change) {
      change(at, sample);
    }
    run.info.signals = sample.present;
    run.samples.emplace_back().sample = sample;
  }
  return run;
}

// F is off by kBias for 20 minutes of an hour.
void Shift(std::size_t k, Sample& sample) {
  if (k >= 1800 && k < 3000) {
    sample.values[Index(Signal::kF)] += kBias;
  }
}

ModelSet WithLimitsOf(const ModelSet& models, const storage::StoredRun& run) {
  HealthyResiduals data;
  AddResiduals(std::make_shared<const ModelSet>(models), run, data);
  return SetLimits(models, data).models;
}

// As onboarding makes it of two hours.
ModelSet TwoHourSet() {
  ModelSet models = fdi::tests::LinearPlant();
  models.name = "LV1";
  models.preset = "onboard";
  models.created_ns = kMadeNs;
  for (ChannelSpec& channel : models.channels) {
    channel.lower_threshold = -20.0;
    channel.upper_threshold = 20.0;
    for (const int length : {30, 200}) {
      channel.windows.push_back(
          {length, -20.0, 20.0, 3.0, 0.0, 0.0, {49.9, 50.1}});
    }
  }
  return WithLimitsOf(models, PlantRun(kTwoHours, 1, kMadeNs - kNsPerDay));
}

TEST(SetLimitsTest, WhatADeadBandHidesStaysInTheLimits) {
  for (const int every : {0, ReadEvery::kOnChange}) {
    ModelSet parent = TwoHourSet();
    parent.every.x = every;
    parent.channels[0].upper_threshold = 20.0;
    parent.channels[0].windows[1].lower_mean = -20.0;
    const ModelSet now = WithLimitsOf(parent, PlantRun(kTwoHours, 2, kMadeNs));
    const bool stays = every == ReadEvery::kOnChange;
    EXPECT_EQ(now.channels[0].upper_threshold == 20.0, stays);
    EXPECT_EQ(now.channels[0].windows[1].lower_mean == -20.0, stays);
    EXPECT_LT(now.channels[1].upper_threshold, 20.0);
  }
}

class AppLimitsTest : public TrainerProgram {
 protected:
  void SetUp() override {
    std::filesystem::create_directory(Path("data"));
    storage::ModelStore store(Models(), storage::Access::kOccasionalWriter);
    static const ModelSet made = TwoHourSet();
    parent_ = std::make_shared<const ModelSet>(store.Save(made));
    store.SetBaseline("LV1", {0, "LV1", 1, 2.0, {{"kv", 118.0}}, {}});
  }

  std::filesystem::path Models() const { return Path("data") / "models.db"; }
  std::filesystem::path Runs() const { return Path("data") / "runs.db"; }
  std::filesystem::path History() const { return Path("data") / "history.db"; }
  ModelSet Load(const std::string& set) const {
    return storage::ModelStore(Models()).Load(set);
  }

  void Record(const storage::StoredRun& run) const {
    storage::RunRecorder recorder(Runs());
    const auto key = recorder.Begin(run.info.run);
    for (const storage::StoredSample& stored : run.samples) {
      recorder.Append(key, stored);
    }
    recorder.Close();
  }
  // An hour that is recorded and raises one alarm, perhaps labelled.
  storage::StoredRun RecordAlarm(const std::string& label,
                                 const Change& change = Shift) const {
    storage::StoredRun run = PlantRun(3600, 5, kMadeNs + kNsPerHour, change);
    Record(run);
    const auto ids = RecordEpisodes(History(), parent_, run);
    EXPECT_THAT(ids, SizeIs(1));
    if (!label.empty()) {
      storage::HistoryEditor(History()).Label(ids.at(0), label,
                                              {"kim", "", "test", kMadeNs});
    }
    return run;
  }
  static std::vector<Indication> Score(const ModelSet& models,
                                       const storage::StoredRun& run) {
    TrainingRun training;
    for (const storage::StoredSample& stored : run.samples) {
      training.samples.push_back({stored.sample, FaultTruth{}});
    }
    return ScoreRun(std::make_shared<const ModelSet>(models), training);
  }
  static bool Alarms(const ModelSet& models, const storage::StoredRun& run) {
    return std::ranges::any_of(Score(models, run), &Indication::detected);
  }

  std::shared_ptr<const ModelSet> parent_;
};

TEST_F(AppLimitsTest, ADayMakesLimitsCloserAndLeavesTheObservers) {
  Record(PlantRun(kDay, 2, kMadeNs + kNsPerHour));

  const json set = RunJson("relearn LV1");

  EXPECT_EQ(set["version"], 2);
  EXPECT_EQ(set["fitted"], true);
  EXPECT_NEAR(set["hours_after"].get<double>(), 24.0, 0.1);
  double closer = 0.0;
  for (const json& limit : set["limits"]) {
    const double ratio =
        limit["after"].get<double>() / limit["before"].get<double>();
    EXPECT_LE(ratio, 1.0) << limit;
    EXPECT_LT(limit["seen"].get<double>() / limit["after"].get<double>(), 1.0)
        << limit;
    closer += ratio < 0.97 ? 1.0 : 0.0;
  }
  EXPECT_GE(closer, 8.0) << set["limits"];  // Out of 16, some at their least.
  ModelSet child = Load("LV1@2");
  EXPECT_NE(storage::EncodeModelSet(child), storage::EncodeModelSet(*parent_));
  child.channels = parent_->channels;
  child.threshold_hours = parent_->threshold_hours;
  child.training_runs = parent_->training_runs;
  child.created_ns = parent_->created_ns;
  child.software = parent_->software;
  EXPECT_EQ(storage::EncodeModelSet(child), storage::EncodeModelSet(*parent_));
}

TEST_F(AppLimitsTest, TheNewSetIsAssignedWithItsLineageAndBaseline) {
  Record(PlantRun(kTwoHours + 600, 2, kMadeNs + kNsPerHour));
  RunJson("relearn LV1");

  storage::ModelStore store(Models());
  EXPECT_EQ(store.AssignedModelSet("LV1")->version, 2);
  EXPECT_EQ(store.FindValve("LV1")->baseline(), storage::BaselineState::kValid);
  EXPECT_EQ(store.Baselines("LV1").back().parameters,
            store.Baselines("LV1").front().parameters);
  const json shown = RunJson("show LV1@2");
  EXPECT_EQ(shown["lineage"]["parent"]["version"], 1);
  EXPECT_EQ(shown["lineage"]["settings"]["limits"]["fitted"], true);
  EXPECT_THAT(Run("show LV1@2").out, HasSubstr("with limits from 2.16 h"));
}

// A labelled fault becomes an observer, which is in use once it is activated
// and stays when limits are set by more hours.
TEST_F(AppLimitsTest, WhatALabelTaughtOfAFaultStays) {
  RecordAlarm("f6");
  const std::string id =
      storage::HistoryReader(History()).List({}).front().episode_id;
  const std::string relearn = "relearn LV1 --strength " + id + "=0.06";

  const json set = RunJson(relearn);

  EXPECT_EQ(set["version"], 2);
  EXPECT_EQ(set["taught"][0]["observer"], "f6 0.06 taught");
  EXPECT_GT(set["taught"][0]["gain_over_normal"].get<double>(), 100.0);
  EXPECT_EQ(set["episodes"][0]["label"], "f6");
  EXPECT_EQ(set["active"], true);
  EXPECT_THAT(set["worse"], IsEmpty());
  storage::ModelStore store(Models());
  EXPECT_EQ(store.AssignedModelSet("LV1")->version, 2);
  EXPECT_EQ(store.FindValve("LV1")->baseline(), storage::BaselineState::kValid);
  EXPECT_TRUE(RunJson(relearn)["version"].is_null());

  Record(PlantRun(kTwoHours + 600, 2, kMadeNs + kNsPerDay));
  EXPECT_EQ(RunJson("relearn LV1")["version"], 3);

  EXPECT_EQ(Load("LV1@3").observers.back().name, "f6 0.06 taught");
  const json shown = RunJson("show LV1@3");
  EXPECT_EQ(shown["lineage"]["episodes"][0]["fault"], "f6");
  // With another label, the set learns that instead.
  storage::HistoryEditor(History()).Label(id, "f3",
                                          {"kim", "", "test", kMadeNs + 1});
  const json again = RunJson(relearn);
  ASSERT_THAT(again["taught"], SizeIs(1));
  EXPECT_EQ(again["taught"][0]["fault"], "f3");
}

// Nothing of the first day is forgotten when the second one is added.
TEST_F(AppLimitsTest, HoursAddUpFromOneSetToTheNext) {
  Record(PlantRun(kTwoHours + 600, 2, kMadeNs + kNsPerHour));
  RunJson("relearn LV1");
  Record(PlantRun(kTwoHours, 3, kMadeNs + kNsPerDay));
  const json set = RunJson("relearn LV1");
  EXPECT_EQ(set["version"], 3);
  EXPECT_NEAR(set["hours_after"].get<double>(), 4.15, 0.05);
}

TEST_F(AppLimitsTest, AlarmLabelledFalseDoesNotComeAgain) {
  const storage::StoredRun run = RecordAlarm("false");
  ASSERT_TRUE(Alarms(*parent_, run));

  const json set = RunJson("relearn LV1");

  EXPECT_EQ(set["fitted"], false);
  ASSERT_THAT(set["episodes"], SizeIs(1));
  EXPECT_EQ(set["episodes"][0]["before"], "alarm");
  EXPECT_EQ(set["episodes"][0]["after"], "no alarm");
  const ModelSet child = Load("LV1@2");
  EXPECT_FALSE(Alarms(child, run));
  EXPECT_GT(child.channels[1].windows[1].upper_mean, kBias);
  // Limits that the alarm did not pass stay as they were.
  EXPECT_EQ(child.channels[0].windows[1].upper_mean,
            parent_->channels[0].windows[1].upper_mean);
  EXPECT_EQ(child.channels[1].windows[1].lower_mean,
            parent_->channels[1].windows[1].lower_mean);
  EXPECT_EQ(child.threshold_hours, parent_->threshold_hours);
  EXPECT_EQ(RunJson("show LV1@2")["lineage"]["episodes"][0]["label"], "false");
}

TEST_F(AppLimitsTest, AFaultOnTheSameRecordIsStillFoundAndNamed) {
  const storage::StoredRun run = RecordAlarm("false");
  RunJson("relearn LV1");

  storage::StoredRun faulty = run;
  for (std::size_t k = 2000; k < faulty.samples.size(); ++k) {
    fdi::tests::AddF6(faulty.samples[k].sample, 1.0);
  }
  const std::vector<Indication> found = Score(Load("LV1@2"), faulty);
  EXPECT_FALSE(found[1999].detected);
  EXPECT_TRUE(found[2010].detected);
  EXPECT_EQ(found[2100].isolated, std::vector<int>{6});
}

TEST_F(AppLimitsTest, AnEpisodeThatIsNotLabelledFalseIsLeftOut) {
  RecordAlarm("");
  const json set = RunJson("relearn LV1");
  EXPECT_TRUE(set["version"].is_null());
  EXPECT_THAT(set["episodes"], IsEmpty());
  EXPECT_EQ(set["left_out"][0]["reason"], "episodes");
  // 10 min before, 20 min of it at least.
  EXPECT_GT(set["left_out"][0]["seconds"].get<double>(), 1800.0);
  for (const json& limit : set["limits"]) {
    EXPECT_EQ(limit["after"], limit["before"]);
  }
  EXPECT_EQ(Run("show LV1@2").code, 5);
}

// As a shell pattern, "LV[1]" matches LV1 and not itself.
TEST_F(AppLimitsTest, AnEpisodeOfAValveWithBracketsIsLeftOut) {
  storage::ModelStore(Models(), storage::Access::kOccasionalWriter)
      .SetBaseline("LV[1]", {0, "LV1", 1, 2.0, {{"kv", 118.0}}, {}});
  storage::StoredRun run = PlantRun(3600, 5, kMadeNs + kNsPerHour, Shift);
  run.info.run.valve_id = "LV[1]";
  Record(run);
  ASSERT_THAT(RecordEpisodes(History(), parent_, run), SizeIs(1));

  const json set = RunJson("relearn 'LV[1]'");

  EXPECT_TRUE(set["version"].is_null());
  ASSERT_THAT(set["left_out"], Not(IsEmpty()));
  EXPECT_EQ(set["left_out"][0]["reason"], "episodes");
}

TEST_F(AppLimitsTest, AFileNeedsTheSignalsOfTheValveAlone) {
  std::string csv = "t_s,CV_pct,X_pct,F_m3_h\n";
  for (const storage::StoredSample& stored : PlantRun(3600, 2, 0).samples) {
    const Sample& sample = stored.sample;
    csv += std::to_string(sample.stamp_ns / kNsPerSecond);
    for (const Signal signal : {Signal::kCv, Signal::kX, Signal::kF}) {
      csv += ',' + std::to_string(sample[signal]);
    }
    csv += '\n';
  }
  Write("hour.csv", csv);
  const json set = RunJson("relearn LV1 --file hour.csv --dry-run");
  EXPECT_NEAR(set["hours"].get<double>(), 1.0, 0.05);
}

// f3 and f6 add 20 to F at most: limits that let 25 pass hide them.
TEST_F(AppLimitsTest, ASetThatIsWorseIsStoredAndNotInUse) {
  RecordAlarm("false", [](std::size_t k, Sample& sample) {
    sample.values[Index(Signal::kF)] += k >= 1800 && k < 3000 ? 25.0 : 0.0;
  });
  const Outcome worse = Run("relearn LV1");
  EXPECT_EQ(worse.code, 3);
  EXPECT_THAT(worse.out, AllOf(HasSubstr("worse: it does not see f3, f6 at"),
                               HasSubstr("LV1@2 is stored and not in use")));
  EXPECT_EQ(storage::ModelStore(Models()).AssignedModelSet("LV1")->version, 1);

  const json set = RunJson("relearn LV1 --activate");

  EXPECT_EQ(set["active"], true);
  EXPECT_THAT(set["worse"], SizeIs(1));
  EXPECT_EQ(storage::ModelStore(Models()).AssignedModelSet("LV1")->version, 3);
}

// The samples of the episode are kept as a run of their own.
TEST_F(AppLimitsTest, AFalseAlarmIsRememberedWhenItsRecordIsGone) {
  const storage::StoredRun run = RecordAlarm("false");
  RunJson("relearn LV1");
  std::filesystem::remove(History());
  {
    storage::RunStore store(Runs(), storage::Access::kOccasionalWriter);
    for (const storage::RunInfo& info :
         store.List({.origin = storage::RunOrigin::kRecorded})) {
      store.Delete(info.id);
    }
  }
  Record(PlantRun(2 * kTwoHours, 2, kMadeNs + kNsPerDay));

  const json set = RunJson("relearn LV1");

  EXPECT_EQ(set["fitted"], true);
  EXPECT_FALSE(Alarms(Load("LV1@3"), run));
  EXPECT_THAT(RunJson("show LV1@3")["lineage"]["episodes"], SizeIs(1));
}

TEST_F(AppLimitsTest, UnhealthyDataAreRefusedAndNothingIsStored) {
  Record(PlantRun(3600, 5, kMadeNs + kNsPerHour, [](auto k, Sample& sample) {
    sample.values[Index(Signal::kF)] += k >= 1800 ? 8.0 : 0.0;
  }));
  const Outcome outcome = Run("relearn LV1");
  EXPECT_EQ(outcome.code, 3);
  EXPECT_THAT(
      outcome.err,
      AllOf(HasSubstr("run "), HasSubstr(", channel F: the residual"),
            HasSubstr("hardly a healthy valve"), HasSubstr("2023-11-15T0")))
      << outcome.err;
  EXPECT_EQ(Run("show LV1@2").code, 5);
}

TEST_F(AppLimitsTest, FaultsThatWereSimulatedAreRefused) {
  storage::StoredRun run = PlantRun(3600, 5, kMadeNs + kNsPerHour);
  for (storage::StoredSample& stored : run.samples) {
    stored.truth = FaultTruth{6, 0.1};
  }
  Record(run);
  const Outcome outcome = Run("relearn LV1");
  EXPECT_EQ(outcome.code, 3);
  EXPECT_THAT(outcome.err, HasSubstr("has samples with a fault"));
}

TEST_F(AppLimitsTest, AValveThatHardlyMovedTightensNothing) {
  Record(PlantRun(2 * kTwoHours, 2, kMadeNs + kNsPerHour,
                  [](auto, Sample& sample) {
                    const double less = 0.9 * (sample[Signal::kCv] - 50.0);
                    sample.values[Index(Signal::kCv)] -= less;
                    sample.values[Index(Signal::kX)] -= less;
                    sample.values[Index(Signal::kF)] += less;
                  }));
  const json set = RunJson("relearn LV1");
  EXPECT_EQ(set["fitted"], false);
  EXPECT_TRUE(set["version"].is_null());
}

TEST_F(AppLimitsTest, DryRunStoresNothing) {
  Record(PlantRun(2 * kTwoHours, 2, kMadeNs + kNsPerHour));
  const json set = RunJson("relearn LV1 --dry-run");
  EXPECT_EQ(set["fitted"], true);
  EXPECT_EQ(Run("show LV1@2").code, 5);
}

TEST_F(AppLimitsTest, OtherSetsAndOtherEpochsAreRefused) {
  EXPECT_EQ(Run("relearn LV2").code, 5);
  EXPECT_EQ(Run("relearn LV1").code, 5);  // There are no data.
  {
    storage::ModelStore store(Models(), storage::Access::kOccasionalWriter);
    store.AddValveEvent("LV1", {.kind = storage::ValveEventKind::kReplaced});
    ModelSet trained = *parent_;
    trained.name = "LV2";
    trained.preset = "paper";
    store.Save(trained);
  }
  EXPECT_THAT(Run("relearn LV1").err, HasSubstr("onboard it anew"));
  const Outcome trained = Run("relearn LV2");
  EXPECT_EQ(trained.code, 5);
  EXPECT_THAT(trained.err, HasSubstr("no labelled episode"));
}

// f6 adds 10 to F at 0.5 and 20 at 1.
TEST(LimitsTest, FaultsThatWouldNotBeSeenAnyMoreAreNamed) {
  ModelSet before = TwoHourSet();
  ModelSet after = before;
  const auto limit_f = [&after](double limit) {
    after.channels[1].upper_threshold = limit;
    for (WindowLimits& window : after.channels[1].windows) {
      window.upper_mean = limit;
      window.upper_log_rms = std::log(limit);
    }
  };
  std::vector<Sample> samples;
  for (std::uint64_t k = 0; k < 400; ++k) {
    samples.push_back(fdi::tests::PlantSample(k));
  }
  const auto f6 = [&] {
    const auto faults = CompareVisibility(before, after, samples);
    return *std::ranges::find(faults, 6, &CoverageChange::fault);
  };
  limit_f(15.0);
  EXPECT_EQ(f6().before, 0.5);
  EXPECT_EQ(f6().after, 1.0);
  EXPECT_FALSE(f6().lost());
  limit_f(25.0);
  EXPECT_FALSE(f6().after.has_value());
  EXPECT_TRUE(f6().lost());
}

// The rod is off by some % for 10 s, outside of what any window covers.
TEST(LimitsTest, TheFloorIsAsWideAsTheDataAskForUpToItsBound) {
  ModelSet before = TwoHourSet();
  before.floor.emplace();
  AddFindings(before);
  const auto deviation = [&](double off) {
    return WithLimitsOf(before, PlantRun(600, 2, kMadeNs,
                                         [off](std::size_t k, Sample& sample) {
                                           sample.values[Index(Signal::kX)] +=
                                               k >= 300 && k < 310 ? off : 0.0;
                                         }))
        .floor->deviation;
  };
  EXPECT_EQ(deviation(0.0), before.floor->deviation);
  EXPECT_NEAR(deviation(6.0), 12.0, 1.5);
  EXPECT_EQ(deviation(12.0), 15.0);
}

}  // namespace
}  // namespace fdi::trainer
