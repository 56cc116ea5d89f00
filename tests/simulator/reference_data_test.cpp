// Comparisons with recordings that are not part of this repository: their
// folder is named by the environment variable FDI_REFERENCE_DATA.
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

#include "diagnosis/fault_catalogue.h"
#include "simulator/record_fit.h"
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

TEST(ReferenceDataTest, RefittedActuatorFollowsThePlant) {
  const auto folder = ReferenceData();
  if (!folder) {
    GTEST_SKIP() << "FDI_REFERENCE_DATA is not set";
  }
  std::vector<RecordRow> record;
  for (const auto& row :
       ReadRows(*folder / "plant/lublin_actuator3_2001-10-11_first40min.csv")) {
    record.push_back({{row[1], row[2], row[3], row[4]}, row[5], row[6]});
  }
  const RecordFit nominal =
      FitToRecord(ParameterSet("lublin-actuator-3"), record, 60, 2400);
  const RecordFit refit =
      FitToRecord(ParameterSet("lublin-actuator-3-refit"), record, 60, 2400);
  std::cout << "nominal X " << nominal.x_rmse_pct << " %, F "
            << nominal.flow_rmse << " t/h; refit X " << refit.x_rmse_pct
            << " %, F " << refit.flow_rmse << " t/h\n";
  EXPECT_LE(refit.x_rmse_pct, 1.80);
  EXPECT_LE(refit.flow_rmse, 1.90);
  EXPECT_LE(nominal.x_rmse_pct, 2.5);
  EXPECT_LE(nominal.flow_rmse, 2.6);
}

struct Means {
  double x;
  double f;
};

Means MeansOfReference(const std::vector<std::vector<double>>& rows) {
  Means means{0.0, 0.0};
  for (std::size_t k = rows.size() - 600; k < rows.size(); ++k) {
    means.x += rows[k][5] / 600.0;
    means.f += rows[k][6] / 600.0;
  }
  return means;
}

Means MeansOfSimulation(const std::optional<FaultSchedule>& fault,
                        std::size_t samples) {
  ValveSimulationConfig config;
  config.parameters = ParameterSet("lublin-actuator-3");
  config.excitation = SineExcitation{};
  config.duration_s = static_cast<double>(samples);
  if (fault) {
    config.faults = {*fault};
  }
  ValveSimulation simulation(config);
  Means means{0.0, 0.0};
  for (std::size_t k = 0; k < samples; ++k) {
    const Sample sample = simulation.Step().sample;
    if (k + 600 >= samples) {
      means.x += sample[Signal::kX] / 600.0;
      means.f += sample[Signal::kF] / 600.0;
    }
  }
  return means;
}

// The fault of a file; none for f14, whose sign there is negative and which is
// invisible either way.
std::optional<FaultSchedule> FaultOf(
    const std::vector<std::vector<double>>& rows, bool incipient) {
  FaultSchedule schedule;
  schedule.fault = static_cast<int>(rows.back()[7]);
  if (schedule.fault == 14) {
    return std::nullopt;
  }
  schedule.start_s = 600.0;
  schedule.development_s = incipient ? 3600.0 : 0.0;
  schedule.final_strength = rows.back()[8];
  schedule.initial_strength = incipient ? 0.0 : schedule.final_strength;
  return schedule;
}

// Where the simulator knowingly differs by more than a third:
// - f01_medium: our stop also stops the actuator, the reference's lets it run
//   on, so that its rod leaves the stop later.
// - f04_incipient: the reference's actuator loses its range at play 0.72.
// - f07_small: the reference keeps the density of water below 100 degC.
const std::map<std::string, const char*> kKnown{
    {"sine_f01_medium.csv", "stop"},
    {"sine_f04_incipient.csv", "range of the actuator"},
    {"sine_f07_small.csv", "density"}};

TEST(ReferenceDataTest, FaultsHaveTheEffectsOfTheReferenceModel) {
  const auto folder = ReferenceData();
  if (!folder) {
    GTEST_SKIP() << "FDI_REFERENCE_DATA is not set";
  }
  const std::filesystem::path files = *folder / "valve-reference";
  const Means healthy =
      MeansOfReference(ReadRows(files / "sine_faultfree_201.csv"));
  const Means ours = MeansOfSimulation(std::nullopt, 2400);
  for (const auto& entry : std::filesystem::directory_iterator(files)) {
    const std::string name = entry.path().filename().string();
    if (!name.starts_with("sine_f0") && !name.starts_with("sine_f1")) {
      continue;
    }
    const auto rows = ReadRows(entry.path());
    const bool incipient = name.find("incipient") != std::string::npos;
    const Means reference = MeansOfReference(rows);
    const Means simulated =
        MeansOfSimulation(FaultOf(rows, incipient), rows.size());
    const double x = reference.x - healthy.x;
    const double f = reference.f - healthy.f;
    const double dx = simulated.x - ours.x - x;
    const double df = simulated.f - ours.f - f;
    // 0.5 % and 0.3 t/h are what phase and transients of the two models leave.
    const bool alike = std::abs(dx) <= std::max(0.5, std::abs(x) / 3.0) &&
                       std::abs(df) <= std::max(0.3, std::abs(f) / 3.0);
    EXPECT_TRUE(alike || kKnown.count(name) > 0)
        << name << ": X " << x << " differs by " << dx << ", F " << f
        << " differs by " << df;
  }
}

}  // namespace
}  // namespace fdi::simulator
