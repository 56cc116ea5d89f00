#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "diagnosis/model/sample.h"
#include "programs/simulator/sample_publisher.h"
#include "report/program.h"
#include "report/report.h"
#include "report/stop_signals.h"
#include "storage/database/data_directory.h"
#include "storage/runs/run_recorder.h"
#include "storage/runs/runs.h"

/// Delivery of samples, shared by `run` and `replay`.
namespace fdi::simulator {

struct DeliveryOptions {
  std::optional<std::string> speed;
  std::optional<double> wait_reader_s;
  bool keep_alive{false};
  std::string start;  ///< RFC 3339, or empty: see StartOf.
};

void AddDeliveryOptions(CLI::App& verb, DeliveryOptions& options);

/// options.start, or so long before now, to the millisecond, that the last of
/// the samples is stamped when it is published and each before it is older than
/// the clock; at real time that is now. @throws ConfigError
std::int64_t StartOf(const DeliveryOptions& options, double duration_s,
                     double speed);

/// Parses "1", "0.5", "60" (times real time) or "max" (infinity: as fast as the
/// readers accept samples). @throws ConfigError naming these.
double ParseSpeed(std::string_view text);

/// At infinite speed a reader is required, and paces the writer.
SamplePublisherOptions PublisherOptionsOf(const DeliveryOptions& options,
                                          double speed);

/// @throws ConfigError unless `valve_id` is valid.
void RequireValveId(const std::string& valve_id);

/// A random number, unique among publishers.
std::uint64_t NewSourceId();

/// A sample with the index of its valve.
struct FedSample {
  std::size_t valve{0};
  LabelledSample labelled;
};

/// Yields samples in the order of delivery.
class Feed {
 public:
  virtual ~Feed() = default;
  /// Nothing at the end, or if a stop was requested while waiting.
  virtual std::optional<FedSample> Next() = 0;
};

/// Records the samples of some valves as runs, committed every second.
class RunSink {
 public:
  /// Creates the data directory if necessary.
  /// @throws DataError, SqliteError as RunRecorder.
  explicit RunSink(const storage::DataDirectory& directory);

  /// Begins the run of valve 0, 1, 2, ... @returns the id of the run.
  std::string Begin(const storage::NewRun& run);
  void Append(std::size_t valve, const LabelledSample& sample);
  void Close() { recorder_.Close(); }

 private:
  storage::RunRecorder recorder_;
  std::vector<storage::RunRecorder::Key> keys_;
  std::chrono::steady_clock::time_point last_commit_;
};

/// Collects the samples of one valve for a CSV file.
class CsvSink {
 public:
  /// @throws DataError naming the file and the reason if it cannot be written.
  explicit CsvSink(const std::filesystem::path& path);

  void Append(const LabelledSample& sample) { samples_.push_back(sample); }
  /// Writes the file; t_s counts from the first sample.
  void Close();

 private:
  std::ofstream file_;
  std::vector<LabelledSample> samples_;
};

/// Destinations of a feed; null ones are skipped.
struct FeedSinks {
  std::unique_ptr<SamplePublisher> publisher;
  std::unique_ptr<RunSink> runs;
  std::unique_ptr<CsvSink> csv;
};

/// The delivery of one valve.
struct FedValve {
  std::string valve_id;
  std::uint64_t source_id{0};
  std::optional<std::uint64_t> seed{};
  std::string run_id{};  ///< Id of the recorded run, if any.
  std::uint64_t samples{0};
  std::int64_t first_stamp_ns{0};
  std::int64_t last_stamp_ns{0};
};

/// Passes all samples of `feed` to the sinks, each when it is due, and closes
/// these. A sample with stamp s is due (s - s0) / speed after the first one; a
/// gap in the stamps is a pause.
/// @returns a summary. Its exit code is kExitTransport if readers miss samples
///   of a lossless delivery that was not interrupted.
report::Report Deliver(Feed& feed, const FeedSinks& sinks, double speed,
                       report::StopSignals& signals,
                       std::vector<FedValve> valves);

}  // namespace fdi::simulator
