#include "trainer/onboarding/onboarding.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <memory>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "diagnosis/model/fault_catalogue.h"
#include "diagnosis/model/trained_signals.h"
#include "import/csv.h"
#include "import/sniff.h"
#include "import/tag_map.h"
#include "simulator/random.h"
#include "tests/storage/temporary_directory.h"
#include "trainer/onboarding/lost_command.h"
#include "trainer/onboarding/record_checks.h"
#include "trainer/onboarding/record_verdict.h"

namespace fdi::trainer {
namespace {

ValveType Lublin() {
  ValveType type;
  type.name = "lublin-actuator-3";
  type.parameters = simulator::ParameterSet(type.name);
  return type;
}

// A valve whose flow the simulation does not know: 20 % more, with a swell.
Stretch Strange(double seconds) {
  Stretch stretch{"strange", SimulateHealthy(Lublin(), seconds, 3)};
  for (std::size_t k = 0; k < stretch.samples.size(); ++k) {
    Sample& sample = stretch.samples[k];
    sample.Set(Signal::kF, 1.2 * sample[Signal::kF] +
                               std::sin(0.01 * static_cast<double>(k)));
  }
  return stretch;
}

TrainingRun RunOf(const Stretch& stretch) {
  TrainingRun run;
  run.id = stretch.run_id;
  run.flow_unit = FlowUnit::kTPerHour;
  for (const Sample& sample : stretch.samples) {
    run.samples.push_back({sample, FaultTruth{}});
  }
  return run;
}

// T1 as a swinging-door export has it: at its first and last sample.
TEST(OnboardingPresetTest, WhatIsHardlyReadIsNoChannel) {
  TrainingRun run = RunOf(Strange(400.0));
  for (std::size_t k = 1; k + 1 < run.samples.size(); ++k) {
    run.samples[k].sample.quality[Index(Signal::kT1)] =
        SignalQuality::kUncertain;
    run.samples[k].sample.quality[Index(Signal::kP2)] =
        k % 3 == 0 ? SignalQuality::kGood : SignalQuality::kUncertain;
  }
  std::vector<ChannelPlan> channels = OnboardingPreset(kBasicSignals).channels;
  const std::size_t all = channels.size();

  EXPECT_EQ(DropUnreadChannels({run}, channels),
            std::vector<std::string>{"T1"});
  EXPECT_EQ(channels.size(), all - 1);
  EXPECT_TRUE(std::ranges::none_of(channels, [](const ChannelPlan& plan) {
    return plan.output == Signal::kT1;
  }));
}

TEST(OnboardingPresetTest, NeedsTheCommandAndAnAnswerToIt) {
  const auto outputs = [](SignalMask signals) {
    std::vector<std::string> names;
    for (const ChannelPlan& plan : OnboardingPreset(signals).channels) {
      names.push_back(plan.name);
    }
    return names;
  };
  const SignalMask cv = MaskOf(Signal::kCv);
  EXPECT_EQ(outputs(static_cast<SignalMask>(cv | MaskOf(Signal::kF))),
            std::vector<std::string>{"F(CV)"});
  EXPECT_EQ(outputs(static_cast<SignalMask>(cv | MaskOf(Signal::kX))),
            std::vector<std::string>{"X"});
  EXPECT_THROW(OnboardingPreset(cv), DataError);
  EXPECT_THROW(OnboardingPreset(kRodSignals), DataError);
}

TEST(TrainingTest, RunsWithoutTheOutputOfAChannelAreRefused) {
  TrainingRun run = RunOf(Strange(400.0));
  for (LabelledSample& labelled : run.samples) {
    Sample& sample = labelled.sample;
    sample.present =
        static_cast<SignalMask>(sample.present & ~MaskOf(Signal::kX));
  }
  TrainingOptions options = PresetOptions("extended");
  options.name = "x";
  try {
    TrainModelSet({run}, options);
    FAIL() << "not refused";
  } catch (const DataError& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("has no X"));
  }
}

TEST(FaultSynthesizerTest, MismatchOfTheSimulationStaysInTheReadings) {
  const FaultSynthesizer synthesize(Lublin());
  const Stretch healthy = Strange(200.0);
  const std::vector<Sample> same = synthesize({0, 0.0}, healthy);
  const std::vector<Sample> half = synthesize({19, 0.5}, healthy);
  const std::vector<Sample> hot = synthesize({20, 0.1}, healthy);
  for (std::size_t k = 0; k < same.size(); ++k) {
    const Sample& sample = healthy.samples[k];
    EXPECT_NEAR(same[k][Signal::kF], sample[Signal::kF], 1e-9);
    EXPECT_NEAR(half[k][Signal::kF], 0.5 * sample[Signal::kF], 1e-9);
    EXPECT_NEAR(half[k][Signal::kX], sample[Signal::kX], 1e-9);
    EXPECT_EQ(half[k][Signal::kCv], sample[Signal::kCv]);
    // 10 % of 200 degC.
    EXPECT_NEAR(hot[k][Signal::kT1], sample[Signal::kT1] + 20.0, 1e-6);
    EXPECT_NEAR(hot[k][Signal::kF], sample[Signal::kF], 1e-9);
  }
}

TEST(FaultSynthesizerTest, GivesBackTheSignalsThatTheValveHas) {
  const FaultSynthesizer synthesize(Lublin());
  Stretch healthy{"x", SimulateHealthy(Lublin(), 60.0, 3)};
  const auto cv_and_x =
      static_cast<SignalMask>(MaskOf(Signal::kCv) | MaskOf(Signal::kX));
  for (Sample& sample : healthy.samples) {
    sample.present = cv_and_x;
  }
  for (const Sample& sample : synthesize({13, 0.25}, healthy)) {
    EXPECT_EQ(sample.present, cv_and_x);
  }
}

TEST(FaultSynthesizerTest, StretchesThatBeginAtTheSameSampleMayDifferInLength) {
  const FaultSynthesizer synthesize(Lublin());
  const Stretch whole{"x", SimulateHealthy(Lublin(), 60.0, 3)};
  const Stretch half{"x", {whole.samples.begin(), whole.samples.begin() + 30}};
  EXPECT_EQ(synthesize({13, 0.25}, half).size(), 30U);
  EXPECT_EQ(synthesize({13, 0.25}, whole).size(), whole.samples.size());
}

// Hot water pushes the rod aside; at the position that is read, only the flow
// and T1 tell.
TEST(FaultSynthesizerTest, AtThePositionTheRodIsWhereItIsRead) {
  Stretch healthy = Strange(300.0);
  for (Sample& sample : healthy.samples) {
    sample = PositionAsCommand(sample);
  }
  const FaultCondition hot{7, 0.5};
  const auto flow = [&](bool at_position) {
    const std::vector<Sample> faulty =
        FaultSynthesizer(Lublin(), at_position)(hot, healthy);
    EXPECT_GT(faulty.back()[Signal::kT1], 150.0);
    return faulty.back()[Signal::kF] / healthy.samples.back()[Signal::kF];
  };
  EXPECT_GT(flow(false), 1.3 * flow(true));
}

TEST(OnboardingFaultsTest, FaultsOfMissingTransmittersAreLeftOut) {
  const auto has = [](SignalMask signals, int fault) {
    const std::vector<FaultCondition> faults = OnboardingFaults(signals, {});
    return std::any_of(faults.begin(), faults.end(),
                       [&](const auto& f) { return f.fault == fault; });
  };
  const auto cv_and_x =
      static_cast<SignalMask>(MaskOf(Signal::kCv) | MaskOf(Signal::kX));
  EXPECT_TRUE(has(kBasicSignals, 19));
  EXPECT_TRUE(has(kBasicSignals, kTemperatureTransmitterFault));
  EXPECT_FALSE(has(kBasicSignals, 14));
  EXPECT_FALSE(has(cv_and_x, 19));
  EXPECT_FALSE(has(cv_and_x, kInletPressureTransmitterFault));
  EXPECT_TRUE(has(cv_and_x, 13));
  EXPECT_LT(OnboardingFaults(kBasicSignals, {}).size(),
            static_cast<std::size_t>(kMaxObservers));
}

TEST(OnboardingFaultsTest, WhatTheMediumExcludesIsLeftOut) {
  simulator::ValveParameters gas;
  gas.medium.fluid = simulator::Fluid::kGas;
  for (const FaultCondition& condition : OnboardingFaults(kBasicSignals, gas)) {
    EXPECT_NE(condition.fault, 7);
  }
  EXPECT_LT(OnboardingFaults(kBasicSignals, gas).size(),
            OnboardingFaults(kBasicSignals, {}).size());
}

TEST(OnboardingFaultsTest, AnElectricActuatorHasNoFaultsOfAir) {
  simulator::ValveParameters electric;
  electric.actuator.drive = simulator::ActuatorDrive::kElectric;
  std::set<int> faults;
  for (const FaultCondition& condition :
       OnboardingFaults(kBasicSignals, electric)) {
    faults.insert(condition.fault);
  }
  EXPECT_EQ(faults,
            (std::set{1, 2, 3, 4, 5, 6, 7, 8, 13, 15, 17, 18, 19, 20, 21, 22}));
}

TEST(OnboardingFaultsTest, WhereThereIsNoRoomForAllTheWeakestAreLeftOut) {
  const auto all = OnboardingFaults(kBasicSignals, {});
  const auto most = OnboardingFaults(kBasicSignals, {}, all.size() - 5);
  EXPECT_EQ(most.size(), all.size() - 5);
  for (const FaultCondition& condition : all) {
    EXPECT_TRUE(std::abs(condition.strength) == 0.1 ||
                std::ranges::find(most, condition) != most.end());
  }
}

std::string Refusal(const std::function<void(Sample&)>& change) {
  TrainingRun run = RunOf({"r", SimulateHealthy(Lublin(), 900.0, 3)});
  for (LabelledSample& labelled : run.samples) {
    change(labelled.sample);
  }
  try {
    CheckRecords({run}, {});
  } catch (const DataError& error) {
    return error.what();
  }
  return "";
}

void Scale(Sample& sample, Signal signal, double scale, double offset = 0.0) {
  sample.Set(signal, scale * sample[signal] + offset);
}

TEST(RecordChecksTest, WrongUnitsAndSensesAreToldApart) {
  using enum Signal;
  const auto refused = [](const auto& change, const char* words) {
    const std::string refusal = Refusal(change);
    EXPECT_NE(refusal.find(words), std::string::npos) << refusal;
  };
  EXPECT_EQ(Refusal([](Sample&) {}), "");
  refused([](Sample& s) { s.Set(kX, s[kCv]); }, "X is a copy of CV");
  refused(
      [](Sample& s) {
        s.Set(kCv, s.stamp_ns / 60'000'000'000 % 2 == 0 ? 100.0 : 0.0);
      },
      "this is an open/shut valve");
  const auto without = [](Sample& s, SignalMask signals) {
    s.present = static_cast<SignalMask>(s.present & ~signals);
  };
  refused([&](Sample& s) { without(s, kRodSignals); },
          "neither a position (X) nor a flow (F)");
  EXPECT_EQ(Refusal([&](Sample& s) { without(s, MaskOf(kX)); }), "");
  refused(
      [&](Sample& s) { without(s, s.seq < 5 ? MaskOf(kX) : SignalMask{0}); },
      "begins without a position (X)");
  refused(
      [&](Sample& s) {
        without(s, MaskOf(kX));
        Scale(s, kCv, -1.0, 100.0);
      },
      "F rises while CV closes");
  refused(
      [&](Sample& s) {
        without(s, MaskOf(kX));
        s.Set(kF, 10.0 + std::sin(7.0 * s[kP1]));
      },
      "F does not follow CV");
  // Most minutes show that the sense is right: the line was shut.
  refused(
      [](Sample& s) {
        if (s.seq >= 400) {
          s.Set(kCv, 0.0);
          s.Set(kX, 0.0);
          s.Set(kF, 0.0);
        }
      },
      "likeliest a line that was shut");
  refused([](Sample& s) { Scale(s, kCv, 0.01); }, "CV is 0.");
  refused([](Sample& s) { Scale(s, kX, 0.01); }, "scale = 100");
  refused(
      [](Sample& s) {
        Scale(s, kP1, 0.01);
        Scale(s, kP2, 0.01);
      },
      "Map bar with scale = 100");
  refused([](Sample& s) { Scale(s, kT1, 1.0, 273.15); }, "T1 is likely in K");
  refused([](Sample& s) { Scale(s, kT1, 0.0, 260.0); },
          "the medium is likely steam or a gas");
  refused([](Sample& s) { std::swap(s.values[1], s.values[2]); },
          "above P2 behind it");
  refused([](Sample& s) { Scale(s, kX, -1.0, 100.0); }, "X moves against CV");
  refused([](Sample& s) { Scale(s, kCv, -1.0, 100.0); }, "X moves against CV");
  refused(
      [](Sample& s) {
        Scale(s, kCv, -1.0, 100.0);
        Scale(s, kX, -1.0, 100.0);
      },
      "F rises while X closes");
}

// The files of the reference data, as `onboard --file` reads them with the map
// that sniff writes. The test of the reader covers the readings.
TEST(RecordChecksTest, TheReferenceFilesAreOnboardedOrRefusedForTheirReason) {
  const char* folder = std::getenv("FDI_REFERENCE_DATA");
  if (folder == nullptr) {
    GTEST_SKIP() << "FDI_REFERENCE_DATA is not set";
  }
  const std::map<std::string, const char*> refused = {
      {"a17_etl_headerless.csv", "the first row holds values, not names"},
      {"b04_level_loop.csv", "neither a position (X) nor a flow (F)"},
      {"b06_on_off.csv", "this is an open/shut valve"},
      {"b10_supply_lost.csv", "likeliest a line that was shut"}};
  const storage::TemporaryDirectory directory;
  const auto tags = directory.path() / "tags.toml";
  std::size_t files = 0;
  for (const auto& entry : std::filesystem::directory_iterator(
           std::filesystem::path(folder) / "cases")) {
    if (entry.path().extension() != ".csv") {
      continue;
    }
    ++files;
    const std::string name = entry.path().filename();
    SCOPED_TRACE(name);
    std::string reason;
    try {
      const std::string text = ReadTextFile(entry.path());
      importer::ColumnMap map;
      map.zone = "Europe/Berlin";
      std::ofstream(tags) << importer::MapText(importer::Sniff(text, name, map),
                                               name);
      const importer::CsvTable table =
          importer::ReadCsv(text, {.map = importer::ReadTagMap(tags),
                                   .required = MaskOf(Signal::kCv),
                                   .split_gaps = true});
      TrainingRun run;
      run.id = name;
      for (const SampleSeries& part : table.runs) {
        run.samples.insert(run.samples.end(), part.samples.begin(),
                           part.samples.end());
      }
      CheckRecords({run}, {});
    } catch (const DataError& error) {
      reason = error.what();
    }
    const auto expected = refused.find(name);
    if (expected == refused.end()) {
      EXPECT_EQ(reason, "");
    } else {
      EXPECT_THAT(reason, testing::HasSubstr(expected->second));
    }
  }
  EXPECT_GE(files, 27U);
}

// One that is off by as much and is no curve of CV has another cause.
TEST(RecordChecksTest, ACharacteristicOfThePositionerIsSaid) {
  LabelledSample labelled;
  TrainingRun curve;
  TrainingRun other;
  for (int k = 0; k < 600; ++k) {
    const double cv = 50.0 + 20.0 * std::sin(0.05 * k);
    labelled.sample.Set(Signal::kCv, cv);
    labelled.sample.Set(Signal::kX, 0.01 * cv * cv);
    curve.samples.push_back(labelled);
    labelled.sample.Set(Signal::kX, 25.0 + 20.0 * std::sin(0.05 * k - 1.0));
    other.samples.push_back(labelled);
  }
  try {
    CheckFit({curve}, {24.0, 0.0, 0.0, 0.0}, {}, 40.0);
    FAIL() << "not refused";
  } catch (const DataError& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("X is a fixed curve of CV"));
  }
  EXPECT_NO_THROW(CheckFit({other}, {24.0, 0.0, 0.0, 0.0}, {}, 40.0));
  EXPECT_NO_THROW(CheckFit({curve}, {5.0, 0.0, 0.0, 0.0}, {}, 40.0));
}

TEST(RecordChecksTest, SimulationHasToBeBetterThanNone) {
  const std::vector<TrainingRun> runs{
      RunOf({"r", SimulateHealthy(Lublin(), 900.0, 3)})};
  simulator::FittedParameter kv{"trim.kv_m3_h", 100.0, 120.0, 30.0,
                                480.0,          0.01,  true};
  EXPECT_NO_THROW(CheckFit(runs, {0.5, 0.2, 0.0, 0.0}, {kv}, 40.0));
  EXPECT_THROW(CheckFit(runs, {30.0, 0.2, 0.0, 0.0}, {kv}, 40.0), DataError);
  EXPECT_THROW(CheckFit(runs, {0.5, 30.0, 0.0, 0.0}, {kv}, 40.0), DataError);
  kv.value = 480.0;
  EXPECT_THROW(CheckFit(runs, {0.5, 0.2, 0.0, 0.0}, {kv}, 40.0), DataError);
  kv.identified = false;
  EXPECT_NO_THROW(CheckFit(runs, {0.5, 0.2, 0.0, 0.0}, {kv}, 40.0));
  try {
    CheckFit(runs, {0.5, 30.0, 0.0, 0.0}, {kv}, 2.0);
    FAIL() << "not refused";
  } catch (const DataError& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("type ends at 2 t/h"));
  }
}

