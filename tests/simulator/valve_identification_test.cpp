#include "simulator/valve_identification.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "base/error.h"
#include "simulator/random.h"
#include "simulator/valve_simulation.h"

namespace fdi::simulator {
namespace {

// A command that is set anew every 5..25 s and jitters in between, as a level
// controller moves it.
std::vector<InputRow> BusyInputs(std::size_t count, std::uint64_t seed,
                                 double jitter_pct) {
  NormalSource noise(seed, 7);
  DisturbanceProcess p1({22.0, 0.85}, {seed, 8});
  DisturbanceProcess p2({13.0, 0.6}, {seed, 9});
  std::vector<InputRow> rows;
  double level = 60.0;
  std::size_t until = 0;
  for (std::size_t k = 0; k < count; ++k) {
    if (k == until) {
      level = std::clamp(62.0 + 12.0 * noise(), 46.0, 85.0);
      until = k + 5 +
              static_cast<std::size_t>(std::min(20.0, 8.0 * std::abs(noise())));
    }
    rows.push_back({std::clamp(level + jitter_pct * noise(), 44.0, 90.0),
                    3555.0 + p1.Next(), 2615.0 + p2.Next(), 100.7});
  }
  return rows;
}

// Records the readings of such a valve's transmitters, noise on.
HealthyRecord Recording(const ValveParameters& parameters, std::size_t count,
                        std::uint64_t seed, bool interpolated = false,
                        double jitter_pct = 0.8, double period_s = 1.0) {
  ValveSimulationConfig config;
  config.parameters = parameters;
  config.excitation = RecordedExcitation{BusyInputs(count, seed, jitter_pct)};
  config.continuous_inputs = interpolated;
  config.period_s = period_s;
  config.duration_s = static_cast<double>(count) * period_s;
  config.seed = seed;
  ValveSimulation simulation(config);
  HealthyRecord record;
  while (!simulation.finished()) {
    const Sample s = simulation.Step().sample;
    record.rows.push_back(
        {{s[Signal::kCv], s[Signal::kP1], s[Signal::kP2], s[Signal::kT1]},
         s[Signal::kX],
         s[Signal::kF]});
  }
  return record;
}

const FittedParameter& Named(const ValveFit& fit, const std::string& name) {
  const auto found =
      std::find_if(fit.values.begin(), fit.values.end(),
                   [&](const FittedParameter& p) { return p.name == name; });
  if (found == fit.values.end()) {
    throw NotFoundError(name);
  }
  return *found;
}

// The refit with the parameters a healthy record should tell moved.
ValveParameters MovedRefit(double kv, double exponent, double cv,
                           double filter) {
  ValveParameters valve = ParameterSet("lublin-actuator-3-refit");
  valve.trim.kv_m3_h *= kv;
  valve.trim.exponent *= exponent;
  valve.positioner.filling_cv *= cv;
  valve.positioner.venting_cv *= cv;
  valve.positioner.filter_time_s *= filter;
  return valve;
}

void ExpectRecovered(const ValveFit& fit, const std::string& name, double truth,
                     double share) {
  const FittedParameter& p = Named(fit, name);
  EXPECT_TRUE(p.identified) << name << " sd " << p.relative_sd;
  EXPECT_NEAR(p.value / truth, 1.0, share) << name;
}

class RecoveryTest : public ::testing::TestWithParam<int> {};

TEST_P(RecoveryTest, RecoversTheParametersOfASimulatedValve) {
  const double sign = GetParam() > 0 ? 1.0 : -1.0;
  const ValveParameters truth = MovedRefit(1.0 + 0.2 * sign, 1.0 - 0.15 * sign,
                                           1.0 + 0.2 * sign, 1.0 + 0.3 * sign);
  const bool interpolated = GetParam() > 0;
  const HealthyRecord record = Recording(truth, 800, 3, interpolated);
  const ValveFit fit =
      FitValve({record}, ParameterSet("lublin-actuator-3-refit"));
  EXPECT_EQ(fit.interpolated_command, interpolated);
  EXPECT_EQ(fit.command_delay, 0);
  EXPECT_EQ(fit.parameters.positioner.relay, AirRelay::kCompressible);
  EXPECT_EQ(fit.parameters.actuator.coulomb_friction_n, 0.0);
  ExpectRecovered(fit, "trim.kv_m3_h", truth.trim.kv_m3_h, 0.05);
  ExpectRecovered(fit, "trim.exponent", truth.trim.exponent, 0.05);
  ExpectRecovered(fit, "positioner.filling_cv", truth.positioner.filling_cv,
                  0.10);
  ExpectRecovered(fit, "positioner.venting_cv", truth.positioner.venting_cv,
                  0.05);
  ExpectRecovered(fit, "positioner.filter_time_s",
                  truth.positioner.filter_time_s, 0.05);
  const RecordFit floor =
      FitToRecord(truth, record.rows, 60, 800, {1.0, interpolated});
  EXPECT_LE(fit.fitted.x_rmse_pct, 1.05 * floor.x_rmse_pct);
  EXPECT_LE(fit.fitted.flow_rmse, 1.05 * floor.flow_rmse);
  EXPECT_LE(std::abs(fit.fitted.flow_bias), 0.1 * floor.flow_rmse);
  EXPECT_GT(fit.nominal.flow_rmse, 2.0 * floor.flow_rmse);
  for (const char* name : {"positioner.gain", "actuator.play_fraction",
                           "actuator.supply_pressure_gauge_pa"}) {
    EXPECT_FALSE(Named(fit, name).identified) << name;
    EXPECT_EQ(Named(fit, name).value, Named(fit, name).nominal) << name;
  }
}

INSTANTIATE_TEST_SUITE_P(ValveIdentification, RecoveryTest,
                         ::testing::Values(-1, 1));

TEST(ValveIdentificationTest, FindsTheSpeedOfAMotor) {
  ValveParameters nominal = ParameterSet("lublin-actuator-3-refit");
  nominal.actuator.drive = ActuatorDrive::kElectric;
  ValveParameters truth = nominal;
  truth.actuator.stroke_time_s = 90.0;
  truth.trim.kv_m3_h *= 1.2;
  const ValveFit fit = FitValve({Recording(truth, 800, 3)}, nominal);
  ExpectRecovered(fit, "actuator.stroke_time_s", 90.0, 0.05);
  ExpectRecovered(fit, "trim.kv_m3_h", truth.trim.kv_m3_h, 0.05);
  EXPECT_EQ(fit.parameters.actuator.coulomb_friction_n, 0.0);
  EXPECT_EQ(fit.parameters.positioner.filling_cv,
            nominal.positioner.filling_cv);
}

// A row of half a minute is simulated for half a minute: the motor may still
// run at its end.
TEST(ValveIdentificationTest, FindsTheSpeedOfAMotorInSlowRows) {
  ValveParameters nominal = ParameterSet("lublin-actuator-3-refit");
  nominal.actuator.drive = ActuatorDrive::kElectric;
  ValveParameters truth = nominal;
  truth.actuator.stroke_time_s = 200.0;
  const HealthyRecord record = Recording(truth, 600, 3, false, 0.8, 30.0);
  const ValveFit fit = FitValve({record}, nominal, {.period_s = 30.0});
  ExpectRecovered(fit, "actuator.stroke_time_s", 200.0, 0.1);
}

// As much flow where the record is, from a much smaller valve.
TEST(ValveIdentificationTest, FindsAFlatTrim) {
  const ValveParameters nominal = ParameterSet("lublin-actuator-3-refit");
  ValveParameters truth = nominal;
  truth.trim.exponent = 1.5;
  truth.trim.kv_m3_h *= std::exp(0.6 * (1.5 - nominal.trim.exponent));
  const ValveFit fit = FitValve({Recording(truth, 400, 3)}, nominal);
  ExpectRecovered(fit, "trim.kv_m3_h", truth.trim.kv_m3_h, 0.05);
  ExpectRecovered(fit, "trim.exponent", truth.trim.exponent, 0.05);
}

// The command of a row acts over the period before its stamp.
TEST(ValveIdentificationTest, FindsTheDelayOfTheCommand) {
  const ValveParameters truth = ParameterSet("lublin-actuator-3-refit");
  HealthyRecord record = Recording(truth, 400, 3);
  for (std::size_t k = record.rows.size() - 1; k > 0; --k) {
    record.rows[k].input.cv_pct = record.rows[k - 1].input.cv_pct;
  }
  EXPECT_EQ(FitValve({record}, truth).command_delay, -1);
}

// Tags that a historian stores when they change have hardly a row in common.
TEST(ValveIdentificationTest, ReadingsAtDifferentTimesTellTheSize) {
  ValveParameters truth = ParameterSet("lublin-actuator-3-refit");
  HealthyRecord record = Recording(truth, 800, 3);
  for (std::size_t k = 0; k < record.rows.size(); ++k) {
    record.rows[k].x_measured = k % 8 == 0;
    record.rows[k].flow_measured = k % 8 == 4;
  }
  truth.trim.kv_m3_h *= 6.0;
  EXPECT_NEAR(SizeOf({record}, truth), 1.0 / 6.0, 0.01);
}

TEST(ValveIdentificationTest, FindsTheAirRelayAndDoesNotNeedFlow) {
  ValveParameters truth = ParameterSet("lublin-actuator-3");
  truth.positioner.orifice_coefficient *= 1.2;
  const HealthyRecord record = Recording(truth, 300, 5);
  ValveFitOptions options;
  options.has_flow = false;
  options.threads = 1;
  const ValveParameters nominal = ParameterSet("lublin-actuator-3-refit");
  const ValveFit fit = FitValve({record}, nominal, options);
  EXPECT_EQ(fit.parameters.positioner.relay, AirRelay::kOrifice);
  EXPECT_TRUE(fit.parameters.positioner.transducer_dead_zone);
  ExpectRecovered(fit, "positioner.orifice_coefficient",
                  truth.positioner.orifice_coefficient, 0.05);
  EXPECT_EQ(fit.parameters.trim.kv_m3_h, nominal.trim.kv_m3_h);
  EXPECT_EQ(fit.parameters.trim.exponent, nominal.trim.exponent);
  options.threads = 3;
  const ValveFit again = FitValve({record}, nominal, options);
  for (std::size_t i = 0; i < fit.values.size(); ++i) {
    EXPECT_EQ(fit.values[i].value, again.values[i].value);
  }
}

// Noise of the recorded pressures, which act on the simulated plug, would raise
// the gain by a quarter: here they are exact.
TEST(ValveIdentificationTest, LeavesAStatedValueThatDoesNotFit) {
  ValveParameters truth = ParameterSet("lublin-actuator-3-refit");
  truth.positioner.gain = 40.0;
  truth.instruments.pressure.noise_sd = 0.0;
  const HealthyRecord record = Recording(truth, 800, 6);
  const ValveFit fit =
      FitValve({record}, ParameterSet("lublin-actuator-3-refit"));
  EXPECT_EQ(fit.command_delay, 0);
  ExpectRecovered(fit, "positioner.gain", 40.0, 0.1);
}

// Without friction, the fit follows X three times worse, with a later command.
TEST(ValveIdentificationTest, FindsFrictionInsteadOfALaterCommand) {
  const ValveParameters nominal = ParameterSet("lublin-actuator-3-refit");
  ValveParameters truth = nominal;
  truth.actuator.coulomb_friction_n = 150.0;
  const HealthyRecord record = Recording(truth, 800, 6);
  const ValveFit fit = FitValve({record}, nominal);
  EXPECT_EQ(fit.command_delay, 0);
  ExpectRecovered(fit, "actuator.coulomb_friction_n", 150.0, 0.1);
  EXPECT_LE(fit.fitted.x_rmse_pct,
            1.1 * FitToRecord(truth, record.rows, 60, 800).x_rmse_pct);
}

// A controller that moves the command by several per cent in every sample: the
// rod is never where the command is.
TEST(ValveIdentificationTest, RegressesTheTrimOnTheSimulatedRod) {
  const ValveParameters nominal = ParameterSet("lublin-actuator-3-refit");
  ValveParameters truth = nominal;
  truth.trim.kv_m3_h *= 1.2;
  truth.instruments.flow.high *= 2.0;
  constexpr double kJitterPct = 8.0;
  HealthyRecord record = Recording(truth, 200, 3, false, kJitterPct);
  for (RecordRow& row : record.rows) {
    row.x_pct = row.input.cv_pct;
    row.x_measured = false;
  }
  const HealthyRecord with_rod =
      WithSimulatedRod(record.rows, 0, record.rows.size(), nominal, {});
  ASSERT_EQ(with_rod.rows.size(), record.rows.size());
  const Trim on_command = RegressTrim({record}, nominal);
  const Trim on_rod = RegressTrim({with_rod}, nominal);
  EXPECT_LT(on_command.kv_m3_h, 0.7 * truth.trim.kv_m3_h);
  EXPECT_NEAR(on_rod.kv_m3_h, truth.trim.kv_m3_h, 0.1 * truth.trim.kv_m3_h);
  EXPECT_NEAR(on_rod.exponent, truth.trim.exponent, 0.05 * truth.trim.exponent);
}

// However wide its interval is: with the nominal value F would be further off.
TEST(ValveIdentificationTest, KeepsWhatIsSurelyNotNominalWithoutAPosition) {
  const ValveParameters nominal = ParameterSet("lublin-actuator-3-refit");
  ValveParameters truth = nominal;
  truth.trim.kv_m3_h *= 1.4;
  truth.instruments.flow.high *= 2.0;
  HealthyRecord record = Recording(truth, 180, 3);
  for (RecordRow& row : record.rows) {
    row.x_pct = row.input.cv_pct;
    row.x_measured = false;
  }
  ValveFitOptions options;
  options.identified_sd = 1e-6;  // No interval is as narrow as that.
  const ValveFit fit = FitValve({record}, nominal, options);
  ExpectRecovered(fit, "trim.kv_m3_h", truth.trim.kv_m3_h, 0.1);
  EXPECT_FALSE(Named(fit, "positioner.filter_time_s").identified);
}

TEST(RecordFitTest, FilledInReadingsDoNotCount) {
  const ValveParameters truth = ParameterSet("lublin-actuator-3-refit");
  HealthyRecord record = Recording(truth, 300, 3);
  const RecordFit whole = FitToRecord(truth, record.rows, 60, 300);
  for (std::size_t k = 0; k < record.rows.size(); k += k % 3 + 1) {
    RecordRow& row = record.rows[k];
    row.x_pct += 15.0;
    row.flow *= 1.5;
    row.x_measured = row.flow_measured = false;
  }
  const RecordFit rest = FitToRecord(truth, record.rows, 60, 300);
  EXPECT_NEAR(rest.x_rmse_pct, whole.x_rmse_pct, 0.3 * whole.x_rmse_pct);
  EXPECT_NEAR(rest.flow_rmse, whole.flow_rmse, 0.3 * whole.flow_rmse);
  EXPECT_LT(std::abs(rest.x_bias_pct), whole.x_rmse_pct);
}

TEST(ValveIdentificationTest, LeavesAStatedValueAloneThatRunsToABound) {
  ValveParameters nominal = ParameterSet("lublin-actuator-3-refit");
  nominal.actuator.coulomb_friction_n = 50.0;  // Not a choice then.
  ValveParameters truth = nominal;
  truth.positioner.gain /= 8.0;  // Searched down to 1/5.
  truth.instruments.pressure.noise_sd = 0.0;
  ValveFitOptions options;
  options.least_gain = 0.0;
  options.identified_sd = 1.0;
  const ValveFit fit = FitValve({Recording(truth, 400, 3)}, nominal, options);
  const FittedParameter gain = Named(fit, "positioner.gain");
  EXPECT_FALSE(gain.identified);
  EXPECT_EQ(gain.value, gain.nominal);
}

TEST(ValveIdentificationTest, NamesWhatItCannotUse) {
  const ValveParameters valve = ParameterSet("lublin-actuator-3-refit");
  HealthyRecord record = Recording(valve, 179, 1);
  EXPECT_THROW(FitValve({record}, valve), DataError);
  EXPECT_THROW(FitValve({}, valve), DataError);
  record = Recording(valve, 200, 1);
  record.rows[17].x_pct = std::numeric_limits<double>::quiet_NaN();
  try {
    FitValve({record}, valve);
    FAIL() << "expected DataError";
  } catch (const DataError& error) {
    EXPECT_NE(std::string(error.what()).find("row 17"), std::string::npos);
  }
  ValveFitOptions options;
  options.max_rows = 10;
  EXPECT_THROW(FitValve({record}, valve, options), ConfigError);
}

}  // namespace
}  // namespace fdi::simulator
