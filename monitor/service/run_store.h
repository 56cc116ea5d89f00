#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include "monitor/sinks.h"
#include "storage/runs/run_recorder.h"
#include "storage/runs/runs.h"

namespace fdi::monitor {

/// runs.db as the recorder of the monitor: one run per source of a valve, whose
/// sample period is derived from its first two samples. A run is closed after a
/// day and a new one begun, so that retention can delete it.
class RunStore : public SampleSink {
 public:
  /// The file is created again, or the other one taken, if it is deleted or
  /// replaced while it is open: Commit() throws once then.
  /// @throws DataError, storage::SqliteError
  RunStore(const std::filesystem::path& path, std::string software);

  void Append(const ReceivedSample& sample) override;
  void Commit() override;
  std::uint64_t DropPending() override;
  void Close() override;
  std::uint64_t recorded() const override;

 private:
  using Key = storage::RunRecorder::Key;
  struct Stream {
    std::uint64_t source_id{0};
    std::optional<Key> run;
    storage::StoredSample first;  // Held until the second one starts a run.
    std::int64_t start_ns{0};     // Start of `run`.
    double period_s{1.0};
    Sample last{};              // The newest one that counted as a step.
    std::vector<double> steps;  // The first ones [s], which tell the period.
  };
  using Streams = std::vector<Stream>;  // of one valve, the newest at the end

  void AppendTo(const std::string& valve_id, Stream& stream,
                const storage::StoredSample& sample);
  void Begin(const std::string& valve_id, Stream& stream, double period_s);
  void AddStep(Stream& stream, const storage::StoredSample& sample);
  void End(const std::string& valve_id, Stream& stream);

  std::string software_;
  storage::RunRecorder recorder_;
  std::unordered_map<std::string, Streams> valves_;
};

}  // namespace fdi::monitor