// One sample in ten seconds of a command that moves each second.
struct SlowRecord {
  double period_s{10.0};
  std::size_t samples{720};
  double of_command{0.3};  // Share of CV in X.
  double of_position{4.0};
  double swing{0.0};    // CV's, slow; X comes a quarter of a period later.
  double of_flow{0.5};  // F has of X.
};

std::vector<TrainingRun> RunsOf(const SlowRecord& record) {
  simulator::NormalSource position(5, 1);
  simulator::NormalSource command(5, 2);
  simulator::NormalSource flow(5, 3);
  TrainingRun run;
  run.period_s = record.period_s;
  for (std::size_t k = 0; k < record.samples; ++k) {
    const double angle = 0.1 * static_cast<double>(k);
    const double cv = 5.0 * command() * (record.swing > 0.0 ? 0.1 : 1.0);
    const double x = record.of_command * cv + record.of_position * position() -
                     record.swing * std::cos(angle);
    Sample& sample = run.samples.emplace_back().sample;
    sample.stamp_ns =
        std::llround(1e9 * record.period_s) * static_cast<std::int64_t>(k + 1);
    sample.Set(Signal::kCv, 60.0 + cv + record.swing * std::sin(angle));
    sample.Set(Signal::kX, 60.0 + x);
    sample.Set(Signal::kF, 20.0 - record.of_flow * x + 0.5 * flow());
  }
  return {run};
}

