#include "idl/wire.h"

#include <iterator>

#include "base/error.h"
#include "base/printable.h"

namespace fdi::idl {

std::string_view HealthName(Health health) {
  constexpr std::string_view kNames[] = {"OK", "DEGRADED", "FAILING"};
  const auto i = static_cast<std::size_t>(health);
  return i < std::size(kNames) ? kNames[i] : "?";
}

void ValidateId(std::string_view id) {
  if (id.empty() || id.size() > kMaxIdLength) {
    throw DataError("id '" + std::string(id) + "' has " +
                    std::to_string(id.size()) + " bytes, accepted are 1 to " +
                    std::to_string(kMaxIdLength));
  }
  if (!IsPrintable(id)) {
    throw DataError("id '" + Printable(id) +
                    "' has control characters or is not UTF-8");
  }
}

ModelSetInfoMessage Describe(const ModelSet& models) {
  ModelSetInfoMessage info;
  info.model_set = models.name;
  info.model_hash = models.content_hash;
  info.version = models.version;
  info.created_ns = models.created_ns;
  info.sample_period_s = models.sample_period_s;
  info.flow_unit = models.flow_unit;
  info.required = RequiredSignals(models);
  info.isolation_threshold = models.decision.isolation_threshold;
  info.isolation_fraction = models.decision.isolation_fraction;
  info.detection_samples = models.decision.detection_samples;
  info.isolation_samples = models.decision.isolation_samples;
  info.clearing_samples = models.decision.clearing_samples;
  info.settling_samples = models.decision.settling_samples;
  info.channels = models.channels;
  info.faults = models.faults;
  for (const Observer& observer : models.observers) {
    info.observers.push_back(
        {observer.name, observer.fault, observer.strength});
  }
  info.undetectable = models.undetectable;
  info.groups = models.groups;
  return info;
}

}  // namespace fdi::idl
