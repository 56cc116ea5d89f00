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

#include "cli/program.h"
#include "cli/report.h"
#include "cli/stop_signals.h"
#include "diagnosis/sample.h"
#include "simulator/app/sample_publisher.h"
#include "storage/database/data_directory.h"
#include "storage/runs/run_recorder.h"
#include "storage/runs/runs.h"

/// How samples leave the program, which `run` and `replay` have in common.
namespace fdi::simulator {

struct DeliveryOptions {
  std::optional<std::string> speed;
  std::optional<double> wait_reader_s;
  bool keep_alive{false};
  std::string start;  ///< RFC 3339, or empty: now.
};

void AddDeliveryOptions(CLI::App& verb, DeliveryOptions& options);

/// options.start, or now to the millisecond. @throws ConfigError
std::int64_t StartOf(const DeliveryOptions& options);

/// Reads "1", "0.5", "60" (times real time) or "max" (infinity: as fast as the
/// samples are taken). @throws ConfigError naming these.
double ParseSpeed(std::string_view text);

/// At infinite speed, the reader paces the writer and there must be one.
SamplePublisherOptions PublisherOptionsOf(const DeliveryOptions& options,
                                          double speed);

/// @throws ConfigError unless `valve_id` may name a valve.
void RequireValveId(const std::string& valve_id);

/// A random number that no other publisher has.
std::uint64_t NewSourceId();

/// A sample and the index of its valve.
struct FedSample {
  std::size_t valve{0};
  LabelledSample labelled;
};

/// Yields samples in the order in which they shall leave.
class Feed {
 public:
  virtual ~Feed() = default;
  /// Nothing at the end, or if a stop was requested while it waited.
  virtual std::optional<FedSample> Next() = 0;
};

/// Records the samples of some valves as runs, committed each second.
class RunSink {
 public:
  /// Makes the data directory if need be.
  /// @throws DataError, SqliteError as RunRecorder.
  explicit RunSink(const storage::DataDirectory& directory);

  /// The runs of valve 0, 1, 2, ... @returns the id of the run.
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

/// Where the samples of a feed go; what is null is left out.
struct FeedSinks {
  std::unique_ptr<SamplePublisher> publisher;
  std::unique_ptr<RunSink> runs;
  std::unique_ptr<CsvSink> csv;
};

/// What is delivered for one valve.
struct FedValve {
  std::string valve_id;
  std::uint64_t source_id{0};
  std::optional<std::uint64_t> seed{};
  std::string run_id{};  ///< Of the recorded run; may be empty.
  std::uint64_t samples{0};
  std::int64_t first_stamp_ns{0};
  std::int64_t last_stamp_ns{0};
};

/// Takes all samples of `feed` to the sinks, each when it is due, and closes
/// these. One of stamp s is due (s - s0) / speed after the first one; a gap in
/// the stamps is a pause.
/// @returns what was delivered. Its exit code is kExitTransport if readers lack
///   samples of a lossless delivery that was not interrupted.
cli::Report Deliver(Feed& feed, const FeedSinks& sinks, double speed,
                    cli::StopSignals& signals, std::vector<FedValve> valves);

}  // namespace fdi::simulator