TEST(LostCommandTest, IsOneThatSaysNothingOfXWhileFFollowsX) {
  EXPECT_TRUE(CommandIsLost(RunsOf({})));
  EXPECT_TRUE(CommandIsLost(RunsOf({.period_s = 60.0})));
  // The record shows how the rod moves.
  EXPECT_FALSE(CommandIsLost(RunsOf({.period_s = 1.0})));
  // X follows CV.
  EXPECT_FALSE(CommandIsLost(RunsOf({.of_command = 1.0, .of_position = 1.0})));
  // A command that is there, and a rod that does not follow it.
  EXPECT_FALSE(CommandIsLost(
      RunsOf({.of_command = 0.0, .of_position = 0.2, .swing = 8.0})));
  // F does not follow X, or rises with it.
  EXPECT_FALSE(CommandIsLost(RunsOf({.of_flow = 0.05})));
  EXPECT_FALSE(CommandIsLost(RunsOf({.of_flow = -0.5})));
  // Too few samples to say so.
  EXPECT_FALSE(CommandIsLost(RunsOf({.samples = 30})));
  EXPECT_FALSE(CommandIsLost({}));
}

TEST(RecordChecksTest, AFlowThatMovesWithoutTheCommandIsNotRefused) {
  TrainingRun run = RunOf({"r", SimulateHealthy(Lublin(), 900.0, 3)});
  double sign = 1.0;
  for (LabelledSample& labelled : run.samples) {
    sign = -sign;
    labelled.sample.Set(Signal::kCv, 60.0 + 0.3 * sign);
    labelled.sample.Set(Signal::kX, 60.0 + 0.3 * sign);
  }
  EXPECT_NO_THROW(CheckFit({run}, {0.3, 30.0, 0.0, 0.0}, {}, 40.0));
}

