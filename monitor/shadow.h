#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "diagnosis/valve_engine.h"
#include "monitor/checkpoint.h"
#include "monitor/sinks.h"
#include "monitor/throttled_log.h"

namespace fdi::monitor {

/// Whether the candidate can be compared on a valve.
enum class ShadowFit : std::uint8_t {
  kCompared,
  kNoActive,  ///< No model set is assigned to the valve.
  kSameSet,   ///< The candidate is the active set there.
  kSignals,   ///< A signal that the candidate reads is not delivered.
  kUnit,      ///< Its flow is in the other unit.
  kPeriod,    ///< The active set is for another sample period.
};
inline constexpr std::size_t kShadowFitCount = 6;
std::string_view ShadowFitName(ShadowFit fit);  ///< "compared", "signals", ...

/// What became of a sample that both sets were given.
enum class ShadowOutcome : std::uint8_t {
  kAgreed,
  kDiffered,
  kNotJudged,  ///< By one of both: not LIVE.
};
inline constexpr std::size_t kShadowOutcomeCount = 3;

/// Bounds on what is recorded.
struct ShadowLimits {
  int min_samples{5};    ///< Shorter stretches are only counted.
  int max_per_hour{60};  ///< Stretches of one valve in an hour of time.
  std::int64_t silence_ns{3'600'000'000'000};  ///< Ends the open episode.
};

/// Settings of ShadowBank.
struct ShadowOptions {
  std::shared_ptr<const ModelSet> candidate;  ///< Null: none runs.
  std::string valve_glob{"*"};
  ShadowLimits limits;
};

/// Totals since the start; valves stand for now. Thread safe.
struct ShadowCounts {
  std::array<std::atomic<std::uint64_t>, kShadowOutcomeCount> samples{};
  std::array<std::atomic<std::int64_t>, kShadowFitCount> valves{};
  std::atomic<std::uint64_t> recorded{0};  ///< Stretches to be stored.
  std::atomic<std::uint64_t> left_out{0};  ///< Stretches beyond the bound.
};

/// The candidate on one valve: its engine beside the active one, on the same
/// samples, and the stretches in which the answers differ. Pure but for what it
/// counts. One thread, that of `parts`.
class ShadowValve {
 public:
  /// @param counts outlives this.
  ShadowValve(std::string valve_id, const EngineParts& parts,
              const ShadowLimits& limits, ShadowCounts& counts);

  /// As ValveMonitor::Resume().
  void Resume(Accumulator accumulator) { saved_ = std::move(accumulator); }

  /// Takes a sample and what the active set answered.
  /// @returns what became of it, nothing if the candidate does not fit or the
  ///   sample is out of order.
  std::optional<ShadowOutcome> Step(const Sample& sample,
                                    const ValveOutcome& active);

  /// The publisher ended the stream.
  void EndStream();

  /// Appends stretches that changed since the last call; open ones as they are.
  void TakeCheckpoint(Checkpoint& checkpoint);

  const std::string& valve_id() const { return valve_id_; }
  ShadowFit fit() const { return fit_; }

 private:
  // A stretch that has not ended.
  struct Stretch {
    ShadowDifference difference;
    std::uint64_t active_faults{0};  // By fault number.
    std::uint64_t candidate_faults{0};
    bool counted{false};   // Long enough; recorded or left out.
    bool recorded{false};  // To be stored.
    bool changed{false};   // Since the last checkpoint.
  };

  ShadowFit FitOf(const Sample& sample, const ModelSet* active) const;
  void SetFit(ShadowFit fit);
  void Compare(const Verdict& active, const ModelSet& models);
  void Begin(const Verdict& active, const ModelSet& models);
  void Extend(const Verdict& active);
  void Close();

  std::string valve_id_;
  EngineParts parts_;
  const ModelSet* candidate_;
  ShadowLimits limits_;
  ShadowCounts& counts_;
  std::optional<ValveEngine> engine_;  // Once there is something to compare.
  std::optional<Accumulator> saved_;
  ShadowFit fit_{ShadowFit::kNoActive};
  std::int64_t stamp_ns_{0};
  std::uint64_t source_id_{0};
  bool seen_{false};
  std::optional<Stretch> open_;
  std::vector<ShadowDifference> closed_;
  std::int64_t hour_{0};
  int in_hour_{0};
};

/// A candidate model set beside the active ones, on all valves that it fits:
/// its decisions are compared and go nowhere. Costs one engine per valve.
///
/// The diagnosis thread, except where noted.
class ShadowBank {
 public:
  /// @throws DataError if the candidate is not usable.
  ShadowBank(ShadowOptions options, ThrottledLog& log);

  /// The accumulators as of the last checkpoint; those of another candidate
  /// count for nothing. Before the first Add().
  void Restore(std::vector<Accumulator> accumulators);

  /// A valve that is seen for the first time. @returns null if the candidate
  ///   is not to run on it.
  ShadowValve* Add(const std::string& valve_id);
  /// `valve` is not used any more.
  void Remove(const ShadowValve* valve);

  /// Gives a sample to the candidate and reports why it does not fit.
  void Step(ShadowValve& valve, const Sample& sample,
            const ValveOutcome& active);

  /// Thread safe.
  const ShadowCounts& counts() const { return counts_; }

 private:
  ShadowOptions options_;
  ThrottledLog& log_;
  EngineParts parts_;
  ShadowCounts counts_;
  std::vector<std::unique_ptr<ShadowValve>> valves_;
  std::unordered_map<std::string, Accumulator> saved_;
};

}  // namespace fdi::monitor
