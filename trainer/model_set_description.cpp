#include "trainer/model_set_description.h"

#include <array>
#include <cstdio>
#include <string>

#include "diagnosis/fault_catalogue.h"
#include "trainer/validity.h"

namespace fdi::trainer {
namespace {

std::string ObserverName(int fault, double strength) {
  if (fault == 0) {
    return "normal";
  }
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), " %.2f", strength);
  return FaultName(fault) + text.data();
}

}  // namespace

ModelSet DescribeModelSet(const std::vector<TrainingRun>& runs,
                          const std::vector<Condition>& conditions,
                          const TrainingOptions& options) {
  ModelSet models;
  models.name = options.name;
  models.created_ns = options.created_ns;
  models.software = options.software;
  models.preset = options.preset;
  models.sample_period_s = runs.front().period_s;
  models.flow_unit = runs.front().flow_unit;
  models.validity = TrainedRegion(conditions);
  models.stuck = FitStuckLimits(conditions.front());
  models.decision = options.decision;
  for (const ChannelPlan& plan : options.channels) {
    models.channels.push_back({plan.name, plan.output, -1.0, 1.0});
  }
  for (const TrainingRun& run : runs) {
    models.training_runs.push_back(run.id);
  }
  return models;
}

void AddObserver(int fault, double strength, ModelSet& models) {
  models.observers.push_back(
      {ObserverName(fault, strength), fault, strength,
       std::vector<ChannelObserver>(models.channels.size())});
  if (fault != 0 && (models.faults.empty() || models.faults.back() != fault)) {
    models.faults.push_back(fault);
  }
}

}  // namespace fdi::trainer