// Models of a few faults.
struct Few {
  FaultSynthesizer synthesize{Lublin()};
  Stretch record{Strange(4000.0)};
  std::vector<FaultCondition> faults{
      {8, 0.5}, {8, 1.0}, {19, 0.005}, {19, 0.25}, {19, 0.5}};
  std::shared_ptr<const ModelSet> models;

  Few() {
    TrainingOptions options = OnboardingPreset(kBasicSignals);
    options.name = "few";
    models = std::make_shared<const ModelSet>(TrainDifferenceSet(
        {RunOf(record)}, faults, std::ref(synthesize), 40.0, options));
  }

  static const Few& Trained() {
    static const Few few;
    return few;
  }
};

// The table on a fault that is as plain as half the flow, and on one that has
// no effect on X.
TEST(CoverageTest, SaysFromWhichStrengthOnAFaultIsSeen) {
  const Few& few = Few::Trained();
  const CoverageTable table = AssessCoverage(
      few.models, few.faults, std::ref(few.synthesize), few.record, 1);
  ASSERT_EQ(table.faults.size(), 2U);
  EXPECT_EQ(table.seconds, 900.0);
  EXPECT_FALSE(table.faults[0].detectable.has_value());
  EXPECT_EQ(table.faults[1].detectable, 0.25);
  EXPECT_EQ(table.faults[1].isolable, 0.25);
  EXPECT_TRUE(table.faults[1].look_alikes.empty());
}

