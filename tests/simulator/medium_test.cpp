// The flow equations of IEC 60534-2-1:2011 against the examples of the
// standard, as public implementations carry them (CalebBell/fluids, MIT), and
// computed statics of an independent gas valve. Pressures in kPa.
#include <algorithm>
#include <cmath>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "base/error.h"
#include "simulator/control_valve.h"
#include "simulator/valve_equations.h"
#include "simulator/valve_simulation.h"

namespace fdi::simulator {
namespace {

constexpr double kNormalVolume = 22.414;  // m3/kmol at 0 degC, 101.325 kPa

Medium Gas(double molar_mass, double gamma, double z) {
  Medium gas;
  gas.fluid = Fluid::kGas;
  gas.molar_mass_kg_kmol = molar_mass;
  gas.isentropic_exponent = gamma;
  gas.compressibility = z;
  return gas;
}

Medium Steam() {
  Medium steam;
  steam.fluid = Fluid::kSteam;
  return steam;
}

Medium HotWater() {  // of E1 and E2
  Medium liquid;
  liquid.fluid = Fluid::kLiquid;
  liquid.density_kg_m3 = 965.4;
  liquid.vapour_pressure_kpa = 70.1;
  liquid.critical_pressure_kpa = 22120.0;
  return liquid;
}

struct Sizing {
  std::string name;
  Medium medium;
  double recovery;  // F_L
  double choked;    // x_T
  double p1, p2, t1_c;
  double mass_t_h;
  double kv;
};

double NormalT(double m3_h, double molar_mass) {
  return 1e-3 * m3_h * molar_mass / kNormalVolume;
}

const Sizing kExamples[] = {
    {"E1 water", HotWater(), 0.90, 0.7, 680, 220, 90, 360 * 0.9654, 164.996},
    {"E2 choked", HotWater(), 0.60, 0.7, 680, 220, 90, 360 * 0.9654, 238.06},
    {"E3 CO2", Gas(44.01, 1.30, 0.991), 0.9, 0.60, 680, 450, 159.85,
     NormalT(3800, 44.01), 67.29},
    {"E4 CO2 choked", Gas(44.01, 1.30, 0.991), 0.9, 0.60, 680, 250, 159.85,
     NormalT(3800, 44.01), 62.73},
    {"E5 CO2", Gas(44.01, 1.30, 0.988), 0.9, 0.60, 680, 310, 159.85,
     NormalT(3800, 44.01), 62.65},
    {"E5r reducers", Gas(44.01, 1.30, 0.988), 0.9, 0.6253, 680, 310, 159.85,
     NormalT(3800, 44.01), 70.89 * 0.8669},
    {"E6 argon", Gas(39.95, 1.67, 1.0), 0.9, 0.8, 280, 130, 46.85,
     NormalT(0.46, 39.95), 0.0126914},
    {"E8 steam", Steam(), 0.9, 0.72, 1000, 700, 190, 10.3998, 100},
    {"E8 choked", Steam(), 0.9, 0.72, 1000, 300, 190, 12.1705, 100},
    {"E9 steam", Steam(), 0.9, 0.60, 4000, 2500, 400, 17.515, 50}};

Trim TrimOf(const Sizing& e) {
  Trim trim;
  trim.characteristic = FlowCharacteristic::kLinear;
  trim.liquid_recovery = e.recovery;
  trim.choked_pressure_ratio = e.choked;
  trim.kv_m3_h = e.kv;
  return trim;
}

ValveParameters ValveOf(const Sizing& e) {
  ValveParameters valve;
  valve.trim = TrimOf(e);
  valve.medium = e.medium;
  return valve;
}

double MassFlow(const ValveParameters& valve, double p1, double p2,
                double t1_c) {
  return FlowOf(valve, {}, {0.0, 1e3 * p1, 1e3 * p2, t1_c}, 0.0, 0.0);
}

TEST(MediumTest, FlowIsThatOfTheStandardsExamples) {
  for (const Sizing& e : kExamples) {
    SCOPED_TRACE(e.name);
    EXPECT_NEAR(MassFlow(ValveOf(e), e.p1, e.p2, e.t1_c) / e.mass_t_h, 1.0,
                1e-3);
  }
}

Sample FlowReading(double flow) {
  Sample sample;
  sample.Set(Signal::kF, flow);
  sample.flow_unit = FlowUnit::kM3PerHour;
  return sample;
}

TEST(FlowConversionTest, TakesTheDensityOfTheMediumAtTheInlet) {
  Sample sample = FlowReading(100.0);
  FlowConversion water({FlowUnit::kTPerHour});
  water.Apply(sample);
  EXPECT_NEAR(sample[Signal::kF], 99.82, 0.01);  // 20 degC
  EXPECT_EQ(sample.flow_unit, FlowUnit::kTPerHour);

  // E8: steam of 1 MPa and 190 degC has 4.992 kg/m3.
  FlowConversion steam({FlowUnit::kTPerHour, Steam()});
  sample = FlowReading(100.0);
  sample.Set(Signal::kP1, 1000.0);
  sample.Set(Signal::kT1, 190.0);
  steam.Apply(sample);
  EXPECT_NEAR(sample[Signal::kF], 0.4992, 0.0015);
  // The last known P1 and T1 count where one is missing.
  sample = FlowReading(100.0);
  steam.Apply(sample);
  EXPECT_NEAR(sample[Signal::kF], 0.4992, 0.0015);

  FlowConversion usual({FlowUnit::kTPerHour, Steam(), 1000.0, 190.0});
  sample = FlowReading(100.0);
  usual.Apply(sample);
  EXPECT_NEAR(sample[Signal::kF], 0.4992, 0.0015);
}

TEST(FlowConversionTest, GasWithoutAPressureIsRefused) {
  FlowConversion gas({FlowUnit::kTPerHour, Gas(28.96, 1.4, 1.0)});
  Sample sample = FlowReading(100.0);
  EXPECT_THROW(gas.Apply(sample), DataError);
  sample.flow_unit = FlowUnit::kTPerHour;
  EXPECT_NO_THROW(gas.Apply(sample));  // Nothing to convert.
}

TEST(MediumTest, CapacityIsTheInverseOfTheFlow) {
  for (const Sizing& e : kExamples) {
    SCOPED_TRACE(e.name);
    const MediumState state =
        MediumAt(e.medium, 1e3 * e.p1, 1e3 * e.p2, e.t1_c);
    const double m3_h =
        FlowFromUnit(FlowUnit::kTPerHour, e.mass_t_h, state.density_kg_m3);
    EXPECT_NEAR(CapacityFor(m3_h, TrimOf(e), state, 0.0) / e.kv, 1.0, 1e-3);
  }
}

TEST(MediumTest, IntermediateFiguresAreThoseOfTheExamples) {
  EXPECT_NEAR(MediumAt(HotWater(), 680e3, 220e3, 90).critical_ratio, 0.94424,
              1e-5);
  EXPECT_NEAR(
      EffectivePressureDrop(MediumAt(HotWater(), 680e3, 0.0, 90), 0.81, 0.7),
      497.19e3, 10.0);
  const auto expansion = [](const Medium& gas, double p2, double choked) {
    const MediumState state = MediumAt(gas, 680e3, 1e3 * p2, 159.85);
    const double x =
        std::min(1.0 - p2 / 680.0, choked * state.gas_factor) * 680e3;
    return std::sqrt(EffectivePressureDrop(state, 0.81, choked) / x);
  };
  EXPECT_NEAR(expansion(Gas(44.01, 1.30, 0.991), 450, 0.60), 0.7976, 1e-4);
  EXPECT_NEAR(expansion(Gas(44.01, 1.30, 0.991), 250, 0.60), 0.6667, 1e-4);
  EXPECT_NEAR(
      MediumAt(Gas(44.01, 1.30, 0.991), 680e3, 4e5, 159.85).density_kg_m3,
      8.389, 1e-3);
}

// E7: beyond the choke point P2 has no effect at all, before it has one.
TEST(MediumTest, ChokedFlowDoesNotDependOnTheOutletPressure) {
  Medium liquid = HotWater();
  liquid.vapour_pressure_kpa = 69.683;
  liquid.critical_pressure_kpa = 22048.3;
  const Sizing water{"", liquid, 0.6, 0.7, 0, 0, 0, 0, 1};
  const Sizing gas{"", Gas(28.96, 1.3, 1.0), 0.9, 1.0, 0, 0, 0, 0, 1};
  for (const auto& [e, p1, choke] :
       {std::tuple{water, 680.0, 458.89}, {gas, 100.0, 7.1429}}) {
    const ValveParameters valve = ValveOf(e);
    const double choked = MassFlow(valve, p1, 0.999 * choke, 90.0);
    EXPECT_EQ(MassFlow(valve, p1, 0.5 * choke, 90.0), choked);
    EXPECT_EQ(MassFlow(valve, p1, 0.0, 90.0), choked);
    EXPECT_LT(MassFlow(valve, p1, 1.05 * choke, 90.0), choked);
  }
  EXPECT_EQ(MassFlow(ValveOf(gas), 100.0, 120.0, 90.0), 0.0);  // reversed
}

// Steam of IAPWS IF97 [kg/m3].
TEST(MediumTest, SteamDensityIsThatOfIf97) {
  const auto density = [](double mpa, double t_c) {
    return SteamDensity(1e6 * mpa, t_c);
  };
  EXPECT_NEAR(density(1.0, 190.0) / 4.992, 1.0, 3e-3);
  EXPECT_NEAR(density(4.0, 400.0) / 13.618, 1.0, 3e-3);
  EXPECT_NEAR(density(0.1, 150.0) / 0.51635, 1.0, 3e-3);
  EXPECT_NEAR(density(10.0, 500.0) / 30.478, 1.0, 3e-3);
  // Below saturation, of the saturated steam.
  EXPECT_EQ(density(1.0, 100.0), density(1.0, 20.0));
}

TEST(MediumTest, SaturationTemperatureIsThatOfIf97) {
  EXPECT_NEAR(SaturationTemperature(0.1e6), 372.755919 - 273.15, 1e-5);
  EXPECT_NEAR(SaturationTemperature(1e6), 453.035632 - 273.15, 1e-5);
  EXPECT_NEAR(SaturationTemperature(10e6), 584.149488 - 273.15, 1e-5);
}

// The gas valve of the independent model: Kv 400, linear without shut-off.
ValveParameters GasValve() {
  ValveParameters valve = ParameterSet("lublin-actuator-3");
  valve.trim.kv_m3_h = 400.0;
  valve.trim.characteristic = FlowCharacteristic::kLinear;
  valve.trim.choked_pressure_ratio = 0.72;
  valve.medium = Gas(18.02, 1.3, 0.95);
  valve.instruments.flow.high = 100.0;
  return valve;
}

Sample AtRest(const ValveParameters& valve, double cv, double p2, double t1_c,
              int fault = 0, double strength = 0.0, double p1 = 1000.0) {
  ValveSimulationConfig config;
  config.parameters = valve;
  OperatingPointExcitation excitation;
  excitation.cv_pct = cv;
  excitation.p1_kpa = p1;
  excitation.p2_kpa = p2;
  excitation.t1_degc = t1_c;
  excitation.cv_noise_pct = excitation.p1_noise_kpa =
      excitation.p2_noise_kpa = {};
  // A relay in balance passes no air, whatever it is supplied with: the command
  // has to move.
  if (fault == 16 && strength > 0.8) {
    excitation.amplitude_pct = 1.0;
    excitation.period_s = 10.0;
  }
  config.excitation = excitation;
  config.duration_s = 120.0;
  config.noise = false;
  config.resolution = false;
  if (fault > 0) {
    FaultSchedule schedule;
    schedule.fault = fault;
    schedule.final_strength = strength;
    config.faults = {schedule};
  }
  ValveSimulation simulation(config);
  Sample last;
  while (!simulation.finished()) {
    last = simulation.Step().sample;
  }
  return last;
}

struct Static {
  double cv, p2, t1_c, f;
};

TEST(MediumTest, StaticsAreThoseOfTheIndependentGasModel) {
  for (const Static& s : {Static{0, 700, 190, 41.3233},
                          {20, 700, 190, 33.4148},
                          {40, 700, 190, 24.9639},
                          {60, 700, 190, 16.3250},
                          {80, 700, 190, 7.87558},
                          {50, 950, 190, 9.66327},
                          {50, 900, 190, 13.3165},
                          {50, 700, 190, 20.6443},
                          {50, 500, 190, 23.5267},
                          {50, 400, 190, 24.0606},
                          {50, 332, 190, 24.1594},
                          {50, 300, 190, 24.1594},
                          {50, 100, 190, 24.1594},
                          {50, 700, 180, 20.8709},
                          {50, 700, 200, 20.4250}}) {
    SCOPED_TRACE(std::to_string(s.cv) + " " + std::to_string(s.p2));
    EXPECT_NEAR(AtRest(GasValve(), s.cv, s.p2, s.t1_c)[Signal::kF] / s.f, 1.0,
                5e-3);
  }
  EXPECT_NEAR(AtRest(GasValve(), 97.5, 700, 190)[Signal::kX], 97.7527, 0.02);
}

// X and F of faults at CV 50, P2 700.
TEST(MediumTest, FaultsOfTheGasValveAreThoseOfTheIndependentModel) {
  struct Effect {
    int fault;
    double strength, x, f;
  };
  for (const Effect& e : {Effect{1, 0.5, 50.0, 20.6616},
                          {2, 0.5, 50.0419, 14.8608},
                          {3, 0.5, 50.0419, 23.8460},
                          {5, 1.0, 50.0419, 19.6121},
                          {6, 0.5, 50.0419, 22.7105},
                          {7, 0.25, 50.0419, 18.5578},
                          {10, 0.5, 49.524, 20.8582},
                          {11, 0.5, 50.0419, 20.6443},
                          {12, 0.5, 50.0419, 20.6443},
                          {16, 0.5, 50.0419, 20.6443},
                          {16, 0.81, 0.0, 41.3233},
                          {17, 0.25, 50.0419, 23.3117},
                          {18, 0.5, 50.0419, 24.0535},
                          {19, 0.25, 50.0419, 15.4832}}) {
    SCOPED_TRACE("f" + std::to_string(e.fault));
    ValveParameters valve = GasValve();
    valve.trim.bypass_kv_m3_h = 66.0;
    const Sample sample = AtRest(valve, 50, 700, 190, e.fault, e.strength);
    EXPECT_NEAR(sample[Signal::kX], e.x, 0.05);
    EXPECT_NEAR(sample[Signal::kF] / e.f, 1.0, 5e-3);
  }
}

// The choked flow of a gas is proportional to P1 sqrt(M / (Z T)).
TEST(MediumTest, ChokedGasIsProportionalToTheInletPressure) {
  ValveParameters valve = GasValve();
  const double one = MassFlow(valve, 1000, 100, 190);
  EXPECT_NEAR(MassFlow(valve, 1500, 100, 190) / one, 1.5, 1e-9);
  valve.medium.molar_mass_kg_kmol *= 4.0;
  EXPECT_NEAR(MassFlow(valve, 1000, 100, 190) / one, 2.0, 1e-9);
}

// F / F0 is all that the loop knows of the valve: size and medium change the
// command by rounding only.
TEST(InventoryLoopTest, KeepsValvesOfAnySizeAboutTheirPoint) {
  std::vector<double> commands;
  for (const double kv : {400.0, 0.04}) {
    ValveSimulationConfig config;
    config.parameters = GasValve();
    config.parameters.trim.kv_m3_h = kv;
    config.excitation = InventoryLoopExcitation{};
    config.duration_s = 1800.0;
    config.noise = config.resolution = false;
    ValveSimulation simulation(config);
    double sum = 0.0;
    double squares = 0.0;
    while (!simulation.finished()) {
      const double cv = simulation.Step().sample[Signal::kCv];
      sum += cv / 1800.0;
      squares += cv * cv / 1800.0;
    }
    EXPECT_NEAR(sum, 60.0, 5.0);
    EXPECT_GT(std::sqrt(squares - sum * sum), 1.0);
    commands.push_back(sum);
  }
  EXPECT_NEAR(commands[0], commands[1], 1e-3);
}

TEST(ActionTest, ValveThatTheSpringClosesFollowsItsCommand) {
  ValveParameters valve = GasValve();
  valve.actuator.spring = SpringAction::kToClose;
  const ValveParameters opens = GasValve();
  for (const double cv : {20.0, 50.0, 80.0}) {
    EXPECT_NEAR(AtRest(valve, cv, 700, 190)[Signal::kX], cv, 1.5);
    EXPECT_NEAR(AtRest(opens, cv, 700, 190)[Signal::kX], cv, 1.5);
  }
}

TEST(ActionTest, LostSupplyMovesTheRodToWhereTheSpringDoes) {
  ValveParameters valve = GasValve();
  EXPECT_NEAR(AtRest(valve, 50, 700, 190, 16, 0.9)[Signal::kX], 0.0, 0.01);
  valve.actuator.spring = SpringAction::kToClose;
  EXPECT_NEAR(AtRest(valve, 50, 700, 190, 16, 0.9)[Signal::kX], 100.0, 0.01);
  EXPECT_EQ(AtRest(valve, 50, 700, 190, 16, 0.9)[Signal::kF], 0.0);
}

// f1 limits how far the plug closes, whatever the spring does; a weak spring
// lets go of the end that it holds.
TEST(ActionTest, FaultsKeepTheirSenseWhereTheSpringCloses) {
  ValveParameters valve = GasValve();
  valve.actuator.spring = SpringAction::kToClose;
  EXPECT_NEAR(AtRest(valve, 80, 700, 190, 1, 0.5)[Signal::kX], 50.0, 0.01);
  EXPECT_NEAR(AtRest(valve, 50, 700, 190, 13, 0.25)[Signal::kX], 50.0, 1.5);
  EXPECT_GT(AtRest(valve, 50, 700, 190, 13, 0.25)[Signal::kF],
            1.1 * AtRest(valve, 50, 700, 190)[Signal::kF]);
}

TEST(TrimTest, QuickOpeningPassesTheMakersPoints) {
  Trim trim;
  trim.characteristic = FlowCharacteristic::kQuickOpening;
  for (const auto& [h, f] : {std::pair{0.0458, 0.166},
                             {0.2023, 0.723},
                             {0.5332, 0.909},
                             {1.0, 1.0},
                             {0.0, 0.0}}) {
    EXPECT_NEAR(Opening(trim, 1.0 - h), f, 1e-12);
  }
}

TEST(TrimTest, TablesRiseBetweenTheirPointsWithoutOvershoot) {
  Trim trim;
  trim.characteristic = FlowCharacteristic::kTable;
  trim.table_h = {0.0929, 0.2582, 0.4923, 0.6284, 0.7763, 0.9094, 1.0};
  trim.table_f = {0.0134, 0.0419, 0.158, 0.305, 0.601, 0.875, 1.0};
  for (std::size_t i = 0; i < trim.table_h.size(); ++i) {
    EXPECT_NEAR(Opening(trim, 1.0 - trim.table_h[i]), trim.table_f[i], 1e-12);
  }
  for (int i = 1; i <= 1000; ++i) {
    EXPECT_GT(Opening(trim, 1.0 - i / 1000.0),
              Opening(trim, 1.0 - (i - 1) / 1000.0));
  }
}

TEST(TrimTest, EveryCharacteristicRisesFromItsLeakToOne) {
  for (std::size_t i = 0; i < kEnumNames<FlowCharacteristic>.size(); ++i) {
    SCOPED_TRACE(kEnumNames<FlowCharacteristic>[i]);
    Trim trim;
    trim.characteristic = static_cast<FlowCharacteristic>(i);
    trim.leakage = 1e-3;  // class III
    if (trim.characteristic == FlowCharacteristic::kTable) {
      trim.table_h = {0.5, 1.0};
      trim.table_f = {0.3, 1.0};
    }
    EXPECT_NEAR(Opening(trim, 1.0), 1e-3, 1e-15);
    EXPECT_NEAR(Opening(trim, 0.0), 1.0, 1e-15);
    for (int h = 1; h <= 100; ++h) {
      EXPECT_GT(Opening(trim, 1.0 - 0.01 * h), Opening(trim, 1.01 - 0.01 * h));
    }
  }
}

TEST(TrimTest, BadTablesAreRefusedWithTheirField) {
  const auto message = [](std::vector<double> h, std::vector<double> f) {
    ValveParameters valve;
    valve.trim.characteristic = FlowCharacteristic::kTable;
    valve.trim.table_h = std::move(h);
    valve.trim.table_f = std::move(f);
    try {
      Validate(valve);
    } catch (const ConfigError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_EQ(message({0.5, 1.0}, {0.2, 1.0}), "");
  EXPECT_NE(message({0.5, 0.4, 1.0}, {0.2, 0.5, 1.0}).find("table_h"),
            std::string::npos);
  EXPECT_NE(message({0.5, 1.0}, {0.2, 0.9}).find("table_f"), std::string::npos);
  EXPECT_NE(message({0.5}, {0.2}).find("at least 2"), std::string::npos);
  EXPECT_NE(message({0.5, 1.0}, {1.0}).find("equally many"), std::string::npos);
}

}  // namespace
}  // namespace fdi::simulator
