#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>

#include "base/bounded_queue.h"
#include "base/mutex.h"
#include "base/worker.h"
#include "monitor/counters.h"
#include "monitor/heartbeat.h"
#include "monitor/sinks.h"
#include "monitor/throttled_log.h"

namespace fdi::monitor {

/// Settings of Recorder.
struct RecorderOptions {
  bool lossless{false};  ///< Record() blocks while the queue is full.
  std::size_t queue_samples{16'384};
  /// Keeps the loss in a crash below 1 s, including the time of a commit.
  std::chrono::milliseconds commit_period{750};
  std::uint64_t commit_samples{100'000};  ///< Commit earlier after so many.
  std::uint64_t max_pending{200'000};     ///< Bound while commits fail.
};

/// Stores samples as runs in a thread of its own. Samples that are not stored
/// are counted; while commits fail, samples are kept up to a limit and then
/// dropped, so that the diagnosis continues. The time of the drops becomes a
/// data gap of all valves, "record_dropped", once a commit succeeds again.
///
/// Samples out of order are recorded, too: re-scoring a run must give the
/// engine what it was given here. A run ends when its stream does or its valve
/// is evicted.
///
/// Built idle. It is stopped before what `on_gap` calls.
class Recorder : public ValveListener {
 public:
  /// @param on_gap called by the recorder thread.
  Recorder(SampleSink& sink, const MonitorContext& context,
           const RecorderOptions& options, std::function<void(DataGap)> on_gap);
  ~Recorder() override;
  Recorder(const Recorder&) = delete;
  Recorder& operator=(const Recorder&) = delete;

  std::string_view name() const override { return "recorder"; }
  void OnVerdict(const std::string& valve_id, const Sample& sample,
                 const ValveOutcome& outcome) override {
    Record({valve_id, sample, outcome.verdict.intake,
            outcome.verdict.initialised, outcome.model_swapped, false});
  }
  void OnSilence(const std::string& valve_id, Silence silence) override {
    if (silence == Silence::kEnded) {
      Record({valve_id, {}, {}, false, false, true});
    }
  }
  void OnRemoved(const std::string& valve_id, Checkpoint& /*last*/) override {
    Record({valve_id, {}, {}, false, false, true});
  }

  void Start();
  /// Stores the queue and ends the runs and the thread; does nothing if it
  /// was not started. @throws the exception that ended the thread.
  void Stop();

  /// The thread ended with an exception.
  bool failed() const { return worker_.failed(); }
  bool degraded() const { return degraded_; }
  /// Beaten by the recorder thread.
  const Pulse& pulse() const { return pulse_; }
  /// Number of queued samples.
  std::size_t waiting() const { return queue_.size(); }

 private:
  void Record(ReceivedSample sample);
  void Run();
  void Take(const ReceivedSample& sample);
  void Commit();
  void Close();
  void CountRecorded();
  void CountDropped(std::uint64_t samples);
  void ReportMissing();
  void Fail(const char* reason);

  SampleSink& sink_;
  MonitorContext context_;
  RecorderOptions options_;
  std::function<void(DataGap)> on_gap_;
  std::atomic<bool> degraded_{false};
  Pulse pulse_;
  std::uint64_t pending_{0};
  std::uint64_t recorded_{0};  // counted so far
  std::chrono::steady_clock::time_point last_commit_;
  BoundedQueue<ReceivedSample> queue_;

  Mutex missing_mutex_;
  // Not yet reported.
  std::optional<DataGap> missing_ GUARDED_BY(missing_mutex_);
  // Dropped since the last commit.
  bool missing_more_ GUARDED_BY(missing_mutex_){false};

  Worker worker_;
};

}  // namespace fdi::monitor