// The flow of a part rises by a fifth after 300 s, which its models do not
// know: a fault counts that is detected before, and what the alarm found by
// itself does not.
TEST(CoverageTest, AnAlarmWithoutAFaultIsNoDetection) {
  const Few& few = Few::Trained();
  const auto part = [&](double rise) {
    ScoredPart scored{few.models, CutOut(few.record, {0, 3000, 600}), {}};
    for (std::size_t k = 300; k < 600; ++k) {
      Sample& sample = scored.healthy.samples[k];
      sample.Set(Signal::kF, rise * sample[Signal::kF]);
    }
    for (const FaultCondition& fault : few.faults) {
      scored.faulty.push_back(few.synthesize(fault, scored.healthy));
    }
    return scored;
  };
  const CoverageTable quiet = ScoreCoverage(few.faults, {part(1.0)}, 1);
  EXPECT_EQ(quiet.alarmed, 0);
  EXPECT_GT(quiet.judged, 0.9);
  const CoverageTable table =
      ScoreCoverage(few.faults, {part(1.0), part(1.2)}, 1);
  EXPECT_EQ(table.seconds, 480.0);
  EXPECT_EQ(table.parts, 2);
  EXPECT_EQ(table.alarmed, 1);
  EXPECT_FALSE(table.faults[0].detectable.has_value());
  EXPECT_EQ(table.faults[1].detectable, 0.25);
}

