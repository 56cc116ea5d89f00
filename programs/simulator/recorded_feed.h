#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "base/log.h"
#include "import/csv.h"
#include "programs/simulator/delivery.h"
#include "programs/simulator/json_line_reader.h"
#include "report/stop_signals.h"
#include "simulator/valve_equations.h"

/// Samples recorded earlier or elsewhere: the feeds of `replay`.
namespace fdi::simulator {

/// How replayed samples are stamped: shifted so that the first one is at
/// start(), or unchanged (`keep`).
struct Restamping {
  bool keep{false};
  std::function<std::int64_t()> start{};  ///< Called at the first sample.
  std::uint64_t source_id{0};             ///< Of all samples.
};

/// Applies a Restamping to successive samples.
class Restamper {
 public:
  explicit Restamper(Restamping restamping)
      : restamping_(std::move(restamping)) {}
  void Apply(Sample& sample);
  /// Stamps by the arrival time now_ns, rounded to a grid of `period_ns`.
  void StampByClock(std::int64_t now_ns, std::int64_t period_ns,
                    Sample& sample);

 private:
  Restamping restamping_;
  std::optional<std::int64_t> shift_ns_;
  std::optional<std::int64_t> last_stamp_ns_;
};

/// Logs `flow_converted` unless the units are equal.
void ReportConversion(const LogSink& log, const std::string& run, FlowUnit from,
                      FlowUnit to);

/// Samples that are known in advance: a stored run or a file.
class StoredFeed final : public Feed {
 public:
  using Parts = std::vector<std::vector<LabelledSample>>;
  StoredFeed(Parts parts, Restamping restamping)
      : parts_(std::move(parts)), restamper_(std::move(restamping)) {}
  std::optional<FedSample> Next() override;

 private:
  Parts parts_;  // Each is freed behind its last sample.
  Restamper restamper_;
  std::size_t part_{0};
  std::size_t next_{0};
};

/// Settings of StreamFeed.
struct StreamOptions {
  importer::ColumnMap map;
  bool split_gaps{false};
  /// 0: the first step, or 1 s for JSON lines without t_s.
  double period_s{0.0};
  /// To which flow is converted; nothing: unchanged.
  std::optional<FlowTarget> flow{};
};

/// Samples from a pipe, line by line, as CSV or JSON (detected from the first
/// line). A signal interrupts waiting for the next line.
class StreamFeed final : public Feed {
 public:
  StreamFeed(int descriptor, report::StopSignals& signals,
             const StreamOptions& options, Restamping restamping, LogSink log);
  /// @throws DataError naming the line, as CsvReader and JsonLineReader, or for
  ///   a line longer than 1 MiB.
  /// @throws std::system_error if reading fails.
  std::optional<FedSample> Next() override;

 private:
  std::optional<std::string> NextLine();
  bool Fill();
  std::optional<Sample> TakeLine(const std::string& line);
  void ConvertFlow(Sample& sample);
  void ReportIgnored(const std::vector<std::string>& names);

  int descriptor_;
  report::StopSignals& signals_;
  StreamOptions options_;
  Restamper restamper_;
  LogSink log_;
  std::string buffer_;
  std::size_t begin_{0};  // Start of the unread part.
  bool ended_{false};
  importer::CsvReader csv_;
  importer::StepCheck steps_;
  JsonLineReader json_;
  std::optional<bool> is_json_;
  bool reported_{false};
  std::optional<FlowConversion> conversion_;
};

}  // namespace fdi::simulator
