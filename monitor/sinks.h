#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "diagnosis/model/model_set.h"
#include "diagnosis/model/verdict.h"
#include "diagnosis/records/episode_look.h"
#include "diagnosis/records/fault_event.h"
#include "diagnosis/records/service_records.h"
#include "diagnosis/records/strength_point.h"
#include "diagnosis/records/trace_point.h"

/// The interfaces that the monitor needs; the program implements them with DDS
/// and SQLite. Each sink is called by a single thread, which its comment names.
namespace fdi::monitor {

class Counters;
class ThrottledLog;
struct EpisodeTrace;

/// Shared by all parts of a monitor.
struct MonitorContext {
  Counters& counters;
  ThrottledLog& log;
  std::function<std::int64_t()> utc_now_ns;
};

/// "NAME@VERSION"
inline std::string NameOf(const ModelSet& models) {
  return models.name + "@" + std::to_string(models.version);
}

/// Tells which model set a valve is diagnosed with. Diagnosis thread.
class ModelResolver {
 public:
  virtual ~ModelResolver() = default;
  /// Null if none is assigned.
  /// @throws std::exception if it cannot be loaded: the valve has no model
  ///   then.
  virtual std::shared_ptr<const ModelSet> ModelsFor(
      std::string_view valve_id) const = 0;
  /// The valves with a model set assigned by id rather than by a glob.
  virtual std::vector<std::string> AssignedValves() const { return {}; }
  /// True while the baseline is provisional: faults are detected but not named.
  virtual bool IsolationHeld(std::string_view /*valve_id*/) const {
    return false;
  }
};

/// Takes decision vectors to the bus. Diagnosis thread.
class DecisionSink {
 public:
  virtual ~DecisionSink() = default;
  /// May buffer the vector until Flush().
  /// @param models null for a valve without a model set.
  /// @returns false if it was not sent. @throws DataError for a vector that
  ///   cannot be put on the wire.
  virtual bool Publish(const std::string& valve_id, const ModelSet* models,
                       const Verdict& verdict) = 0;
  /// Sends the buffered vectors; call whenever no sample is waiting. @returns
  /// how many vectors buffered since the last call could not be sent.
  virtual std::uint64_t Flush() { return 0; }

