#include "trainer/app/simulated_run.h"

namespace fdi::trainer {
namespace {

constexpr std::uint64_t kGolden = 0x9E3779B97F4A7C15ULL;

}  // namespace

simulator::ValveSimulationConfig SimulationConfigOf(const SimulatedRun& run,
                                                    std::int64_t start_ns) {
  simulator::ValveSimulationConfig config = run.scenario.config;
  config.start_ns = config.start_ns != 0 ? config.start_ns : start_ns;
  config.source_id = (config.seed + 1) * kGolden;
  return config;
}

storage::NewRun RunRowOf(const SimulatedRun& run, std::int64_t start_ns,
                         const std::string& software) {
  const simulator::ValveSimulationConfig config =
      SimulationConfigOf(run, start_ns);
  storage::NewRun row;
  row.valve_id = run.scenario.valve_id;
  row.source_id = config.source_id;
  row.start_ns = config.start_ns;
  row.period_s = config.period_s;
  row.flow_unit = config.parameters.instruments.flow_unit;
  row.origin = storage::RunOrigin::kSimulated;
  row.scenario = simulator::ScenarioText(run.scenario);
  row.seed = config.seed;
  row.software = software;
  return row;
}

storage::StoredRun SimulateRun(const SimulatedRun& run) {
  simulator::ValveSimulation simulation(SimulationConfigOf(run, 0));
  storage::StoredRun result;
  result.info.run = RunRowOf(run, 0, {});
  result.samples.reserve(simulation.sample_count());
  while (!simulation.finished()) {
    const LabelledSample labelled = simulation.Step();
    storage::StoredSample stored;
    stored.sample = labelled.sample;
    stored.truth = labelled.truth;
    result.info.signals |= labelled.sample.present;
    result.samples.push_back(stored);
  }
  result.info.samples = static_cast<std::int64_t>(result.samples.size());
  result.info.has_truth = true;
  return result;
}

}  // namespace fdi::trainer
