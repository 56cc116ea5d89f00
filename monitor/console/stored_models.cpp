#include "monitor/console/stored_models.h"

#include <limits>

#include "diagnosis/error.h"
#include "storage/models.h"

namespace fdi::console {
namespace {

constexpr std::size_t kKept = 32;

std::shared_ptr<const ModelFacts> FromEpisode(const storage::Episode& episode) {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  auto facts = std::make_shared<ModelFacts>();
  facts->model_set = episode.model_set;
  facts->hash = episode.model_hash;
  facts->isolation_threshold = kNone;
  facts->flow_unit = episode.flow_unit;
  for (const std::string& name : episode.channels) {
    const Signal signal = ParseSignal(name).value_or(Signal::kX);
    const std::string_view unit = signal == Signal::kF
                                      ? FlowUnitName(episode.flow_unit)
                                      : SignalUnit(signal);
    facts->channels.push_back({name, signal, std::string(unit), kNone, kNone});
  }
  facts->faults = episode.faults;
  return facts;
}

}  // namespace

std::shared_ptr<const ModelFacts> StoredModels::For(
    const storage::Episode& episode) {
  const std::lock_guard lock(mutex_);
  const auto known = known_.find(episode.model_set);
  if (known != known_.end() && known->second->hash == episode.model_hash) {
    return known->second;
  }
  std::shared_ptr<const ModelFacts> facts;
  try {
    facts = FactsOf(storage::ModelStore(path_).Load(episode.model_set));
  } catch (const NotFoundError&) {
  }
  // Another set may have come under its name since.
  if (!facts || facts->hash != episode.model_hash) {
    return FromEpisode(episode);
  }
  if (known_.size() >= kKept) {
    known_.erase(known_.begin());
  }
  known_[episode.model_set] = facts;
  return facts;
}

}  // namespace fdi::console
