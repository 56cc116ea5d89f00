#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

#include "storage/database.h"
#include "storage/run_types.h"

namespace fdi::storage {

/// A run and the key of its rows.
struct FoundRun {
  std::int64_t run_id{0};
  RunInfo info;
};

/// Seconds from the start of a run as ns UTC; what is beyond the numbers is
/// their end.
std::int64_t StampAt(const RunInfo& info, double t_s);

/// The queries of runs.db.
class RunReader {
 public:
  explicit RunReader(Database& database) : database_(database) {}

  std::vector<RunInfo> List(const RunFilter& filter);
  /// @throws NotFoundError if no run, or more than one, begins like that.
  FoundRun Find(const RunSelector& selector);
  StoredRun Load(std::string_view selector);

 private:
  FoundRun Read(const Statement& row);
  void ReadLabels(FoundRun& found);
  void LoadTable(std::string_view table, std::int64_t run_id, std::int64_t from,
                 std::int64_t to, StoredRun& run);

  Database& database_;
};

}  // namespace fdi::storage
