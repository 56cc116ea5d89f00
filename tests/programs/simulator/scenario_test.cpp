#include <fstream>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "simulator/fault_effects.h"
#include "simulator/record_fit.h"
#include "simulator/scenario/scenario_toml.h"
#include "tests/storage/temporary_directory.h"

namespace fdi::simulator {
namespace {

using testing::AllOf;
using testing::HasSubstr;

Scenario Read(const std::string& text) {
  Scenario scenario;
  TomlReader reader(text, "test.toml");
  ApplyScenario(reader, {}, scenario);
  reader.Finish();
  return scenario;
}

std::string RefusalOf(const std::string& text) {
  try {
    Read(text);
  } catch (const ConfigError& error) {
    return error.what();
  }
  return "accepted";
}

TEST(ScenarioTomlTest, TheDefaultIsTheShippedSetOfItsName) {
  const Scenario scenario;

  const ValveParameters shipped = ParameterSet("lublin-actuator-3");
  EXPECT_EQ(scenario.config.parameters.name, shipped.name);
  EXPECT_EQ(scenario.config.parameters.positioner.transducer_dead_zone,
            shipped.positioner.transducer_dead_zone);
}

TEST(ScenarioTomlTest, EveryKeyReachesItsField) {
  const Scenario scenario = Read(R"(
      valve = "LC51_03"
      faults = ["f19:abrupt@50:strength=0.75", "f1:incipient@500+1200"]
      seed = 7
      duration_s = 900
      period_s = 0.5
      start = "2026-11-20T00:00:00Z"
      cold_start = true
      noise = false
      resolution = false
      tolerance_scale = 0.1
      [[input]]
      t_s = [0, 60]
      cv_pct = [100, 60]
      cv_noise_pct.sd = 0.5
      [[input]]
      t_s = [10, 20.5]
      t1_degc = [20, 100]
      [[mode]]
      from_s = 100
      until_s = 200
      mode = "MANUAL"
      [[mode]]
      from_s = 300
      mode = "out_of_service"
      [excitation]
      name = "level-loop"
      proportional_gain = 4
      pump_noise_kpa.sd = 12.5
      [parameters]
      base = "paper-operating-point"
      name = "mine"
      trim.kv_m3_h = 72.7
      trim.characteristic = "exponential"
      instruments.flow.noise_sd = 0.25
      instruments.flow_unit = "t/h"
      instruments.resolution_bits = 12)");

  EXPECT_EQ(scenario.valve_id, "LC51_03");
  const ValveSimulationConfig& config = scenario.config;
  ASSERT_EQ(config.faults.size(), 2U);
  EXPECT_EQ(config.faults[1].fault, 1);
  EXPECT_EQ(config.seed, 7U);
  EXPECT_EQ(config.duration_s, 900.0);
  EXPECT_EQ(config.period_s, 0.5);
  EXPECT_EQ(config.start_ns, 1'795'132'800'000'000'000);
  EXPECT_TRUE(config.cold_start);
  ASSERT_EQ(config.inputs.size(), 2U);
  EXPECT_EQ(config.inputs[0].cv_pct, (std::vector<double>{100.0, 60.0}));
  EXPECT_EQ(config.inputs[0].cv_noise_pct.sd, 0.5);
  EXPECT_EQ(config.inputs[1].t_s, (std::vector<double>{10.0, 20.5}));
  EXPECT_EQ(config.inputs[1].t1_degc, (std::vector<double>{20.0, 100.0}));
  ASSERT_EQ(config.modes.size(), 2U);
  EXPECT_EQ(config.modes[0], (ModeStretch{100.0, 200.0, ValveMode::kManual}));
  EXPECT_EQ(config.modes[1].mode, ValveMode::kOutOfService);
  EXPECT_GT(config.modes[1].until_s, 1e9);
  EXPECT_FALSE(config.noise);
  EXPECT_FALSE(config.resolution);
  EXPECT_EQ(config.tolerance_scale, 0.1);
  const auto& loop = std::get<LevelLoopExcitation>(config.excitation);
  EXPECT_EQ(loop.proportional_gain, 4.0);
  EXPECT_EQ(loop.pump_noise_kpa.sd, 12.5);
  EXPECT_EQ(loop.pump_noise_kpa.correlation, 0.85);
  EXPECT_EQ(config.parameters.name, "mine");
  EXPECT_EQ(config.parameters.trim.kv_m3_h, 72.7);
  EXPECT_EQ(config.parameters.trim.characteristic,
            FlowCharacteristic::kExponential);
  EXPECT_EQ(config.parameters.instruments.flow.noise_sd, 0.25);
  EXPECT_EQ(config.parameters.instruments.flow_unit, FlowUnit::kTPerHour);
  EXPECT_EQ(config.parameters.instruments.resolution_bits, 12);
}

TEST(ScenarioTomlTest, TheTextRestoresTheScenario) {
  const std::string text = ScenarioText(Read(R"(
      valve = "quote \" and \\ backslash"
      faults = ["f17:incipient@0.1+333.3:from=-0.1:strength=-0.7:until=1e4"]
      seed = 9223372036854775807
      parameters = "paper-operating-point"
      mode = [{from_s = 1, until_s = 2.5, mode = "MANUAL"}, {from_s = 9, mode = "INHIBITED"}]
      input = [{t_s = [0, 0.1], p1_kpa = [2000, 3000.5], p1_noise_kpa = {sd = 3}}, {t_s = [5, 6], cv_pct = [0, 9]}]
      [excitation]
      amplitude_pct = 0.30000000000000004
      cv_noise_pct = { sd = 0.1, correlation = 0.9 })"));

  EXPECT_EQ(ScenarioText(Read(text)), text);
  EXPECT_THAT(text, AllOf(HasSubstr("0.30000000000000004"),
                          HasSubstr("excitation.cv_noise_pct.sd = 0.1\n"),
                          HasSubstr("from=-0.1"), HasSubstr("3000.5"),
                          HasSubstr("\"INHIBITED\""),
                          HasSubstr("seed = 9223372036854775807")));
}

TEST(ScenarioTomlTest, OwnParametersAreRestoredFromTheirDifferences) {
  Scenario scenario;
  scenario.config.parameters = ParameterSet("paper-operating-point");
  scenario.config.parameters.name = "refitted";
  scenario.config.parameters.positioner.integral_time_s = 12.5;

  const Scenario restored = Read(ScenarioText(scenario));

  const ValveParameters& parameters = restored.config.parameters;
  EXPECT_EQ(parameters.name, "refitted");
  EXPECT_EQ(parameters.positioner.integral_time_s, 12.5);
  EXPECT_EQ(parameters.trim.characteristic, FlowCharacteristic::kLinear);
  EXPECT_EQ(parameters.instruments.flow_unit, FlowUnit::kM3PerHour);
}

TEST(ScenarioTomlTest, ARefusalNamesPlaceKeyAndWhatIsAccepted) {
  EXPECT_THAT(RefusalOf("seed = 1\nexitation = 'sine'"),
              AllOf(HasSubstr("test.toml:2"), HasSubstr("'exitation'"),
                    HasSubstr("'excitation'")));
  EXPECT_THAT(RefusalOf("[excitation]\nzzz = 1"),
              AllOf(HasSubstr("test.toml:2"), HasSubstr("amplitude_pct")));
  EXPECT_THAT(RefusalOf("excitation = 'noise'"),
              AllOf(HasSubstr("test.toml:1"), HasSubstr("level-loop")));
  EXPECT_THAT(RefusalOf("excitation = 'csv'"), HasSubstr("csv:FILE"));
  EXPECT_THAT(RefusalOf("parameters = 'mine'"),
              AllOf(HasSubstr("paper-operating-point"), HasSubstr(".toml")));
  EXPECT_THAT(RefusalOf("faults = ['f99:abrupt@3']"),
              AllOf(HasSubstr("test.toml:1"), HasSubstr("f1..f19")));
  EXPECT_THAT(RefusalOf("faults = ['f1:abrupt@3:strength=2']"),
              AllOf(HasSubstr("strength"), HasSubstr("1")));
  EXPECT_THAT(RefusalOf("[[mode]]\nmode = 'HAND'"),
              AllOf(HasSubstr("test.toml:2"), HasSubstr("MANUAL")));
  EXPECT_THAT(RefusalOf("[[input]]\nt_s = [1]"),
              AllOf(HasSubstr("test.toml:2"), HasSubstr("at least 2")));
  EXPECT_THAT(RefusalOf("[[input]]\nt_s = [1, 2]\nx_pct = 1\ncv_pct = [1, 2]"),
              AllOf(HasSubstr("test.toml:3"), HasSubstr("p1_kpa")));
  EXPECT_THAT(RefusalOf("duration_s = -5"), HasSubstr("-5 is not in"));
  EXPECT_THAT(RefusalOf("parameters.trim.exponent = 900"),
              AllOf(HasSubstr("trim.exponent"), HasSubstr("900")));
  EXPECT_THAT(RefusalOf("seed = -1"), HasSubstr("below 0"));
}

TEST(ScenarioTomlTest, ASettingKeepsWhatItDoesNotName) {
  Scenario scenario = Read("excitation.amplitude_pct = 3");

  ApplySetting("excitation.period_s=120", scenario);
  ApplySetting("parameters=paper-operating-point", scenario);
  ApplySetting("noise=false", scenario);

  const auto& point =
      std::get<OperatingPointExcitation>(scenario.config.excitation);
  EXPECT_EQ(point.amplitude_pct, 3.0);
  EXPECT_EQ(point.period_s, 120.0);
  EXPECT_EQ(scenario.config.parameters.name, "paper-operating-point");
  EXPECT_FALSE(scenario.config.noise);
  EXPECT_THROW(ApplySetting("noise", scenario), ConfigError);
  EXPECT_THROW(ApplySetting("noise=maybe", scenario), ConfigError);
}

// Its default pressure is 1000 kPa, at which water boils at 180 degC.
TEST(ScenarioTomlTest, AnInventoryLoopHasATemperatureOfItsMedium) {
  const auto t1_degc = [](const char* type) {
    const Scenario scenario = Read("parameters = '" + std::string(type) +
                                   "'\nexcitation = 'inventory-loop'");
    return std::get<InventoryLoopExcitation>(scenario.config.excitation)
        .t1_degc;
  };
  EXPECT_LT(t1_degc("liquid-globe"), 100.0);
  EXPECT_GT(t1_degc("steam-globe"), 180.0);
}

TEST(ScenarioTomlTest, ABypassHasTheSizeOfItsValve) {
  const storage::TemporaryDirectory folder;
  const auto bypass = [&](const char* trim) {
    std::ofstream(folder.path() / "type.toml") << "base = 'gas-globe'\n[trim]\n"
                                               << trim;
    return FindParameters("type.toml", folder.path()).trim.bypass_kv_m3_h;
  };
  EXPECT_EQ(bypass("characteristic = 'linear'"), 7.0);
  EXPECT_DOUBLE_EQ(bypass("kv_m3_h = 400.0"), 70.0);
  EXPECT_EQ(bypass("kv_m3_h = 400.0\nbypass_kv_m3_h = 9.0"), 9.0);
}

// The lines of docs/model.md from this comment on to the next empty line.
std::string ExampleOf(const std::string& comment) {
  std::ifstream page(FDI_MODEL_PAGE);
  std::string example;
  for (std::string line; std::getline(page, line);) {
    if (!example.empty() || line == "    # " + comment) {
      if (line.empty()) {
        break;
      }
      example += line + "\n";
    }
  }
  return example;
}

// As they are written, at the position of their first row, with the flows that
// the page computes by hand.
TEST(ScenarioTomlTest, TheDataSheetsOfTheModelPageAreValves) {
  struct Case {
    const char* comment;
    InputRow input;
    double flow_t_h;
  };
  for (const Case& data_sheet :
       {Case{"Globe valve for propane, DN 50: data sheet with F_L and "
             "rangeability",
             {60.3, 2000.0, 1500.0, 43.0},
             5.27},
        Case{"Steam valve, linear, with x_T",
             {60.3, 1000.0, 700.0, 190.0},
             2.60}}) {
    const storage::TemporaryDirectory folder;
    std::ofstream(folder.path() / "type.toml") << ExampleOf(data_sheet.comment);
    const ValveParameters valve = FindParameters("type.toml", folder.path());
    EXPECT_NO_THROW(Validate(valve));
    EXPECT_EQ(valve.actuator.spring, SpringAction::kToClose);
    EXPECT_NEAR(FlowReading(valve, {}, data_sheet.input, 60.3),
                data_sheet.flow_t_h, 0.02 * data_sheet.flow_t_h)
        << data_sheet.comment;
  }
}

TEST(ScenarioTomlTest, ACsvExcitationKeepsTheModes) {
  const storage::TemporaryDirectory folder;
  std::ofstream(folder.path() / "in.csv")
      << "t_s,CV_pct,P1_kPa,P2_kPa,T1_degC,X_pct,mode\n"
         "0,50,3500,2600,40,50,AUTO\n1,51,3501,2601,41,50,MANUAL\n";
  Scenario scenario;
  ChooseExcitation("csv:in.csv", folder.path(), scenario);
  const auto& rows =
      std::get<RecordedExcitation>(scenario.config.excitation).rows;
  EXPECT_EQ(rows[0].mode, ValveMode::kAuto);
  EXPECT_EQ(rows[1].mode, ValveMode::kManual);
}

TEST(ScenarioTomlTest, TheOperationScenariosCanBeRead) {
  int count = 0;
  for (const auto& entry :
       std::filesystem::directory_iterator(FDI_OPERATION_SCENARIOS)) {
    Scenario scenario;
    ApplyScenarioFile(entry.path(), scenario);
    EXPECT_NO_THROW(Validate(scenario.config)) << entry.path();
    ++count;
  }
  EXPECT_GE(count, 6);
}

TEST(ScenarioTomlTest, ACsvExcitationGivesPeriodAndDurationUnlessOverruled) {
  const storage::TemporaryDirectory folder;
  std::ofstream(folder.path() / "in.csv")
      << "t_s,CV_pct,P1_kPa,P2_kPa,T1_degC,X_pct\n"
         "0,50,3500,2600,40,50\n2,51,3501,2601,41,50\n4,52,3502,2602,42,50\n";
  std::ofstream(folder.path() / "a.toml") << "excitation = 'csv:in.csv'\n";
  std::ofstream(folder.path() / "b.toml")
      << "excitation = 'csv:in.csv'\nduration_s = 4\n";
  Scenario whole;
  Scenario part;

  ApplyScenarioFile(folder.path() / "a.toml", whole);
  ApplyScenarioFile(folder.path() / "b.toml", part);

  EXPECT_EQ(whole.config.period_s, 2.0);
  EXPECT_EQ(whole.config.duration_s, 6.0);
  EXPECT_EQ(part.config.duration_s, 4.0);
  const auto& rows = std::get<RecordedExcitation>(whole.config.excitation).rows;
  ASSERT_EQ(rows.size(), 3U);
  EXPECT_EQ(rows[1].p1_kpa, 3501.0);
  EXPECT_THAT(ScenarioText(whole), HasSubstr("\"csv:in.csv\""));
}

TEST(ScenarioTomlTest, ATypeIsFilledFromADataSheet) {
  const ValveParameters valve = Read(R"(
      [parameters]
      base = "steam-globe"
      [parameters.trim]
      kv_m3_h = 63
      rangeability = 30
      choked_pressure_ratio = 0.68
      [parameters.actuator]
      spring = "to-close"
      [parameters.instruments]
      flow = { low = 0, high = 12 }
  )")
                                    .config.parameters;
  EXPECT_EQ(valve.medium.fluid, Fluid::kSteam);
  EXPECT_NEAR(valve.trim.exponent, 3.4012, 1e-4);
  EXPECT_EQ(valve.trim.choked_pressure_ratio, 0.68);
  EXPECT_EQ(valve.actuator.spring, SpringAction::kToClose);
  EXPECT_EQ(valve.instruments.flow.high, 12.0);
}

TEST(ScenarioTomlTest, ATableOfTheTrimIsRestored) {
  Scenario scenario;
  Trim& trim = scenario.config.parameters.trim;
  trim.characteristic = FlowCharacteristic::kTable;
  trim.table_h = {0.5, 1.0};
  trim.table_f = {0.2, 1.0};
  scenario.config.parameters.name = "mine";

  const Trim restored = Read(ScenarioText(scenario)).config.parameters.trim;

  EXPECT_EQ(restored.characteristic, FlowCharacteristic::kTable);
  EXPECT_EQ(restored.table_h, trim.table_h);
  EXPECT_EQ(restored.table_f, trim.table_f);
}

TEST(ScenarioTomlTest, ATypeWithAWrongKeyOrValueIsRefused) {
  EXPECT_THAT(RefusalOf("parameters.medium.fluid = 'syrup'"),
              AllOf(HasSubstr("'syrup'"), HasSubstr("water, liquid, gas")));
  EXPECT_THAT(RefusalOf("parameters.medium.desity_kg_m3 = 900"),
              AllOf(HasSubstr("desity_kg_m3"), HasSubstr("density_kg_m3")));
  EXPECT_THAT(RefusalOf("parameters.trim = {rangeability = 50, exponent = 4}"),
              HasSubstr("rangeability"));
  EXPECT_THAT(RefusalOf("parameters.trim.characteristic = 'table'"),
              HasSubstr("table_h"));
}

TEST(ScenarioTomlTest, AParameterFileLiesBesideItsScenario) {
  const storage::TemporaryDirectory folder;
  std::ofstream(folder.path() / "valve.toml")
      << "base = 'lublin-actuator-3-refit'\n[trim]\nkv_m3_h = 60\n";
  std::ofstream(folder.path() / "a.toml") << "parameters = 'valve.toml'\n";
  Scenario scenario;

  ApplyScenarioFile(folder.path() / "a.toml", scenario);

  EXPECT_EQ(scenario.config.parameters.trim.kv_m3_h, 60.0);
  EXPECT_EQ(scenario.config.parameters.positioner.filling_cv,
            ParameterSet("lublin-actuator-3-refit").positioner.filling_cv);
}

}  // namespace
}  // namespace fdi::simulator
