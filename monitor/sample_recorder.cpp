#include "monitor/sample_recorder.h"

#include <exception>
#include <string>
#include <utility>

namespace fdi::monitor {
namespace {

constexpr std::chrono::milliseconds kTick{100};

}  // namespace

SampleRecorder::SampleRecorder(SampleSink& sink, Counters& counters,
                               ThrottledLog& log, SampleRecorderOptions options,
                               std::function<void(DataGap)> on_gap)
    : sink_(sink),
      counters_(counters),
      log_(log),
      options_(std::move(options)),
      on_gap_(std::move(on_gap)),
      last_commit_(std::chrono::steady_clock::now()),
      queue_(options_.queue_samples),
      thread_([this] { Run(); }) {}

SampleRecorder::~SampleRecorder() {
  Stop();
}

void SampleRecorder::Record(ReceivedSample sample) {
  const bool taken = options_.lossless ? queue_.Push(std::move(sample))
                                       : queue_.TryPush(std::move(sample));
  if (!taken) {
    CountDropped(1);
    log_.Report(LogId::kRecordDropped, "record_dropped",
                [] { return std::string("reason=queue_full"); });
  }
}

void SampleRecorder::Stop() {
  queue_.Close();
  if (thread_.joinable()) {
    thread_.join();
  }
}

void SampleRecorder::Run() {
  std::vector<ReceivedSample> batch;
  while (queue_.PopAll(batch, kTick)) {
    pulse_.Beat();
    for (const ReceivedSample& sample : batch) {
      Take(sample);
    }
    if (std::chrono::steady_clock::now() - last_commit_ >=
        options_.commit_period) {
      Commit();
    }
  }
  Close();
}

void SampleRecorder::Take(const ReceivedSample& sample) {
  try {
    sink_.Append(sample);
    pending_ += sample.ended ? 0 : 1;
  } catch (const std::exception& error) {
    CountDropped(1);
    Fail(error.what());
  }
  if (!degraded_ && pending_ >= options_.commit_samples) {
    Commit();
  }
  if (pending_ >= options_.max_pending) {
    CountDropped(sink_.DropPending());
    pending_ = 0;
  }
}

void SampleRecorder::Commit() {
  last_commit_ = std::chrono::steady_clock::now();
  if (degraded_ && pending_ == 0) {
    return;  // Storing nothing would tell nothing.
  }
  try {
    sink_.Commit();
    CountRecorded();
    ReportMissing();
    if (degraded_.exchange(false)) {
      log_.Line(LogLevel::kInfo, "recording_recovered");
    }
  } catch (const std::exception& error) {
    Fail(error.what());
  }
}

void SampleRecorder::Close() {
  try {
    sink_.Close();
    CountRecorded();
  } catch (const std::exception& error) {
    Fail(error.what());
    CountDropped(std::exchange(pending_, 0));
  }
  missing_more_ = false;
  ReportMissing();
}

void SampleRecorder::CountDropped(std::uint64_t samples) {
  if (samples == 0) {
    return;
  }
  counters_.Add(Counter::kRecordDropped, samples);
  const std::int64_t now_ns = options_.utc_now_ns();
  const std::lock_guard lock(missing_mutex_);
  if (!missing_) {
    missing_ = DataGap{"", now_ns, now_ns, "record_dropped"};
  }
  missing_->to_ns = now_ns;
  missing_more_ = true;
}

// One gap for drops that go on, once none was added since the last commit.
void SampleRecorder::ReportMissing() {
  std::optional<DataGap> gap;
  {
    const std::lock_guard lock(missing_mutex_);
    if (!std::exchange(missing_more_, false)) {
      gap = std::exchange(missing_, std::nullopt);
    }
  }
  if (gap) {
    on_gap_(*std::move(gap));
  }
}

void SampleRecorder::CountRecorded() {
  const std::uint64_t recorded = sink_.recorded();
  counters_.Add(Counter::kRecorded,
                recorded - std::exchange(recorded_, recorded));
  pending_ = 0;
}

void SampleRecorder::Fail(const char* reason) {
  degraded_ = true;
  counters_.Add(Counter::kRecordFailures);
  const std::string text = reason;
  log_.Report(
      LogId::kRecordFailed, "record_failed",
      [&text] { return "reason=\"" + text + "\""; }, LogLevel::kError);
}

}  // namespace fdi::monitor
