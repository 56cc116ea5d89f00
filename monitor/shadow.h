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

#include "diagnosis/decision/valve_engine.h"
#include "monitor/checkpoint.h"
#include "monitor/sinks.h"
#include "monitor/throttled_log.h"

namespace fdi::monitor {

/// Whether the candidate can be compared with the active set of a valve.
enum class ShadowFit : std::uint8_t {
  kCompared,
  kNoActive,  ///< No model set is assigned to the valve.
  kSameSet,   ///< The candidate is the active set there.
  kSignals,   ///< The candidate needs a signal that is missing.
  kUnit,      ///< The candidate expects the other flow unit.
  kPeriod,    ///< The active set is for another sample period.
};
inline constexpr std::size_t kShadowFitCount = 6;
std::string_view ShadowFitName(ShadowFit fit);  ///< "compared", "signals", ...

/// Result of a sample that both sets were given.
enum class ShadowOutcome : std::uint8_t {
  kAgreed,
  kDiffered,
  kNotJudged,  ///< By either set: not LIVE.
};
inline constexpr std::size_t kShadowOutcomeCount = 3;

/// Bounds on what is recorded.
struct ShadowLimits {
  int min_samples{5};    ///< Shorter stretches are counted, not stored.
  int max_per_hour{60};  ///< Stored stretches of one valve per hour.
  std::int64_t silence_ns{3'600'000'000'000};  ///< Ends the open episode.
};

/// Settings of ShadowBank.
struct ShadowOptions {
  std::shared_ptr<const ModelSet> candidate;  ///< Null: disabled.
  std::string valve_glob{"*"};
  ShadowLimits limits;
};

/// Totals since the start; `valves` is the current number. Thread safe.
struct ShadowCounts {
  std::array<std::atomic<std::uint64_t>, kShadowOutcomeCount> samples{};
  std::array<std::atomic<std::int64_t>, kShadowFitCount> valves{};
  std::atomic<std::uint64_t> recorded{0};  ///< Stretches stored.
  std::atomic<std::uint64_t> left_out{0};  ///< Stretches beyond max_per_hour.
};

/// The candidate on one valve: its engine runs beside the active one on the
/// same samples, and the stretches in which the answers differ are kept. No
/// side effects except on the counts. One thread, that of `parts`.
class ShadowValve {
 public:
  /// @param counts outlives this.
  ShadowValve(std::string valve_id, const EngineParts& parts,
              const ShadowLimits& limits, ShadowCounts& counts);

  /// As ValveMonitor::Resume().
  void Resume(Accumulator accumulator) { saved_ = std::move(accumulator); }

  /// Processes a sample and the answer of the active set, without second
  /// looks, which the candidate does not get.
  /// @returns the result; nothing if the candidate does not fit or the sample
  ///   is out of order.
  std::optional<ShadowOutcome> Step(const Sample& sample,
                                    const ValveOutcome& active);

  /// The publisher ended the stream.
  void EndStream();

  /// Appends the stretches that changed since the last call, including open
  /// ones.
  void TakeCheckpoint(Checkpoint& checkpoint);

  const std::string& valve_id() const { return valve_id_; }
  ShadowFit fit() const { return fit_; }

 private:
  // A stretch that has not ended.
  struct Stretch {
    ShadowDifference difference;
    std::uint64_t active_faults{0};  // Bit n: fault number n.
    std::uint64_t candidate_faults{0};
    bool counted{false};   // Reached min_samples.
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
  std::optional<ValveEngine> engine_;  // Created by the first comparison.
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

/// Runs a candidate model set beside the active ones on all valves that it
/// fits: its decisions are only compared. Costs one engine per valve.
///
/// Used by the diagnosis thread, except where noted.
class ShadowBank : public ValveListener {
 public:
  /// @throws DataError if the candidate is not usable.
  ShadowBank(ShadowOptions options, ThrottledLog& log);

  /// Restores the accumulators of the last checkpoint; those of another
  /// candidate are ignored. Before the first sample.
  void Restore(std::vector<Accumulator> accumulators);

  std::string_view name() const override { return "shadow"; }
  /// Passes the sample to the candidate, and logs why it does not fit.
  void OnVerdict(const std::string& valve_id, const Sample& sample,
                 const ValveOutcome& active) override;
  void OnSilence(const std::string& valve_id, Silence silence) override;
  void OnRemoved(const std::string& valve_id, Checkpoint& last) override;
  void TakeCheckpoint(Checkpoint& checkpoint, bool urgent) override;

  /// Thread safe.
  const ShadowCounts& counts() const { return counts_; }

 private:
  ShadowValve* At(const std::string& valve_id);

  ShadowOptions options_;
  ThrottledLog& log_;
  EngineParts parts_;
  ShadowCounts counts_;
  // Null: the candidate does not run on the valve.
  std::unordered_map<std::string, std::unique_ptr<ShadowValve>> valves_;
  std::unordered_map<std::string, Accumulator> saved_;
};

}  // namespace fdi::monitor
