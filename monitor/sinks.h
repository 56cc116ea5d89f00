#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "diagnosis/model_set.h"
#include "diagnosis/records/episode_look.h"
#include "diagnosis/records/fault_event.h"
#include "diagnosis/records/service_records.h"
#include "diagnosis/records/strength_point.h"
#include "diagnosis/records/trace_point.h"
#include "diagnosis/verdict.h"

/// What the monitor needs from outside; the program wires it to DDS and SQLite.
/// Each sink is called by one thread only, which its comment names.
namespace fdi::monitor {

class Counters;
class ThrottledLog;
struct EpisodeTrace;

/// What all parts of a monitor share.
struct MonitorContext {
  Counters& counters;
  ThrottledLog& log;
  std::function<std::int64_t()> utc_now_ns;
};

/// "NAME@VERSION"
inline std::string NameOf(const ModelSet& models) {
  return models.name + "@" + std::to_string(models.version);
}

/// Says which model set a valve is diagnosed with. Diagnosis thread.
class ModelResolver {
 public:
  virtual ~ModelResolver() = default;
  /// Null if none is assigned.
  /// @throws std::exception if it cannot be had: the valve goes without.
  virtual std::shared_ptr<const ModelSet> ModelsFor(
      std::string_view valve_id) const = 0;
  /// The valves that a model set is assigned to by their id, not by a glob.
  virtual std::vector<std::string> AssignedValves() const { return {}; }
  /// Its faults are detected and not named: the baseline is provisional.
  virtual bool IsolationHeld(std::string_view /*valve_id*/) const {
    return false;
  }
};

/// Takes decision vectors to the bus. Diagnosis thread.
class DecisionSink {
 public:
  virtual ~DecisionSink() = default;
  /// May keep it back until Flush().
  /// @param models null for a valve without a model set.
  /// @returns false if it was not sent.
  virtual bool Publish(const std::string& valve_id, const ModelSet* models,
                       const Verdict& verdict) = 0;
  /// Sends what was kept back; to be called whenever no sample waits.
  /// @returns how many vectors were kept back since the last call and could not
  ///   be sent.
  virtual std::uint64_t Flush() { return 0; }

  /// True once somebody listens where nobody did: PublishLast() is due for
  /// every valve. Nothing is sent to newcomers before.
  virtual bool WantsLast() { return false; }
  /// A vector that Publish() took while nobody listened.
  virtual void PublishLast(const std::string& /*valve_id*/,
                           const ModelSet* /*models*/,
                           const Verdict& /*verdict*/) {}
};

/// Takes fault events to the bus. Publishing thread of the journal.
class EventSink {
 public:
  virtual ~EventSink() = default;
  /// @returns false if it was not sent.
  virtual bool Publish(const FaultEvent& event, bool persisted) = 0;
};

/// Stores episodes. History thread of the journal. Every call may fail with a
/// std::exception, can be repeated then, and doing it twice is a no-op except
/// where noted.
class HistorySink {
 public:
  virtual ~HistorySink() = default;
  /// Makes the calls of Record(), Resume(), StoreLook() and StoreStrength() in
  /// `batch` one commit: all of it is on the disk on return or, if it fails,
  /// nothing.
  virtual void CommitBatch(const std::function<void()>& batch) = 0;
  /// Within CommitBatch().
  virtual void Record(const FaultEvent& event) = 0;
  /// An episode left open by an earlier session goes on. Within CommitBatch().
  virtual void Resume(std::uint64_t episode_id, std::int64_t stamp_ns) = 0;
  /// Replaces the earlier look at the episode. Within CommitBatch().
  virtual void StoreLook(const EpisodeLook& look) = 0;
  /// Within CommitBatch().
  virtual void StoreStrength(const StrengthPoint& point) = 0;
  /// Buffers. Evidence of an episode that is not there is dropped.
  virtual void AddTrace(const EpisodeTrace& trace) = 0;
  /// Buffers.
  virtual void AddGap(const DataGap& gap) = 0;
  /// On the disk on return, as a whole or, if it fails, not at all. Twice
  /// counts twice.
  virtual void CommitCheckpoint(const Checkpoint& checkpoint) = 0;
  /// The event is on the bus. Buffers.
  virtual void MarkSent(const FaultEvent& event) = 0;
  /// Stores what is buffered, and a sign of life; called each second. After a
  /// call that failed it writes in any case, so that success tells something.
  virtual void Commit() = 0;
};

/// Stores samples as runs. Recorder thread.
class SampleSink {
 public:
  virtual ~SampleSink() = default;
  /// Buffers.
  virtual void Append(const ReceivedSample& sample) = 0;
  /// Stores what is buffered. @throws std::exception; then it still is.
  virtual void Commit() = 0;
  /// Forgets what is buffered. @returns how many samples that were.
  virtual std::uint64_t DropPending() = 0;
  /// Ends all runs and stores what is buffered.
  virtual void Close() = 0;
  /// How many samples are stored by now.
  virtual std::uint64_t recorded() const = 0;
};

/// What became of one sample.
struct ValveOutcome {
  const Verdict& verdict;  ///< Stands until the next call.
  const ModelSet* models;  ///< Null while the valve is UNASSIGNED.
  bool model_swapped;      ///< Another model set answers from here on.
  bool isolation_held;     ///< See ModelResolver::IsolationHeld().
  /// Signals that the model set reads and the sample lacks. Their channels
  /// abstain; without any channel left the quality is BAD_INPUT.
  SignalMask missing{0};
};

/// Why nothing comes from a valve.
enum class Silence : std::uint8_t {
  kNone,
  kStale,    ///< No sample for three periods.
  kEnded,    ///< Its publisher ended the stream.
  kMonitor,  ///< Its monitor is silent; the page of a plant alone says so.
};

/// Shows people how the valves are. Diagnosis thread, which must not wait.
class LiveSink {
 public:
  virtual ~LiveSink() = default;
  /// A sample in its order and what became of it.
  virtual void Show(const std::string& valve_id, const Sample& sample,
                    const ValveOutcome& outcome) = 0;
  /// The valve fell silent; its next sample ends that.
  virtual void ShowSilence(const std::string& valve_id, Silence silence) = 0;
  /// The valve has given its place up: it is not shown any more.
  virtual void Forget(const std::string& /*valve_id*/) {}
};

}  // namespace fdi::monitor
