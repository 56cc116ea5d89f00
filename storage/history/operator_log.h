#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <vector>

#include "diagnosis/records/operator_action.h"
#include "storage/database/database.h"

namespace fdi::storage {

/// The operator actions of a history, in order, for copying to another one.
class OperatorLog {
 public:
  /// @throws DataError, SqliteError as Database.
  explicit OperatorLog(const std::filesystem::path& path);

  /// Actions since the last call; on the first call and after Rewind(), all
  /// since `since_ns`. A shelf is returned again when it has been ended.
  std::vector<OperatorAction> Next(std::int64_t since_ns);
  void Rewind();

 private:
  Database database_;
  std::int64_t data_version_{-1};
  std::int64_t last_event_{0};
  std::map<std::int64_t, bool> shelves_;  // Returned so far; whether ended.
};

}  // namespace fdi::storage
