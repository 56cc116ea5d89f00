#include "monitor/recorder.h"

#include <algorithm>
#include <exception>
#include <string>
#include <utility>

#include "base/printable.h"

// Record() runs in the diagnosis thread, everything that Run() calls in the
// recorder's, which is the only one to use the sink. They share the queue, the
// counters and members guarded by `missing_mutex_`: both call CountDropped().
namespace fdi::monitor {
namespace {

constexpr std::chrono::milliseconds kTick{100};

}  // namespace

Recorder::Recorder(SampleSink& sink, const MonitorContext& context,
                   const RecorderOptions& options,
                   std::function<void(DataGap)> on_gap)
    : sink_(sink),
      context_(context),
      options_(options),
      on_gap_(std::move(on_gap)),
      queue_(options_.queue_samples) {}

Recorder::~Recorder() {
  try {
    Stop();
  } catch (...) {
    // The error is reported only to those who call Stop() themselves.
  }
}

void Recorder::Start() {
  last_commit_ = std::chrono::steady_clock::now();
  worker_.Start([this] {
    try {
      Run();
    } catch (...) {
      queue_.Close();  // Unblocks Record().
      throw;
    }
  });
}

void Recorder::Stop() {
  if (worker_.started()) {
    queue_.Close();
    worker_.Join();
  }
}

void Recorder::Record(ReceivedSample sample) {
  const bool taken = options_.lossless ? queue_.Push(std::move(sample))
                                       : queue_.TryPush(std::move(sample));
  if (!taken) {
    CountDropped(1);
    context_.log.Report(LogId::kRecordDropped, "record_dropped",
                        [] { return std::string("reason=queue_full"); });
  }
}

void Recorder::Run() {
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

// While commits fail only the period leads to another one, not the number of
// samples: each try costs time in which the queue fills. Samples that wait are
// dropped at the limit.
void Recorder::Take(const ReceivedSample& sample) {
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

void Recorder::Commit() {
  last_commit_ = std::chrono::steady_clock::now();
  if (degraded_ && pending_ == 0) {
    return;  // An empty commit would not show whether the disk works again.
  }
  try {
    sink_.Commit();
    CountRecorded();
    ReportMissing();
    if (degraded_.exchange(false)) {
      context_.log.Line(LogLevel::kInfo, "recording_recovered");
    }
  } catch (const std::exception& error) {
    Fail(error.what());
  }
}

void Recorder::Close() {
  try {
    sink_.Close();
    CountRecorded();
  } catch (const std::exception& error) {
    Fail(error.what());
    CountDropped(std::exchange(pending_, 0));
  }
  {
    const MutexLock lock(missing_mutex_);
    // No commit period follows, so the gap is reported now.
    missing_more_ = false;
  }
  ReportMissing();
}

void Recorder::CountDropped(std::uint64_t samples) {
  if (samples == 0) {
    return;
  }
  context_.counters.Add(Counter::kRecordDropped, samples);
  const std::int64_t now_ns = context_.utc_now_ns();
  const MutexLock lock(missing_mutex_);
  if (!missing_) {
    missing_ = DataGap{"", now_ns, now_ns, "record_dropped"};
  }
  // The clock may have been set back since the last one.
  missing_->from_ns = std::min(missing_->from_ns, now_ns);
  missing_->to_ns = now_ns;
  missing_more_ = true;
}

// Drops in successive commit periods become one gap, reported once they cease.
void Recorder::ReportMissing() {
  std::optional<DataGap> gap;
  {
    const MutexLock lock(missing_mutex_);
    if (!std::exchange(missing_more_, false)) {
      gap = std::exchange(missing_, std::nullopt);
    }
  }
  if (gap) {
    on_gap_(*std::move(gap));
  }
}

void Recorder::CountRecorded() {
  const std::uint64_t recorded = sink_.recorded();
  context_.counters.Add(Counter::kRecorded,
                        recorded - std::exchange(recorded_, recorded));
  pending_ = 0;
}

void Recorder::Fail(const char* reason) {
  degraded_ = true;
  context_.counters.Add(Counter::kRecordFailures);
  const std::string text = reason;
  context_.log.Report(
      LogId::kRecordFailed, "record_failed",
      [&text] { return "reason=" + LogValue(text); }, LogLevel::kError);
}

}  // namespace fdi::monitor
