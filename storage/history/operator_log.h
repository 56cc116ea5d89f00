#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <vector>

#include "diagnosis/records/operator_action.h"
#include "storage/database/database.h"

namespace fdi::storage {

/// What operators did in a history, in order, to bring it to another one.
class OperatorLog {
 public:
  /// @throws DataError, SqliteError as Database.
  explicit OperatorLog(const std::filesystem::path& path);

  /// What has come since the last call; at first, and after Rewind(), all since
  /// `since_ns`. A shelf comes again when it is ended.
  std::vector<OperatorAction> Next(std::int64_t since_ns);
  void Rewind();

 private:
  Database database_;
  std::int64_t data_version_{-1};
  std::int64_t last_event_{0};
  std::map<std::int64_t, bool> shelves_;  // That have come; whether ended.
};

}  // namespace fdi::storage