Stretch Counted(const std::string& id, std::size_t count, std::int64_t from) {
  Stretch stretch{id, {}};
  for (std::size_t k = 0; k < count; ++k) {
    stretch.samples.emplace_back();
    stretch.samples.back().stamp_ns =
        1'000'000'000 * (from + static_cast<std::int64_t>(k));
  }
  return stretch;
}

TEST(CoverageTest, WhatIsLeftOutIsInNothingThatIsLeft) {
  const std::vector<Stretch> stretches{
      Counted("a", 500, 0), Counted("a", 1300, 1000), Counted("b", 40, 0)};
  const std::vector<RecordPart> parts = PartsOf(stretches);
  ASSERT_EQ(parts.size(), 2U);
  EXPECT_EQ(parts[0].stretch, 1U);
  EXPECT_EQ(parts[0].from, 0U);
  EXPECT_EQ(parts[0].count, 600U);
  EXPECT_EQ(parts[1].stretch, 1U);
  EXPECT_EQ(parts[1].from, 700U);

  // A row of 900 samples is halved.
  EXPECT_EQ(PartsOf({Counted("a", 900, 0)})[1].from, 450U);
  EXPECT_EQ(PartsOf({Counted("a", 900, 0)})[1].count, 450U);
  // Two stretches give one part each.
  EXPECT_EQ(
      PartsOf({stretches[0], Counted("a", 600, 600), Counted("b", 700, 0)})[1]
          .stretch,
      2U);
  // In less than two minutes no fault would begin.
  EXPECT_THROW(PartsOf({Counted("a", 240, 0)}), DataError);

  const FaultyStretches rest = Without({stretches, {stretches}}, {1, 300, 600});
  ASSERT_EQ(rest.healthy.size(), 3U);  // the 40 of b tell nothing
  EXPECT_EQ(rest.healthy[1].samples.size(), 300U);
  EXPECT_EQ(rest.healthy[2].samples.size(), 400U);
  EXPECT_EQ(rest.faulty[0][2].samples.front().stamp_ns, 1'900'000'000'000);

  // A long record gives four blocks, spread over what is left.
  const std::vector<Stretch> hour{Counted("a", 3600, 0)};
  const FaultyStretches few = Without({hour, {hour}}, {0, 0, 600});
  ASSERT_EQ(few.healthy.size(), 4U);
  EXPECT_EQ(few.healthy[0].samples.size(), 300U);
  EXPECT_EQ(few.healthy[0].samples.front().stamp_ns, 900'000'000'000);
  EXPECT_EQ(few.faulty[0][3].samples.front().stamp_ns, 3'000'000'000'000);

  TrainingRun run = RunOf(stretches[1]);
  TrainingRun other = run;
  other.id = "c";
  const std::vector<TrainingRun> runs =
      RunsWithout({run, other}, CutOut(stretches[1], {1, 300, 600}));
  ASSERT_EQ(runs.size(), 2U);
  EXPECT_EQ(runs[0].samples.size(), 700U);
  EXPECT_EQ(runs[0].samples[300].sample.stamp_ns, 1'900'000'000'000);
  EXPECT_EQ(runs[1].samples.size(), 1300U);
}

TEST(OnboardTest, RefusesWhatIsNotHealthyData) {
  OnboardingOptions options;
  options.name = "x";
  options.type = Lublin();
  options.fit = false;
  TrainingRun run = RunOf(Strange(700.0));
  run.samples[300].truth = FaultTruth{19, 0.5};
  EXPECT_THROW(Onboard({run}, options), DataError);
  EXPECT_THROW(Onboard({RunOf(Strange(300.0))}, options), DataError);
  TrainingRun gap = RunOf(Strange(1000.0));
  for (std::size_t k = 500; k < gap.samples.size(); ++k) {
    gap.samples[k].sample.stamp_ns += 60'000'000'000;
  }
  EXPECT_THROW(Onboard({gap}, options), DataError);
  TrainingRun neither_x_nor_f = RunOf(Strange(700.0));
  for (LabelledSample& labelled : neither_x_nor_f.samples) {
    labelled.sample.present =
        kBasicSignals & ~(MaskOf(Signal::kX) | MaskOf(Signal::kF));
  }
  EXPECT_THROW(Onboard({neither_x_nor_f}, options), DataError);
}

// Before the physics are fitted to what is not one record.
TEST(OnboardTest, RefusesRunsThatDifferAndSaysByWhat) {
  OnboardingOptions options;
  options.name = "x";
  options.type = Lublin();
  options.fit = false;
  const TrainingRun run = RunOf(Strange(700.0));
  const auto refusal = [&](const TrainingRun& other) -> std::string {
    try {
      Onboard({run, other}, options);
    } catch (const DataError& error) {
      return error.what();
    }
    return "";
  };
  TrainingRun blind = run;
  blind.id = "blind";
  for (LabelledSample& labelled : blind.samples) {
    labelled.sample.present = kBasicSignals & ~MaskOf(Signal::kX);
  }
  EXPECT_EQ(refusal(blind),
            "run blind has other signals than run strange: CV P1 P2 T1 F "
            "instead of CV P1 P2 T1 X F");
  TrainingRun slow = run;
  slow.period_s = 2.0;
  EXPECT_NE(refusal(slow).find("a sample period of 2"), std::string::npos);
}

TEST(OnboardTest, RunWithoutSamplesIsLeftOutWhereverTheValveWorks) {
  const TrainingRun at_work = RunOf(Strange(700.0));
  TrainingRun shut = at_work;
  for (LabelledSample& labelled : shut.samples) {
    labelled.sample.Set(Signal::kX, 100.0);
  }
  TrainingRun empty = at_work;
  empty.samples.clear();
  EXPECT_EQ(WithoutStops({empty, at_work}).size(), 1U);
  EXPECT_EQ(WithoutStops({empty, shut}).size(), 1U);
}

TEST(RecordVerdictTest, ThinSaysWhatIsStillNeeded) {
  const auto record = [](int samples, double span) {
    TrainingRun run;
    for (int k = 0; k < samples; ++k) {
      Sample sample;
      sample.Set(Signal::kCv, 40.0 + span * (k % 11) / 10.0);
      run.samples.push_back({sample, {}});
    }
    return std::vector{run};
  };
  EXPECT_EQ(JudgeRecord(record(3600, 20.0), 1.0).word, "usable");
  EXPECT_EQ(JudgeRecord(record(1500, 20.0), 1500.0 / 3600.0).word, "usable");
  EXPECT_EQ(
      JudgeRecord(record(840, 20.0), 840.0 / 3600.0).sentence.substr(0, 59),
      "thin: 14 minutes of healthy data, 11 more are needed. Until");
  std::vector<TrainingRun> held = record(3600, 20.0);
  for (std::size_t k = 0; k < 3600; ++k) {
    Sample& sample = held[0].samples[k].sample;
    sample.Set(Signal::kX, 50.0);
    sample.quality[Index(Signal::kX)] =
        k % 30 == 0 ? SignalQuality::kGood : SignalQuality::kUncertain;
  }
  EXPECT_EQ(JudgeRecord(held, 1.0).sentence.substr(0, 47),
            "thin: 1.00 h, of which only X 0.03 h rest on re");
  for (LabelledSample& labelled : held[0].samples) {
    labelled.sample.Set(Signal::kF, 5.0);
  }
  EXPECT_EQ(JudgeRecord(held, 1.0).sentence.substr(0, 77),
            "usable: 1.00 h of healthy data, of which X 0.03 h, F 1.00 h rest "
            "on readings,");
  for (std::size_t k = 0; k < 3600; ++k) {
    held[0].samples[k].sample.quality[Index(Signal::kCv)] =
        k % 4 == 0 ? SignalQuality::kGood : SignalQuality::kUncertain;
  }
  EXPECT_EQ(JudgeRecord(held, 1.0).sentence.substr(0, 61),
            "thin: 1.00 h, of which only CV 0.25 h, X 0.03 h, F 1.00 h res");
  const RecordVerdict still = JudgeRecord(record(3600, 2.0), 1.0);
  EXPECT_EQ(still.word, "thin");
  EXPECT_NE(still.sentence.find("stays within 2.0 %, one more operating point"),
            std::string::npos)
      << still.sentence;

  CoverageTable coverage;
  coverage.faults = {{6, false, 0.1, 0.5, {}}, {8, false, {}, {}, {}}};
  coverage.parts = 2;
  const auto judged = [&] {
    return JudgeRecord(record(3600, 20.0), 1.0, &coverage);
  };
  EXPECT_EQ(judged().word, "usable");
  EXPECT_NE(judged().sentence.find("; 1 of 2 faults are detected in data"),
            std::string::npos)
      << judged().sentence;
  coverage.alarmed = 1;
  EXPECT_EQ(judged().word, "thin");
  EXPECT_NE(judged().sentence.find("in 1 of 2 parts of the record"),
            std::string::npos)
      << judged().sentence;
  EXPECT_NE(judged().sentence.find("another 1.00 h of record is needed"),
            std::string::npos);
  coverage.alarmed = 0;
  coverage.judged = 0.3;
  EXPECT_EQ(judged().word, "thin");
  EXPECT_NE(judged().sentence.find("know only 30 % of a part of it"),
            std::string::npos)
      << judged().sentence;
}

}  // namespace
}  // namespace fdi::trainer
