#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "cli/csv.h"
#include "cli/stop_signals.h"
#include "diagnosis/log.h"
#include "simulator/app/delivery.h"
#include "simulator/app/json_line_reader.h"
#include "simulator/valve_equations.h"

/// Samples that were taken before, or elsewhere: the feeds of `replay`.
namespace fdi::simulator {

/// How replayed samples are stamped: the first one at start() and the others
/// as far behind it as they were; or as they are.
struct Restamping {
  bool keep{false};
  std::function<std::int64_t()> start{};  ///< Asked once, at the first sample.
  std::uint64_t source_id{0};             ///< Of all samples.
};

/// Applies a Restamping to one sample after another.
class Restamper {
 public:
  explicit Restamper(Restamping restamping)
      : restamping_(std::move(restamping)) {}
  void Apply(Sample& sample);
  /// Stamps by the arrival now_ns, on the grid of `period_ns` from the first.
  void StampByClock(std::int64_t now_ns, std::int64_t period_ns,
                    Sample& sample);

 private:
  Restamping restamping_;
  std::optional<std::int64_t> shift_ns_;
  std::optional<std::int64_t> last_stamp_ns_;
};

/// Logs `flow_converted` unless the units are the same.
void ReportConversion(const LogSink& log, const std::string& run, FlowUnit from,
                      FlowUnit to);

/// Samples that are all known: a stored run or a file.
class StoredFeed final : public Feed {
 public:
  StoredFeed(std::vector<LabelledSample> samples, Restamping restamping)
      : samples_(std::move(samples)), restamper_(std::move(restamping)) {}
  std::optional<FedSample> Next() override;

 private:
  std::vector<LabelledSample> samples_;
  Restamper restamper_;
  std::size_t next_{0};
};

/// Settings of StreamFeed.
struct StreamOptions {
  cli::ColumnMap map;
  bool split_gaps{false};
  /// 0: the first step; of JSON lines without t_s, 1 s.
  double period_s{0.0};
  /// To which a flow is converted; nothing: as it comes.
  std::optional<FlowUnit> flow_unit{};
};

/// Samples that come line by line from a pipe, as CSV or as JSON (told by the
/// first line). A signal ends the wait for the next line.
class StreamFeed final : public Feed {
 public:
  StreamFeed(int descriptor, cli::StopSignals& signals,
             const StreamOptions& options, Restamping restamping, LogSink log);
  /// @throws DataError naming the line, as CsvReader and JsonLineReader, or if
  ///   a line has more than 1 MiB.
  /// @throws std::system_error if reading fails.
  std::optional<FedSample> Next() override;

 private:
  std::optional<std::string> NextLine();
  bool Fill();
  std::optional<Sample> TakeLine(const std::string& line);
  void ConvertFlow(Sample& sample);
  void ReportIgnored(const std::vector<std::string>& names);

  int descriptor_;
  cli::StopSignals& signals_;
  StreamOptions options_;
  Restamper restamper_;
  LogSink log_;
  std::string buffer_;
  std::size_t begin_{0};  // Of what was not handed out.
  bool ended_{false};
  cli::CsvReader csv_;
  cli::StepCheck steps_;
  JsonLineReader json_;
  std::optional<bool> is_json_;
  bool reported_{false};
  std::optional<FlowConversion> conversion_;
};

}  // namespace fdi::simulator
