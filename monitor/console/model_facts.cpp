#include "monitor/console/model_facts.h"

#include "diagnosis/fault_catalogue.h"

namespace fdi::console {

std::shared_ptr<const ModelFacts> FactsOf(const ModelSet& models) {
  auto facts = std::make_shared<ModelFacts>();
  facts->model_set = models.name + "@" + std::to_string(models.version);
  facts->hash = models.content_hash;
  for (const ChannelSpec& channel : models.channels) {
    const std::string_view unit = channel.output == Signal::kF
                                      ? FlowUnitName(models.flow_unit)
                                      : SignalUnit(channel.output);
    facts->channels.push_back({channel.name, channel.output, std::string(unit),
                               channel.lower_threshold,
                               channel.upper_threshold});
  }
  for (const int fault : models.faults) {
    facts->faults.push_back(FaultName(fault));
  }
  facts->isolation_threshold = models.decision.isolation_threshold;
  facts->isolation_samples = models.decision.isolation_samples;
  facts->detection_samples = models.decision.detection_samples;
  facts->period_s = models.sample_period_s;
  facts->flow_unit = models.flow_unit;
  return facts;
}

}  // namespace fdi::console
