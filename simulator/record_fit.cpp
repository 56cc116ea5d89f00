#include "simulator/record_fit.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "simulator/control_valve.h"
#include "simulator/valve_simulation.h"

namespace fdi::simulator {

double DelayedCommand(const std::vector<RecordRow>& record, std::size_t k,
                      int delay) {
  const auto last = static_cast<std::ptrdiff_t>(record.size()) - 1;
  const auto at = std::clamp(static_cast<std::ptrdiff_t>(k) - delay,
                             std::ptrdiff_t{0}, last);
  return record[static_cast<std::size_t>(at)].input.cv_pct;
}

double SimulatedPeriod(double period_s, const ValveParameters& valve) {
  constexpr double kSettledS = 10.0;
  return valve.actuator.drive == ActuatorDrive::kElectric
             ? period_s
             : std::min(period_s, kSettledS);
}

std::vector<RecordAnswer> SimulateRecord(const ValveParameters& parameters,
                                         const std::vector<RecordRow>& record,
                                         std::size_t first, std::size_t last,
                                         const RecordDrive& drive,
                                         double tolerance_scale) {
  Require(first < last && last <= record.size(),
          "rows to compare must lie inside the record");
  RecordedExcitation excitation;
  for (std::size_t k = first; k < last; ++k) {
    excitation.rows.push_back(record[k].input);
    excitation.rows.back().cv_pct =
        DelayedCommand(record, k, drive.command_delay);
  }
  ValveSimulationConfig config;
  config.parameters = parameters;
  config.excitation = std::move(excitation);
  config.period_s = SimulatedPeriod(drive.period_s, parameters);
  config.duration_s = static_cast<double>(last - first) * config.period_s;
  config.continuous_inputs = drive.interpolated_command;
  config.tolerance_scale = tolerance_scale;
  config.noise = false;
  config.resolution = false;
  ValveSimulation simulation(config);
  std::vector<RecordAnswer> answers;
  while (!simulation.finished()) {
    const Sample sample = simulation.Step().sample;
    answers.push_back({sample[Signal::kX], sample[Signal::kF]});
  }
  return answers;
}

double FlowReading(const ValveParameters& parameters,
                   const FaultEffects& effects, const InputRow& input,
                   double x_pct) {
  const Instrumentation& i = parameters.instruments;
  const double flow =
      FlowOf(parameters, effects,
             {0.01 * input.cv_pct, 1e3 * input.p1_kpa * effects.inlet_factor,
              1e3 * input.p2_kpa * effects.outlet_factor,
              TemperatureWith(effects, input.t1_degc)},
             RodAt(effects, 0.01 * x_pct), 0.0);
  return std::clamp(FlowReadingWith(effects, flow), i.flow.low, i.flow.high);
}

RecordFit FitToRecord(const ValveParameters& parameters,
                      const std::vector<RecordRow>& record, std::size_t first,
                      std::size_t last, const RecordDrive& drive) {
  Require(first < last && last <= record.size(),
          "rows to compare must lie inside the record");
  const auto answers = SimulateRecord(parameters, record, 0, last, drive);
  RecordFit fit;
  double x_count = 0.0;
  double flow_count = 0.0;
  for (std::size_t k = first; k < last; ++k) {
    const double x_error = answers[k].x_pct - record[k].x_pct;
    const double flow_error = answers[k].flow - record[k].flow;
    if (record[k].x_measured) {
      fit.x_rmse_pct += x_error * x_error;
      fit.x_bias_pct += x_error;
      ++x_count;
    }
    if (record[k].flow_measured) {
      fit.flow_rmse += flow_error * flow_error;
      fit.flow_bias += flow_error;
      ++flow_count;
    }
  }
  x_count = std::max(1.0, x_count);
  flow_count = std::max(1.0, flow_count);
  return {std::sqrt(fit.x_rmse_pct / x_count),
          std::sqrt(fit.flow_rmse / flow_count), fit.x_bias_pct / x_count,
          fit.flow_bias / flow_count};
}

}  // namespace fdi::simulator
