// Comparisons with recordings that are not part of this repository: their
// folder is named by the environment variable FDI_REFERENCE_DATA.
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <map>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "simulator/record_fit.h"
#include "simulator/valve_identification.h"
#include "simulator/valve_simulation.h"

namespace fdi::simulator {
namespace {

std::optional<std::filesystem::path> ReferenceData() {
  const char* folder = std::getenv("FDI_REFERENCE_DATA");
  return folder == nullptr ? std::nullopt
                           : std::optional<std::filesystem::path>(folder);
}

std::vector<std::vector<double>> ReadRows(const std::filesystem::path& file) {
  std::ifstream in(file);
  std::string line;
  std::getline(in, line);
  std::vector<std::vector<double>> rows;
  while (std::getline(in, line)) {
    std::istringstream cells(line);
    std::string cell;
    rows.emplace_back();
    while (std::getline(cells, cell, ',')) {
      rows.back().push_back(std::stod(cell));
    }
  }
  return rows;
}

std::vector<RecordRow> ReadRecord(const std::filesystem::path& file) {
  std::vector<RecordRow> record;
  for (const auto& row : ReadRows(file)) {
    record.push_back({{row[1], row[2], row[3], row[4]}, row[5], row[6]});
  }
  return record;
}

TEST(ReferenceDataTest, RefittedActuatorFollowsThePlant) {
  const auto folder = ReferenceData();
  if (!folder) {
    GTEST_SKIP() << "FDI_REFERENCE_DATA is not set";
  }
  const auto record =
      ReadRecord(*folder / "plant/lublin_actuator3_2001-10-11_first40min.csv");
  const RecordFit nominal =
      FitToRecord(ParameterSet("lublin-actuator-3"), record, 60, 2400);
  const RecordFit refit =
      FitToRecord(ParameterSet("lublin-actuator-3-refit"), record, 60, 2400);
  std::cout << "nominal X " << nominal.x_rmse_pct << " %, F "
            << nominal.flow_rmse << " t/h; refit X " << refit.x_rmse_pct
            << " %, F " << refit.flow_rmse << " t/h\n";
  EXPECT_LE(refit.x_rmse_pct, 1.70);
  EXPECT_LE(refit.flow_rmse, 1.90);
  EXPECT_LE(nominal.x_rmse_pct, 2.3);
  EXPECT_LE(nominal.flow_rmse, 2.6);
}

// The first 25 minutes of the plant's record fit the valve to the other 15; a
// model that is not ours is fitted on one record and followed on another.
TEST(ReferenceDataTest, IdentifiedValveFollowsRowsItHasNotSeen) {
  const auto folder = ReferenceData();
  if (!folder) {
    GTEST_SKIP() << "FDI_REFERENCE_DATA is not set";
  }
  const ValveParameters nominal = ParameterSet("lublin-actuator-3");
  const auto plant =
      ReadRecord(*folder / "plant/lublin_actuator3_2001-10-11_first40min.csv");
  const ValveFit at_plant =
      FitValve({{{plant.begin(), plant.begin() + 1500}}}, nominal);
  EXPECT_EQ(at_plant.parameters.positioner.relay, AirRelay::kCompressible);
  const RecordFit rest = FitToRecord(at_plant.parameters, plant, 1500, 2400,
                                     {1.0, at_plant.interpolated_command});
  EXPECT_LE(rest.x_rmse_pct, 1.70);
  EXPECT_LE(rest.flow_rmse, 1.95);
  for (const FittedParameter& p : at_plant.values) {
    EXPECT_EQ(p.identified,
              !p.name.starts_with("actuator.") && p.name != "positioner.gain")
        << p.name;
  }
  const auto other = *folder / "valve-reference";
  const ValveFit at_other =
      FitValve({{ReadRecord(other / "plant_faultfree_211.csv")}},
               ParameterSet("lublin-actuator-3-refit"));
  EXPECT_EQ(at_other.parameters.positioner.relay, AirRelay::kOrifice);
  EXPECT_TRUE(at_other.interpolated_command);
  const RecordFit unseen = FitToRecord(
      at_other.parameters, ReadRecord(other / "plant_faultfree_212.csv"), 60,
      2400, {1.0, at_other.interpolated_command});
  EXPECT_LE(unseen.x_rmse_pct, 0.40);
  EXPECT_LE(unseen.flow_rmse, 0.35);
}

using Rows = std::vector<std::vector<double>>;

// X and F of the simulated valve under the recordings' excitation.
std::vector<Sample> Simulated(const std::optional<FaultSchedule>& fault,
                              std::size_t samples) {
  ValveSimulationConfig config;
  config.parameters = ParameterSet("lublin-actuator-3");
  config.excitation = SineExcitation{};
  config.continuous_inputs = true;
  config.cold_start = true;
  config.noise = false;
  config.resolution = false;
  config.duration_s = static_cast<double>(samples);
  if (fault) {
    config.faults = {*fault};
  }
  ValveSimulation simulation(config);
  std::vector<Sample> result;
  while (!simulation.finished()) {
    result.push_back(simulation.Step().sample);
  }
  return result;
}

std::optional<FaultSchedule> FaultOf(const Rows& rows, bool incipient) {
  FaultSchedule schedule;
  schedule.fault = static_cast<int>(rows.back()[7]);
  if (schedule.fault == 0) {
    return std::nullopt;
  }
  schedule.start_s = 600.0;
  schedule.development_s = incipient ? 3600.0 : 0.0;
  schedule.final_strength = rows.back()[8];
  schedule.initial_strength = incipient ? 0.0 : schedule.final_strength;
  return schedule;
}

struct Stretch {
  std::size_t first;
  std::size_t last;  // Excluded.
};

// Root mean square of recording minus simulation.
double Rms(const Rows& rows, const std::vector<Sample>& samples, Signal signal,
           Stretch stretch) {
  const std::size_t column = signal == Signal::kX ? 5 : 6;
  double sum = 0.0;
  for (std::size_t k = stretch.first; k < stretch.last; ++k) {
    sum += std::pow(rows[k][column] - samples[k][signal], 2);
  }
  return std::sqrt(sum / static_cast<double>(stretch.last - stretch.first));
}

// Share of the fault's rms effect by which the simulation may miss it. Wider
// for what is not understood: the reference's response to a force that changes
// at once (f10, f11, f17) is larger, and its valve vents faster afterwards;
// under f4 it crosses a wide play sooner.
double AllowedShare(const std::string& name) {
  const std::map<std::string, double> wider{{"sine_f04_incipient.csv", 0.55},
                                            {"sine_f10_small.csv", 0.4},
                                            {"sine_f11_big.csv", 0.4},
                                            {"sine_f17_big.csv", 0.3}};
  const auto found = wider.find(name);
  return found == wider.end() ? 0.22 : found->second;
}

// The reference's actuator breaks into a cycle beyond a play of 0.6 strokes
// and stands still, open, beyond 0.73.
std::size_t LastComparable(const std::string& name, std::size_t count) {
  return name == "sine_f04_incipient.csv" ? 2700 : count;
}

// 0.3 % and 0.3 t/h hold the recordings' noise of 0.14 % and 0.06 t/h.
TEST(ReferenceDataTest, FaultsHaveTheEffectsOfTheReferenceModel) {
  const auto folder = ReferenceData();
  if (!folder) {
    GTEST_SKIP() << "FDI_REFERENCE_DATA is not set";
  }
  const std::vector<Sample> healthy = Simulated(std::nullopt, 5401);
  int files = 0;
  for (const auto& entry :
       std::filesystem::directory_iterator(*folder / "valve-reference")) {
    const std::string name = entry.path().filename().string();
    if (!name.starts_with("sine_")) {
      continue;
    }
    ++files;
    const Rows rows = ReadRows(entry.path());
    const bool incipient = name.find("incipient") != std::string::npos;
    const auto samples = Simulated(FaultOf(rows, incipient), rows.size());
    const Stretch before{30, 600};
    EXPECT_LE(Rms(rows, samples, Signal::kX, before), 0.20) << name;
    EXPECT_LE(Rms(rows, samples, Signal::kF, before), 0.12) << name;
    const Stretch after{601, LastComparable(name, rows.size())};
    for (const Signal signal : {Signal::kX, Signal::kF}) {
      const double effect = Rms(rows, healthy, signal, after);
      EXPECT_LE(Rms(rows, samples, signal, after),
                std::max(0.3, AllowedShare(name) * effect))
          << name << (signal == Signal::kX ? ": X" : ": F")
          << ", effect of the fault " << effect;
    }
  }
  EXPECT_EQ(files, 47);
}

// The pressure sensor of the positioner is not among the basic measurements.
TEST(ReferenceDataTest, PressureSensorFaultIsInvisibleInTheReferenceToo) {
  const auto folder = ReferenceData();
  if (!folder) {
    GTEST_SKIP() << "FDI_REFERENCE_DATA is not set";
  }
  const std::vector<Sample> healthy = Simulated(std::nullopt, 2401);
  for (const char* size : {"small", "medium", "big"}) {
    const Rows rows = ReadRows(*folder / "valve-reference" /
                               ("sine_f14_" + std::string(size) + ".csv"));
    EXPECT_LT(rows.back()[8], 0.0);
    EXPECT_LE(Rms(rows, healthy, Signal::kX, {601, 2401}), 0.20) << size;
    EXPECT_LE(Rms(rows, healthy, Signal::kF, {601, 2401}), 0.12) << size;
  }
}

}  // namespace
}  // namespace fdi::simulator
