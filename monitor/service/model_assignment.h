#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "base/mutex.h"
#include "monitor/sinks.h"
#include "storage/models/models.h"

namespace fdi::monitor {

/// The model set that each valve is diagnosed with, as of the current
/// models.db: the one assigned to the valve, else the default one, else none.
///
/// The default is the set named by `--model-set`. Without that option it is the
/// active set, provided that there is exactly one and no valve has an
/// assignment.
///
/// Thread safe.
class ModelAssignment : public ModelResolver {
 public:
  /// Called once for each model set, before it is used.
  using Announce = std::function<void(const ModelSet&)>;

  /// Creates or migrates models.db if necessary and loads the default set and
  /// all assigned ones, so that a damaged one is found at once.
  /// @throws NotFoundError, DataError, storage::SqliteError
  ModelAssignment(const std::filesystem::path& path,
                  const std::optional<storage::ModelReference>& wanted,
                  Announce announce);

  std::shared_ptr<const ModelSet> ModelsFor(
      std::string_view valve_id) const override;

  std::vector<std::string> AssignedValves() const override;

  /// True while the baseline of the valve is provisional.
  bool IsolationHeld(std::string_view valve_id) const override;

  /// Number of sets in use now or earlier; at least 1 unless none is assigned.
  std::size_t loaded() const;

  /// Name of the default set: "NAME@VERSION", or "none".
  std::string DefaultName() const;

  /// Number of valves that had a set assigned at construction.
  std::size_t assigned() const { return assigned_; }

 private:
  std::shared_ptr<const ModelSet> Load(
      const storage::ModelReference& reference) const REQUIRES(mutex_);
  std::optional<storage::ModelReference> OnlyActive() const REQUIRES(mutex_);

  mutable Mutex mutex_;
  mutable storage::ModelStore store_ GUARDED_BY(mutex_);
  Announce announce_;
  mutable std::map<std::string, std::shared_ptr<const ModelSet>> loaded_
      GUARDED_BY(mutex_);
  std::shared_ptr<const ModelSet> default_;
  std::size_t assigned_{0};
  std::vector<std::string> assigned_valves_;
};

/// Creates or migrates models.db if necessary, so that it can be read.
void PrepareModels(const std::filesystem::path& path);

}  // namespace fdi::monitor
