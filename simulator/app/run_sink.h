#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "diagnosis/sample.h"
#include "storage/data_directory.h"
#include "storage/runs.h"

namespace fdi::simulator {

/// Records the samples of some valves as runs, committed each second.
class RunSink {
 public:
  /// Makes the data directory if need be.
  /// @throws DataError, SqliteError as RunRecorder.
  explicit RunSink(const storage::DataDirectory& directory);

  /// The runs of valve 0, 1, 2, ... @returns the id of the run.
  std::string Begin(const storage::NewRun& run);
  void Append(std::size_t valve, const LabelledSample& sample);
  void Close();

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

}  // namespace fdi::simulator
