#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include "monitor/counters.h"
#include "monitor/sinks.h"
#include "monitor/throttled_log.h"
#include "monitor/valve_directory.h"
#include "monitor/valve_monitor.h"

namespace fdi::monitor {

/// Settings of ValveRegistry.
struct RegistryOptions {
  TraceOptions trace;
  std::chrono::milliseconds stale_timeout{3'600'000};  ///< Closes an episode.
  std::chrono::milliseconds recovery_window{60'000};   ///< For silent valves.
};

/// How the valves are now.
struct ValveCensus {
  std::uint64_t valves{0};
  std::uint64_t unassigned{0};
  std::uint64_t stale{0};
  std::uint64_t ended{0};
  std::uint64_t open_episodes{0};
  std::uint64_t trace_bytes{0};
};

/// All valves of a monitor, each made when it is first seen.
///
/// One thread, the diagnosis thread, except where noted.
class ValveRegistry {
 public:
  using TimePoint = ValveMonitor::TimePoint;

  /// @param live is told which valves fall silent; may be null.
  ValveRegistry(const RegistryOptions& options,
                std::shared_ptr<const ModelResolver> resolver,
                EpisodeOutlet& outlet, Counters& counters, ThrottledLog& log,
                LiveSink* live = nullptr);

  /// Episodes that the last session left open, and accumulators that it kept.
  /// Before the first Step().
  void Recover(const std::vector<OpenEpisode>& episodes,
               std::vector<Accumulator> accumulators, TimePoint now);

  ValveOutcome Step(const ValveDirectory::Entry& valve, const Sample& sample,
                    std::uint64_t writer, TimePoint received);

  /// @returns whether the stream of the valve ended.
  bool EndStream(const ValveDirectory::Entry& valve, std::uint64_t writer);

  /// Asks `resolver` from now on, for all valves at once.
  void Reassign(std::shared_ptr<const ModelResolver> resolver);

  /// Looks after silent valves. @param now_ns the same in UTC.
  void Tend(TimePoint now, std::int64_t now_ns);

  /// The last vector of every valve.
  void PublishLast(DecisionSink& decisions) const;

  /// Hands over evidence that is not written yet.
  void Flush();

  /// What is to be kept of all valves; time since the last call.
  Checkpoint TakeCheckpoint();

  /// Thread safe; as of the last Tend().
  ValveCensus census() const;
  /// Ids of all valves seen. Thread safe.
  std::vector<std::string> names() const;

 private:
  ValveMonitor& At(const ValveDirectory::Entry& valve);
  bool Resolve(const std::string& valve_id, std::optional<EngineParts>& parts);
  void TakeCensus();

  RegistryOptions options_;
  std::shared_ptr<const ModelResolver> resolver_;
  EnginePlans plans_;
  EpisodeOutlet& outlet_;
  Counters& counters_;
  ThrottledLog& log_;
  LiveSink* live_;
  std::vector<std::unique_ptr<ValveMonitor>> valves_;
  std::unordered_map<std::string, OpenEpisode> recovered_;
  std::unordered_map<std::string, Accumulator> accumulators_;
  TimePoint recovery_deadline_;
  bool recovering_{false};

  mutable std::mutex mutex_;  // guards what follows
  std::vector<std::string> names_;
  ValveCensus census_;
};

}  // namespace fdi::monitor
