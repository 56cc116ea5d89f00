#include "simulator/app/run_sink.h"

#include <cerrno>
#include <cstring>

#include "diagnosis/error.h"

namespace fdi::simulator {
namespace {

using std::chrono::steady_clock;

// At full speed, memory is the limit and not the clock.
constexpr std::int64_t kMostPending = 50'000;
constexpr std::chrono::milliseconds kCommitPeriod(750);  // Loses less than 1 s.

std::filesystem::path Prepared(const storage::DataDirectory& directory) {
  storage::EnsureExists(directory);
  return directory.runs();
}

}  // namespace

RunSink::RunSink(const storage::DataDirectory& directory)
    : recorder_(Prepared(directory)), last_commit_(steady_clock::now()) {}

std::string RunSink::Begin(const storage::NewRun& run) {
  keys_.push_back(recorder_.Begin(run));
  return recorder_.Id(keys_.back());
}

void RunSink::Append(std::size_t valve, const LabelledSample& sample) {
  recorder_.Append(keys_[valve], sample);
  const auto now = steady_clock::now();
  if (now - last_commit_ >= kCommitPeriod ||
      recorder_.pending() >= kMostPending) {
    recorder_.Commit();
    last_commit_ = now;
  }
}

void RunSink::Close() {
  recorder_.Close();
}

CsvSink::CsvSink(const std::filesystem::path& path) : file_(path) {
  if (!file_) {
    throw DataError(path.string() +
                    " cannot be written: " + std::strerror(errno));
  }
}

void CsvSink::Close() {
  if (!samples_.empty()) {
    storage::WriteCsv(file_, samples_, samples_.front().sample.flow_unit,
                      samples_.front().sample.stamp_ns);
  }
}

}  // namespace fdi::simulator
