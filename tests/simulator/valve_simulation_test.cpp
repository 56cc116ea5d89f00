#include "simulator/valve_simulation.h"

#include <cmath>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"

namespace fdi::simulator {
namespace {

using testing::HasSubstr;

ValveSimulationConfig PaperConfig(double duration_s,
                                  const std::string& fault = "") {
  ValveSimulationConfig config;
  config.parameters = ParameterSet("paper-operating-point");
  config.duration_s = duration_s;
  if (!fault.empty()) {
    config.faults = {ParseFaultSchedule(fault)};
  }
  return config;
}

std::vector<LabelledSample> SamplesOf(const ValveSimulationConfig& config) {
  ValveSimulation simulation(config);
  std::vector<LabelledSample> samples;
  while (!simulation.finished()) {
    samples.push_back(simulation.Step());
  }
  return samples;
}

double MeanOf(const std::vector<LabelledSample>& samples, Signal signal,
              std::size_t first) {
  double sum = 0.0;
  for (std::size_t k = first; k < samples.size(); ++k) {
    sum += samples[k].sample[signal];
  }
  return sum / static_cast<double>(samples.size() - first);
}

struct Shift {
  double x;
  double f;
};

// Change of the means of X and F at the operating point by a fault from t = 0,
// noise off and the same disturbances.
Shift ShiftBy(int fault, double strength) {
  ValveSimulationConfig config = PaperConfig(400.0);
  config.noise = false;
  config.resolution = false;
  const auto healthy = SamplesOf(config);
  FaultSchedule schedule;
  schedule.fault = fault;
  schedule.initial_strength = strength;
  schedule.final_strength = strength;
  config.faults = {schedule};
  const auto faulty = SamplesOf(config);
  return {MeanOf(faulty, Signal::kX, 100) - MeanOf(healthy, Signal::kX, 100),
          MeanOf(faulty, Signal::kF, 100) - MeanOf(healthy, Signal::kF, 100)};
}

TEST(ValveSimulationTest, HealthyValveWorksAtThePapersOperatingPoint) {
  const auto samples = SamplesOf(PaperConfig(3600.0));
  double f_square = 0.0;
  const double f_mean = MeanOf(samples, Signal::kF, 0);
  int outside = 0;
  for (const LabelledSample& s : samples) {
    f_square += std::pow(s.sample[Signal::kF] - f_mean, 2) / 3600.0;
    const bool inside =
        s.sample[Signal::kF] > 50.0 && s.sample[Signal::kF] < 59.0 &&
        s.sample[Signal::kX] > 70.5 && s.sample[Signal::kX] < 74.5;
    outside += inside ? 0 : 1;
  }
  EXPECT_NEAR(f_mean, 54.3, 0.5);
  EXPECT_NEAR(MeanOf(samples, Signal::kX, 0), 72.4, 0.3);
  EXPECT_LT(outside, 36);
  // A flow MSE of 0.31 is 82 % of the variance short of perfect.
  EXPECT_NEAR(1.0 - 0.31 / f_square, 0.83, 0.05);
}

TEST(ValveSimulationTest, SamplesCarryStampsSequenceAndTheBasicSignals) {
  ValveSimulationConfig config = PaperConfig(3.0);
  config.period_s = 0.5;
  config.start_ns = 1000;
  config.source_id = 42;
  const auto samples = SamplesOf(config);
  ASSERT_EQ(samples.size(), 6U);
  for (std::size_t k = 0; k < samples.size(); ++k) {
    const Sample& s = samples[k].sample;
    EXPECT_EQ(s.stamp_ns, 1000 + static_cast<std::int64_t>(k) * 500000000);
    EXPECT_EQ(s.seq, k);
    EXPECT_EQ(s.source_id, 42U);
    EXPECT_EQ(s.present, kBasicSignals);
    EXPECT_EQ(s.flow_unit, FlowUnit::kM3PerHour);
    ASSERT_TRUE(samples[k].truth.has_value());
  }
}

TEST(ValveSimulationTest, SameSeedGivesTheSameBits) {
  for (const char* excitation : {"operating-point", "level-loop"}) {
    ValveSimulationConfig config =
        PaperConfig(200.0, "f1:incipient@50+100:from=0.2:strength=0.6");
    config.excitation = DefaultExcitation(excitation);
    const auto a = SamplesOf(config);
    const auto b = SamplesOf(config);
    config.seed = 2;
    const auto c = SamplesOf(config);
    int different = 0;
    for (std::size_t k = 0; k < a.size(); ++k) {
      EXPECT_EQ(a[k].sample.values, b[k].sample.values);
      different += a[k].sample.values != c[k].sample.values ? 1 : 0;
    }
    EXPECT_GT(different, 190);
  }
}

// Until the fault starts the run is that of the healthy valve, bit for bit.
TEST(ValveSimulationTest, FaultChangesNothingBeforeItsStart) {
  const auto healthy = SamplesOf(PaperConfig(120.0));
  const auto faulty =
      SamplesOf(PaperConfig(120.0, "f3:abrupt@100:strength=0.5"));
  for (std::size_t k = 0; k < 100; ++k) {
    EXPECT_EQ(healthy[k].sample.values, faulty[k].sample.values) << k;
    EXPECT_EQ(faulty[k].truth->fault, 0);
  }
  EXPECT_GT(faulty[100].sample[Signal::kF],
            healthy[100].sample[Signal::kF] + 8.0);
  EXPECT_EQ(faulty[100].truth->fault, 3);
  EXPECT_EQ(faulty[100].truth->strength, 0.5);
}

TEST(ValveSimulationTest, FaultEndsAndTheValveRecovers) {
  const auto samples =
      SamplesOf(PaperConfig(300.0, "f1:abrupt@50.3:strength=0.5:until=150"));
  EXPECT_GT(samples[50].sample[Signal::kX], 70.0);
  EXPECT_NEAR(samples[51].sample[Signal::kX], 50.0, 2.0);
  EXPECT_NEAR(samples[149].sample[Signal::kX], 50.0, 2.0);
  EXPECT_NEAR(samples[250].sample[Signal::kX], 72.4, 3.0);
  EXPECT_EQ(samples[150].truth->fault, 0);
}

// Tolerances ten times tighter change the answer by less than 0.1 % of span.
TEST(ValveSimulationTest, TighterTolerancesChangeLessThanAThousandthOfSpan) {
  for (const char* excitation :
       {"operating-point", "sine", "level-loop", "continuous"}) {
    ValveSimulationConfig config;
    config.parameters = ParameterSet("lublin-actuator-3");
    config.continuous_inputs = std::string(excitation) == "continuous";
    config.excitation =
        DefaultExcitation(config.continuous_inputs ? "sine" : excitation);
    config.duration_s = 600.0;
    config.noise = false;
    config.resolution = false;
    const auto usual = SamplesOf(config);
    config.tolerance_scale = 0.01;
    const auto tight = SamplesOf(config);
    for (std::size_t k = 0; k < usual.size(); ++k) {
      EXPECT_NEAR(usual[k].sample[Signal::kX], tight[k].sample[Signal::kX], 0.1)
          << excitation << ' ' << k;
      EXPECT_NEAR(usual[k].sample[Signal::kF], tight[k].sample[Signal::kF],
                  0.04)
          << excitation << ' ' << k;
    }
  }
}

TEST(ValveSimulationTest, PapersFaultsHaveTheirSizes) {
  const Shift clogging = ShiftBy(1, 0.5);
  EXPECT_NEAR(clogging.x, -22.4, 1.0);
  EXPECT_NEAR(clogging.f, 44.0, 2.0);
  const Shift weak_clogging = ShiftBy(1, 0.32);
  EXPECT_NEAR(weak_clogging.x, -4.4, 0.5);
  EXPECT_NEAR(weak_clogging.f, 8.7, 1.0);
  const Shift erosion = ShiftBy(3, 0.5);
  EXPECT_NEAR(erosion.x, 0.0, 0.2);
  EXPECT_NEAR(erosion.f, 13.0, 1.0);
  const Shift leakage = ShiftBy(6, 0.5);
  EXPECT_NEAR(leakage.x, 0.0, 0.05);
  EXPECT_NEAR(leakage.f, 10.0, 1.0);
  const Shift flow_sensor = ShiftBy(19, 0.5);
  EXPECT_EQ(flow_sensor.x, 0.0);
  EXPECT_NEAR(flow_sensor.f, -27.0, 1.0);
}

// The valve goes to full travel and the flow transmitter saturates.
TEST(ValveSimulationTest, EvaporationOpensTheValve) {
  const auto samples =
      SamplesOf(PaperConfig(120.0, "f7:abrupt@50:strength=0.5"));
  EXPECT_LT(samples[55].sample[Signal::kX], 2.0);
  EXPECT_NEAR(samples[55].sample[Signal::kF], 120.0, 4.0 * 0.557);
  EXPECT_NEAR(samples[55].sample[Signal::kT1], 200.0, 4.0 * 0.282);
}

// Noise joins behind the limit of the range: half of it is seen there.
TEST(ValveSimulationTest, SaturatedTransmitterStaysNoisy) {
  const auto samples =
      SamplesOf(PaperConfig(400.0, "f7:abrupt@0:strength=0.5"));
  int below = 0;
  double sum = 0.0;
  for (std::size_t k = 100; k < samples.size(); ++k) {
    const double f = samples[k].sample[Signal::kF];
    ASSERT_LE(f, 120.0);
    below += f < 120.0 ? 1 : 0;
    sum += f;
  }
  EXPECT_NEAR(below, 150, 40);
  EXPECT_NEAR(sum / 300.0, 120.0 - 0.557 * 0.399, 0.06);
}

TEST(ValveSimulationTest, NoiseHasItsDeviationAndCanBeSwitchedOff) {
  ValveSimulationConfig config = PaperConfig(2000.0);
  const auto noisy = SamplesOf(config);
  config.noise = false;
  config.resolution = false;
  const auto exact = SamplesOf(config);
  double square = 0.0;
  for (std::size_t k = 0; k < noisy.size(); ++k) {
    square +=
        std::pow(noisy[k].sample[Signal::kF] - exact[k].sample[Signal::kF], 2);
    EXPECT_NEAR(noisy[k].sample[Signal::kCv], exact[k].sample[Signal::kCv],
                100.0 / 65535.0);
  }
  EXPECT_NEAR(std::sqrt(square / 2000.0), 0.557, 0.03);
}

TEST(ValveSimulationTest, ReadingsLieOnTheConvertersGrid) {
  ValveSimulationConfig config = PaperConfig(50.0);
  config.parameters.instruments.resolution_bits = 8;
  for (const LabelledSample& s : SamplesOf(config)) {
    const double steps = s.sample[Signal::kF] / (120.0 / 255.0);
    EXPECT_NEAR(steps, std::round(steps), 1e-9);
  }
}

TEST(ValveSimulationTest, ColdStartBeginsOpen) {
  ValveSimulationConfig config = PaperConfig(60.0);
  config.cold_start = true;
  const auto samples = SamplesOf(config);
  EXPECT_LT(samples[0].sample[Signal::kX], 2.0);
  EXPECT_NEAR(samples[50].sample[Signal::kX], 72.4, 3.0);
}

TEST(ValveSimulationTest, RecordedRowsEndTheRun) {
  ValveSimulationConfig config = PaperConfig(1000.0);
  config.excitation = RecordedExcitation{
      std::vector<InputRow>(7, InputRow{60.0, 3500.0, 2600.0, 43.0})};
  ValveSimulation simulation(config);
  EXPECT_EQ(simulation.sample_count(), 7U);
  while (!simulation.finished()) {
    simulation.Step();
  }
  EXPECT_THROW(simulation.Step(), std::logic_error);
}

TEST(ValveSimulationTest, MessagesNameTheBadField) {
  const auto message = [](const ValveSimulationConfig& config) {
    try {
      const ValveSimulation simulation(config);
    } catch (const ConfigError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  ValveSimulationConfig config = PaperConfig(-5.0);
  EXPECT_THAT(message(config), HasSubstr("duration_s is -5"));
  config = PaperConfig(10.0);
  config.period_s = std::nan("");
  EXPECT_THAT(message(config), HasSubstr("period_s is nan"));
  config = PaperConfig(10.0);
  config.continuous_inputs = true;
  EXPECT_THAT(message(config),
              HasSubstr("continuous_inputs is set for the excitation "
                        "'operating-point'"));
  config = PaperConfig(10.0);
  config.faults = {FaultSchedule{25}};
  EXPECT_THAT(message(config), HasSubstr("fault number is 25"));
}

}  // namespace
}  // namespace fdi::simulator
