#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "storage/history/history_database.h"

namespace fdi::storage {

inline constexpr std::int64_t kYear = 31'536'000;  // s
inline constexpr std::int64_t kLastDetectedNs =
    1'795'186'571 * std::int64_t{1'000'000'000};

// Episodes at all times of the year, of 19 faults and unknown, nine in ten
// acknowledged, one in ten labelled, the last hundred open; with their events
// and a small trace, straight into the tables.
inline constexpr const char* kEpisodes = R"sql(
WITH RECURSIVE n(k) AS (VALUES (0) UNION ALL SELECT k + 1 FROM n
                        WHERE k + 1 < ?1),
  t AS (SELECT k, k * 7919 % 1000 AS valve, k * 31 % 20 AS fault,
               ?2 + k * (?3 / ?1) * 1000000000 AS detected FROM n)
INSERT INTO episode (episode_id, valve_id, source_id, detected_ns, isolated_ns,
  cleared_ns, ended_ns, end_reason, fault_bits, peak_factor, strength,
  model_set, model_hash, flow_unit, channels, faults, known, label, acked_by,
  acked_ns, fault)
SELECT printf('%s%012x', ?4, k), printf('V%04d', valve), 1, detected,
  iif(fault = 0, NULL, detected + 20000000000),
  iif(k < ?1 - 100, detected + 600000000000, NULL),
  iif(k < ?1 - 100, detected + 601000000000, NULL),
  iif(k < ?1 - 100, 'cleared', NULL), 1, 0.8, 0.5, 'paper@1', 1, 'm3/h', 'X|F',
  'f1|f7', 'f1|f7', iif(k % 10 = 3, 'true', NULL), iif(k % 10 = 0, NULL, 'anna'), 1,
  iif(fault = 0, iif(k < ?1 - 100, 'unknown', NULL), 'f' || fault)
FROM t)sql";

inline constexpr const char* kFaults = R"sql(
INSERT INTO episode_fault (episode_id, fault, fault_bit, first_ns, held,
  detected_ns)
SELECT episode_id, fault, 0, isolated_ns, 1, detected_ns FROM episode
WHERE isolated_ns IS NOT NULL)sql";

inline constexpr const char* kEvents = R"sql(
INSERT INTO episode_event (episode_id, kind, stamp_ns, recorded_ns)
SELECT episode_id, kind, detected_ns + n, detected_ns FROM episode,
  (SELECT 'DETECTED' AS kind, 0 AS n UNION SELECT 'ISOLATED', 1
   UNION SELECT 'CLEARED', 2 UNION SELECT 'CLOSED', 3))sql";

inline constexpr const char* kTraces = R"sql(
INSERT INTO episode_trace (episode_id, chunk, first_ns, last_ns, instants,
  sample_codec, sample_crc, samples, vector_crc, vectors)
SELECT episode_id, 0, detected_ns, detected_ns, 1, 1, 0, randomblob(?1), 0,
  randomblob(?1) FROM episode)sql";

/// A history.db of a year of 1000 valves. @param first_digits four, of the
/// episode ids; @param blob_bytes random bytes in each of two blobs of
/// evidence.
inline void GenerateEpisodes(const std::filesystem::path& path,
                             std::int64_t episodes,
                             const std::string& first_digits = "0000",
                             int blob_bytes = 600) {
  Database database(path, HistorySchema(), Access::kWriter);
  Transaction transaction(database);
  database.Run(kEpisodes, episodes, kLastDetectedNs - kYear * 1'000'000'000,
               kYear, first_digits);
  database.Run(kFaults);
  database.Run(kEvents);
  database.Run(kTraces, blob_bytes);
  transaction.Commit();
  database.Checkpoint();
}

}  // namespace fdi::storage
