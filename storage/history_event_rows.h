#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "storage/database.h"
#include "storage/history_trace_writer.h"
#include "storage/history_types.h"

namespace fdi::storage {

/// What HistoryWriter writes of episodes and their events. All within a
/// Transaction.
class HistoryEventRows {
 public:
  HistoryEventRows(Database& database, StatementCache& statements)
      : database_(database), statements_(statements) {}

  /// A transition; without its DETECTED before, it makes the episode.
  /// @returns its id, or nothing if it was there already.
  std::optional<std::int64_t> Add(const NewEvent& event,
                                  std::optional<std::int64_t> session_id);
  /// As HistoryWriter::Close(). @throws NotFoundError
  std::optional<std::int64_t> Close(std::uint64_t episode_id,
                                    std::int64_t stamp_ns, EndReason reason,
                                    std::int64_t now_ns);
  /// @throws NotFoundError
  void Resume(std::uint64_t episode_id, std::int64_t stamp_ns,
              std::int64_t now_ns);

 private:
  // A transition on its way into the tables.
  struct Entry {
    std::string id;
    Transition transition;
    std::int64_t recorded_ns{0};
    std::vector<std::string> names;  // Of the faults, by bit.
  };
  void InsertEpisode(const NewEvent& event, const std::string& id,
                     std::optional<std::int64_t> session_id);
  std::optional<std::int64_t> Store(const Entry& entry);
  bool InsertEvent(const Entry& entry);
  void StoreIsolation(const Entry& entry);
  void StoreUnknown(const Entry& entry);

  Database& database_;
  StatementCache& statements_;
};

}  // namespace fdi::storage
