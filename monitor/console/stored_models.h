#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <string>

#include "monitor/console/model_facts.h"
#include "storage/history_types.h"

namespace fdi::console {

/// The facts of model sets in models.db that episodes were found with. Thread
/// safe; keeps the last 32.
class StoredModels {
 public:
  explicit StoredModels(std::filesystem::path models)
      : path_(std::move(models)) {}

  /// Of the set that made the episode; of one that is gone what the episode
  /// itself tells: names, without thresholds (NaN).
  std::shared_ptr<const ModelFacts> For(const storage::Episode& episode);

 private:
  std::filesystem::path path_;
  std::mutex mutex_;
  std::map<std::string, std::shared_ptr<const ModelFacts>> known_;
};

}  // namespace fdi::console