  /// True once the first subscribers arrive: PublishLast() is due for every
  /// valve, and nothing is sent to them before.
  virtual bool LastValuesDue() { return false; }
  /// Publishes a vector that Publish() accepted without subscribers.
  virtual void PublishLast(const std::string& /*valve_id*/,
                           const ModelSet* /*models*/,
                           const Verdict& /*verdict*/) {}
  /// The valve has given up its place: later subscribers get nothing of it.
  virtual void Remove(const std::string& /*valve_id*/) {}
};

/// Takes fault events to the bus. Publishing thread of the journal.
class EventSink {
 public:
  virtual ~EventSink() = default;
  /// @returns false if it was not sent. May throw where it is a step of
  ///   AfterCommit, which does not.
  virtual bool Publish(const FaultEvent& event, bool persisted) = 0;
};

/// The history does not take a record for its own sake: others it would take.
class RecordError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Stores episodes. History thread of the journal. Every call may throw a
/// std::exception and can then be retried; calls are idempotent except where
/// noted. A RecordError is of the record at hand, of the checkpoint, or of what
/// is buffered; any other exception means that the history is out of order.
class HistorySink {
 public:
  virtual ~HistorySink() = default;
  /// Makes the calls of Record(), Resume(), StoreLook(), StoreStrength(),
  /// ConfirmNormal() and StoreSilence() in `batch` one commit: on return
  /// everything is on the disk; on failure, nothing.
  virtual void CommitBatch(const std::function<void()>& batch) = 0;
  /// Within CommitBatch(). @returns whether the event is in the history: false
  ///   if its episode has ended there, or does not exist.
  virtual bool Record(const FaultEvent& event) = 0;
  /// Continues an episode that an earlier session left open. In CommitBatch().
  virtual void Resume(std::uint64_t episode_id, std::int64_t stamp_ns) = 0;
  /// Replaces the earlier look at the episode. Within CommitBatch().
  virtual void StoreLook(const EpisodeLook& look) = 0;
  /// Within CommitBatch().
  virtual void StoreStrength(const StrengthPoint& point) = 0;
  /// The valve was judged normal: so is what ended only with its data. Within
  /// CommitBatch().
  virtual void ConfirmNormal(const std::string& valve_id,
                             std::int64_t stamp_ns) = 0;
  /// Nothing confirms the open episode of the valve since then; nothing: it is
  /// confirmed again. Within CommitBatch().
  virtual void StoreSilence(const std::string& valve_id,
                            std::optional<std::int64_t> since_ns) = 0;
  /// Buffers. Evidence of an unknown episode is dropped.
  virtual void AddTrace(const EpisodeTrace& trace) = 0;
  /// Buffers.
  virtual void AddGap(const DataGap& gap) = 0;
  /// Durable on return; all or nothing. Not idempotent: twice counts twice.
  virtual void CommitCheckpoint(const Checkpoint& checkpoint) = 0;
  /// Marks the event as published. Buffers.
  virtual void MarkSent(const FaultEvent& event) = 0;
  /// Commits what is buffered, and a sign of life; called every second. After a
  /// failure it writes in any case, so that its success proves recovery.
  virtual void Commit() = 0;
  /// Forgets what is buffered.
  virtual void DropBuffered() = 0;
};

/// Stores samples as runs. Recorder thread.
class SampleSink {
 public:
  virtual ~SampleSink() = default;
  /// Buffers.
  virtual void Append(const ReceivedSample& sample) = 0;
  /// Commits what is buffered. @throws std::exception; the buffer is kept.
  virtual void Commit() = 0;
  /// Discards the buffer. @returns the number of samples in it.
  virtual std::uint64_t DropPending() = 0;
  /// Ends all runs and commits what is buffered.
  virtual void Close() = 0;
  /// Number of samples stored so far.
  virtual std::uint64_t recorded() const = 0;
};

/// The result for one sample.
struct ValveOutcome {
  const Verdict& verdict;  ///< Valid until the next call.
  const ModelSet* models;  ///< Null while the valve is UNASSIGNED.
  bool model_swapped;      ///< This is the first sample with another model set.
  /// Signals that the model set needs and the sample lacks. Their channels
  /// abstain; if no channel is left, the quality is BAD_INPUT.
  SignalMask missing{0};
  double period_s{0.0};   ///< The time that the sample stands for.
  bool contested{false};  ///< See ValveMonitor::Contested().
  /// See ValveMonitor::unjudged_since_ns(); nothing: it is judged.
  std::optional<std::int64_t> unjudged_ns{};
  bool found_normal{
      false};          ///< With this sample, as EpisodeOutlet::OnNormal().
  bool notice{false};  ///< Its open episode is no alarm (AlarmBudget).
  SignalMask held{0};  ///< See Decision::held().
};

/// Why a valve sends nothing.
enum class Silence : std::uint8_t {
  kNone,
  kStale,    ///< No sample for three periods.
  kEnded,    ///< Its publisher ended the stream.
  kMonitor,  ///< Its monitor is silent; only on the plant page.
};

/// Follows the valves beside diagnosis and journal: the page, the recorder,
/// health. Each hook is optional, is called by the diagnosis thread after the
/// decision vector has been published, and must not block. One that throws is
/// counted and logged (`part_failed`), and called again the next time.
class ValveListener {
 public:
  virtual ~ValveListener() = default;
  virtual std::string_view name() const = 0;  ///< In the log.

  /// A sample was processed. One out of order (OutOfOrder()) changed nothing:
  /// the verdict is that of an earlier sample.
  virtual void OnVerdict(const std::string& /*valve_id*/,
                         const Sample& /*sample*/,
                         const ValveOutcome& /*outcome*/) {}
  /// The valve fell silent (kStale, kEnded), until its next sample.
  virtual void OnSilence(const std::string& /*valve_id*/, Silence /*silence*/) {
  }
  /// The valve was evicted. Adds to `last` what is still to be stored of it.
  virtual void OnRemoved(const std::string& /*valve_id*/,
                         Checkpoint& /*last*/) {}
  /// Adds what is to be stored: everything each minute and at the end, and
  /// several times a second (`urgent`) only what is too much to keep that long.
  virtual void TakeCheckpoint(Checkpoint& /*checkpoint*/, bool /*urgent*/) {}
};

}  // namespace fdi::monitor
