#include "simulator/record_fit.h"

#include <cmath>

#include "diagnosis/error.h"
#include "simulator/valve_simulation.h"

namespace fdi::simulator {

RecordFit FitToRecord(const ValveParameters& parameters,
                      const std::vector<RecordRow>& record, std::size_t first,
                      std::size_t last) {
  Require(first < last && last <= record.size(),
          "rows to compare must lie inside the record");
  RecordedExcitation excitation;
  for (const RecordRow& row : record) {
    excitation.rows.push_back(row.input);
  }
  ValveSimulationConfig config;
  config.parameters = parameters;
  config.excitation = excitation;
  config.duration_s = static_cast<double>(record.size()) * config.period_s;
  config.noise = false;
  config.resolution = false;
  ValveSimulation simulation(config);
  double x_sum = 0.0;
  double flow_sum = 0.0;
  for (std::size_t k = 0; k < last; ++k) {
    const Sample sample = simulation.Step().sample;
    if (k >= first) {
      x_sum += std::pow(sample[Signal::kX] - record[k].x_pct, 2);
      flow_sum += std::pow(sample[Signal::kF] - record[k].flow, 2);
    }
  }
  const auto count = static_cast<double>(last - first);
  return {std::sqrt(x_sum / count), std::sqrt(flow_sum / count)};
}

}  // namespace fdi::simulator
