#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "diagnosis/valve_engine.h"
#include "monitor/checkpoint.h"
#include "monitor/shadow_difference.h"
#include "monitor/valve_monitor.h"

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

/// Bounds on what is recorded.
struct ShadowLimits {
  int min_samples{5};    ///< Shorter stretches are only counted.
  int max_per_hour{60};  ///< Stretches of one valve in an hour of time.
  std::int64_t silence_ns{3'600'000'000'000};  ///< Ends the open episode.
};

/// A stretch that has not ended.
struct OpenStretch {
  ShadowDifference difference;
  std::uint64_t active_faults{0};  ///< By fault number.
  std::uint64_t candidate_faults{0};
  bool counted{false};  ///< Long enough; recorded or left out.
  bool kept{false};     ///< It is recorded.
  bool changed{false};  ///< Since it was taken last.
};

/// The candidate on one valve: its engine beside the active one, on the same
/// samples, and the stretches in which the answers differ. Pure but for what
/// the samples tell. One thread, that of `parts`.
class ShadowValve {
 public:
  ShadowValve(std::string valve_id, const EngineParts& parts,
              const ShadowLimits& limits);

  /// As ValveMonitor::Resume().
  void Resume(Accumulator accumulator) { saved_ = std::move(accumulator); }

  /// The active set, null for none, answered `active` to `sample`.
  /// @returns what became of it, nothing if the candidate does not fit or the
  ///   sample is out of order.
  std::optional<ShadowOutcome> Step(const Sample& sample,
                                    const ValveOutcome& active);

  /// The publisher ended the stream.
  void EndStream();

  /// Appends stretches that changed since the last call; open ones as they are.
  void TakeTo(Checkpoint& checkpoint);

  ShadowFit fit() const { return fit_; }
  std::uint64_t recorded() const { return recorded_; }  ///< Stretches.
  std::uint64_t left_out() const { return left_out_; }  ///< By max_per_hour.

 private:
  ShadowFit FitOf(const Sample& sample, const ModelSet* active) const;
  void Compare(const Verdict& active, const ModelSet& models);
  void Begin(const Verdict& active, const ModelSet& models);
  void Extend(const Verdict& active);
  void Close();

  std::string valve_id_;
  EngineParts parts_;
  const ModelSet* candidate_;
  ShadowLimits limits_;
  std::optional<ValveEngine> engine_;  // Once there is something to compare.
  std::optional<Accumulator> saved_;
  ShadowFit fit_{ShadowFit::kNoActive};
  std::int64_t stamp_ns_{0};
  std::uint64_t source_id_{0};
  bool seen_{false};
  std::optional<OpenStretch> open_;
  std::vector<ShadowDifference> closed_;
  std::int64_t hour_{0};
  int in_hour_{0};
  std::uint64_t recorded_{0};
  std::uint64_t left_out_{0};
};

}  // namespace fdi::monitor
