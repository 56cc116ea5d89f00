#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "diagnosis/model/sample.h"
#include "diagnosis/model/sample_series.h"
#include "diagnosis/model/verdict.h"
#include "storage/database/database.h"
#include "storage/runs/sample_codec.h"

namespace fdi::storage {

/// Where a run came from; numbers are part of the file format.
enum class RunOrigin : std::uint8_t { kSimulated, kImported, kRecorded };

enum class RunState : std::uint8_t {
  kRecording,    ///< Being recorded.
  kComplete,     ///< Ended by its recorder, or imported.
  kInterrupted,  ///< Its recorder died; committed samples are intact.
};

std::string_view RunOriginName(RunOrigin origin);  ///< "simulated", ...
std::string_view RunStateName(RunState state);     ///< "recording", ...

/// Properties known when a run begins: one valve, one source, one sample
/// period.
struct NewRun {
  std::string valve_id;
  std::uint64_t source_id{0};
  std::int64_t start_ns{0};  ///< UTC of t = 0.
  double period_s{1.0};
  FlowUnit flow_unit{FlowUnit::kM3PerHour};
  RunOrigin origin{RunOrigin::kRecorded};
  std::string scenario{};  ///< TOML of a simulation, or file of an import.
  std::optional<std::uint64_t> seed{};
  std::string software{};  ///< Version and revision of the program.
};

/// A user's label for t in [from_s, to_s); overrides a stored truth.
struct RunLabel {
  double from_s{0.0};
  double to_s{std::numeric_limits<double>::infinity()};
  int fault{0};  ///< 0 = normal, else 1..kLastFault.
  double strength{0.0};
};

/// A stored run without its samples.
struct RunInfo {
  std::string id;  ///< 12 hex digits.
  NewRun run;
  RunState state{RunState::kComplete};
  std::int64_t created_ns{0};
  std::int64_t samples{0};
  std::int64_t first_stamp_ns{0};  ///< 0 if there is no sample.
  std::int64_t last_stamp_ns{0};
  SignalMask signals{0};  ///< Present in some sample.
  bool has_truth{false};  ///< Stored with every sample.
  std::array<std::int64_t, kIntakeCount> intake{};  ///< Samples by verdict.
  std::int64_t stored_bytes{0};
  std::vector<RunLabel> labels;
  std::int64_t row_id{0};  ///< Key of its rows in the tables.
};

/// Part of a run, written `ID` or `ID@from:to`, where ID may be a unique prefix
/// or `last` for the run stored last. t in [from_s, to_s), seconds from the
/// start of the run.
struct RunSelector {
  std::string id;
  double from_s{-std::numeric_limits<double>::infinity()};
  double to_s{std::numeric_limits<double>::infinity()};

  bool IsStretch() const {
    return from_s > -std::numeric_limits<double>::infinity() ||
           to_s < std::numeric_limits<double>::infinity();
  }
};

/// "1a2b", "1a2b@600:1200", "1a2b@600:", "1a2b@:600".
/// @throws ConfigError naming the accepted forms.
RunSelector ParseRunSelector(std::string_view text);

/// Settings of RunStore::List().
struct RunFilter {
  std::string valve_glob{"*"};  ///< As in a shell: * ? [...].
  std::optional<RunOrigin> origin;
  std::int64_t since_ns{std::numeric_limits<std::int64_t>::min()};
  std::int64_t until_ns{std::numeric_limits<std::int64_t>::max()};
};

/// A run, or part of one, with its samples in order of arrival. Labels are in
/// StoredSample::truth.
struct StoredRun {
  RunInfo info;
  RunSelector selector;
  std::vector<StoredSample> samples;
};

/// Marks a file as a runs.db.
inline constexpr std::int32_t kRunsApplicationId = 0x46444972;  // "FDIr"

/// Schema of runs.db: tables run, run_label, chunk, tail, recorder and the view
/// run_summary; see docs/data.md.
const Schema& RunsSchema();

/// Read access to runs.db; opened as an occasional writer, also imports, labels
/// and deletes. One thread at a time.
class RunStore {
 public:
  /// @throws DataError, SqliteError as Database.
  explicit RunStore(const std::filesystem::path& path,
                    Access access = Access::kReader);

  /// Ordered by start.
  std::vector<RunInfo> List(const RunFilter& filter = {});

  /// `selector` as in ParseRunSelector(); its time range is ignored.
  /// @throws NotFoundError if no run, or more than one, matches.
  RunInfo Info(std::string_view selector);

  /// @throws NotFoundError as Info(), or if the range contains no sample.
  /// @throws DataError naming run and chunk if stored bytes are damaged.
  StoredRun Load(std::string_view selector);

  /// Stores all runs of a table, or none. @returns their ids, in order. Of
  /// `run`, valve, source, start (of t_s = 0), scenario and software are used;
  /// the table supplies the rest. A split table becomes several runs, each
  /// starting at its first sample.
  std::vector<std::string> Import(std::span<const SampleSeries> series,
                                  const NewRun& run);

  /// Labels the selected range; later labels win.
  void Label(std::string_view selector, int fault, double strength);
  /// @returns how many labels the run had.
  int RemoveLabels(std::string_view selector);
  /// @returns the id of the run. @throws ConfigError for a stretch.
  std::string Delete(std::string_view selector);

  Database& database() { return *database_; }

 private:
  /// Resolves a selector to one run. @throws NotFoundError
  RunInfo Find(const RunSelector& selector);
  RunInfo ReadRun(const Statement& row);
  void LoadTable(std::string_view table, std::int64_t from, std::int64_t to,
                 StoredRun& run);

  std::unique_ptr<Database> database_;
};

}  // namespace fdi::storage
