#include "monitor/service/model_assignment.h"

#include <utility>

namespace fdi::monitor {

void PrepareModels(const std::filesystem::path& path) {
  storage::ModelStore(path, storage::Access::kOccasionalWriter);
}

ModelAssignment::ModelAssignment(
    const std::filesystem::path& path,
    const std::optional<storage::ModelReference>& wanted, Announce announce)
    : store_(path), announce_(std::move(announce)) {
  for (const storage::ValveEntry& entry : store_.Valves()) {
    if (entry.model_set) {
      Load(*entry.model_set);
      ++assigned_;
      if (entry.pattern.find_first_of("*?[") == std::string::npos) {
        assigned_valves_.push_back(entry.pattern);
      }
    }
  }
  const std::optional<storage::ModelReference> reference = wanted ? wanted
                                                           : assigned_ == 0
                                                               ? OnlyActive()
                                                               : std::nullopt;
  if (reference) {
    default_ = Load(*reference);
  }
}

std::optional<storage::ModelReference> ModelAssignment::OnlyActive() const {
  std::optional<storage::ModelReference> only;
  for (const storage::ModelSummary& summary : store_.List()) {
    if (!summary.active) {
      continue;
    }
    if (only) {
      return std::nullopt;
    }
    only = storage::ModelReference{summary.name, summary.version};
  }
  return only;
}

std::shared_ptr<const ModelSet> ModelAssignment::Load(
    const storage::ModelReference& reference) const {
  std::shared_ptr<const ModelSet>& models =
      loaded_[storage::ToString(reference)];
  if (!models) {
    auto fresh = std::make_shared<const ModelSet>(store_.Load(reference));
    Validate(*fresh);
    if (announce_) {
      announce_(*fresh);
    }
    models = std::move(fresh);
  }
  return models;
}

std::shared_ptr<const ModelSet> ModelAssignment::ModelsFor(
    std::string_view valve_id) const {
  const MutexLock lock(mutex_);
  const std::optional<storage::ModelReference> assigned =
      store_.AssignedModelSet(valve_id);
  return assigned ? Load(*assigned) : default_;
}

std::vector<std::string> ModelAssignment::AssignedValves() const {
  return assigned_valves_;
}

bool ModelAssignment::IsolationHeld(std::string_view valve_id) const {
  const MutexLock lock(mutex_);
  const auto entry = store_.FindValve(valve_id);
  return entry && entry->baseline() == storage::BaselineState::kProvisional;
}

std::size_t ModelAssignment::loaded() const {
  const MutexLock lock(mutex_);
  return loaded_.size();
}

std::string ModelAssignment::DefaultName() const {
  return default_ ? NameOf(*default_) : "none";
}

}  // namespace fdi::monitor
