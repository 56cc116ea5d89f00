#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <unordered_map>
#include <vector>

#include "storage/database.h"
#include "storage/history_types.h"

namespace fdi::storage {

/// Statements of one connection, prepared once each; keyed by literals.
class StatementCache {
 public:
  explicit StatementCache(Database& database) : database_(database) {}
  Statement& operator()(const char* sql);

 private:
  Database& database_;
  std::unordered_map<const char*, Statement> statements_;
};

/// The traces that HistoryWriter is at: buffers instants and stores them in
/// chunks; the last chunk of an episode is replaced until it is full.
class HistoryTraceWriter {
 public:
  HistoryTraceWriter(Database& database, StatementCache& statements)
      : database_(database), statements_(statements) {}

  /// As the functions of HistoryWriter of that name.
  bool Append(std::uint64_t episode_id, std::span<const TraceInstant> instants);
  void End(std::uint64_t episode_id);
  void EndAll();
  /// From now on the peak factor is that of this set.
  void SetIsolated(std::uint64_t episode_id, FaultSet isolated);

  bool HasPending() const;
  /// Within a transaction: writes what is not yet in the file.
  void Store();
  /// Once that is committed: forgets what is in full chunks.
  void Settle();

 private:
  // The instants of an episode that are not yet in full chunks.
  struct Buffer {
    std::vector<TraceInstant> instants;
    std::int64_t chunk{0};  // Number of the chunk that instants[0] begins.
    std::size_t channels{0};
    std::size_t faults{0};
    FaultSet isolated{0};
    std::int64_t detected_ns{0};
    bool dirty{false};
    bool ended{false};
  };
  static double Peak(const Buffer& buffer);
  Buffer& BufferOf(std::uint64_t episode_id);
  void StoreBuffer(std::uint64_t episode_id, const Buffer& buffer);

  Database& database_;
  StatementCache& statements_;
  std::map<std::uint64_t, Buffer> buffers_;
};

}  // namespace fdi::storage
