#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "monitor/sinks.h"
#include "storage/models/models.h"

namespace fdi::monitor {

/// Which model set each valve is diagnosed with, as models.db says now: the one
/// that is assigned to the valve, else the default one, else none.
///
/// The default is what `--model-set` names; without it the active set, if there
/// is exactly one and no valve is assigned any.
///
/// Thread safe.
class ModelAssignment : public ModelResolver {
 public:
  /// Called once for each model set, before it is used.
  using Announce = std::function<void(const ModelSet&)>;

  /// Makes or migrates models.db if need be, and loads all sets that are
  /// assigned or the default one, so that a damaged one is found at once.
  /// @throws NotFoundError, DataError, storage::SqliteError
  ModelAssignment(const std::filesystem::path& path,
                  const std::optional<storage::ModelReference>& wanted,
                  Announce announce);

  std::shared_ptr<const ModelSet> ModelsFor(
      std::string_view valve_id) const override;

  std::vector<std::string> AssignedValves() const override;

  /// While the baseline of the valve is provisional.
  bool IsolationHeld(std::string_view valve_id) const override;

  /// How many sets are in use or were, one at least unless none is assigned.
  std::size_t loaded() const;

  /// Of the default set: "NAME@VERSION", or "none".
  std::string DefaultName() const;

  /// How many valves had a set assigned when this was made.
  std::size_t assigned() const { return assigned_; }

 private:
  std::shared_ptr<const ModelSet> Load(
      const storage::ModelReference& reference) const;
  std::optional<storage::ModelReference> OnlyActive() const;

  mutable std::mutex mutex_;
  mutable storage::ModelStore store_;
  Announce announce_;
  mutable std::map<std::string, std::shared_ptr<const ModelSet>> loaded_;
  std::shared_ptr<const ModelSet> default_;
  std::size_t assigned_{0};
  std::vector<std::string> assigned_valves_;
};

/// Makes models.db, or migrates it, if need be. Then it can be read.
void PrepareModels(const std::filesystem::path& path);

}  // namespace fdi::monitor
