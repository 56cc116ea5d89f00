#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "diagnosis/model_set.h"
#include "diagnosis/observer_bank.h"
#include "diagnosis/snapshot.h"
#include "diagnosis/verdict.h"

namespace fdi {

/// Accumulators hold over an interruption of at most this: 10 min.
inline constexpr std::int64_t kLongestInterruptionNs = 600'000'000'000;

/// Decides whether a valve is where its model set was trained: it is ARMED or
/// not, and judged only while it is.
///
/// It is disarmed by what the process does with it: another mode than AUTO, a
/// command beyond the trained range, staying or stepping as never there, or
/// being parked, at an end of its travel without flow. It is armed again after
/// `rearm_samples` in a row without all that and with dP, T1, P1 and P2 as in
/// normal operation: cold feedwater and rising pressure at a start-up are no
/// broken thermometer. A new stream takes the settling samples only. Once the
/// valve is armed, dP, T1, P1 and P2 alone never disarm it: they are judged.
/// Those that were off while an episode was open do not keep it from being
/// armed again.
///
/// What disarms must come before the deviation: a valve that is abnormal, of a
/// set with a floor, stays armed whatever its command does, for the fault moves
/// the command; other modes alone disarm it.
class Coverage {
 public:
  /// `models` must outlive it.
  explicit Coverage(const ModelSet& models);

  /// A new stream: nothing is known.
  void Restart();

  /// The observers were initialised at `stamp_ns`: they have to settle.
  /// @returns true if what was known before still holds: the last sample is at
  ///   most kLongestInterruptionNs older.
  bool Settle(std::int64_t stamp_ns);

  /// kLive, kSettling, kInhibited or kUncovered.
  /// @param found The floor finds something.
  /// @param pending Some limit was passed at the last sample that was judged.
  Quality Judge(const Sample& sample, const ObserverBank& bank,
                bool episode_open, bool found = false, bool pending = false);

  /// Why the last sample was not judged.
  CoverageReasons reasons() const { return reasons_; }
  /// True at the sample that armed the valve.
  bool armed_now() const { return armed_now_; }
  /// True if the observers need no more samples to settle.
  bool settled() const { return settled_; }

  void Save(SnapshotWriter& writer) const;
  /// @returns false, leaving it undefined, if there is nothing to be read.
  bool Restore(SnapshotReader& reader);

 private:
  struct Input {  // T1, P1 or P2
    Signal signal;
    CoverageReason reason;
    SignalRange range;
    std::optional<int> channel;  // that holds it against its normal band
  };

  CoverageReasons Operation(const Sample& sample);
  CoverageReasons Inputs(const Sample& sample, const ObserverBank& bank) const;
  bool Parked(const Sample& sample);
  Quality JudgeArmed(CoverageReasons inputs, bool episode_open);
  Quality JudgeDisarmed(CoverageReasons operation, CoverageReasons inputs);

  const ModelSet* models_;
  std::array<Input, 3> inputs_;
  bool armed_{false};
  bool armed_now_{false};
  bool settled_{false};
  int settling_{0};  // samples that the observers still need
  int inside_{0};    // samples in a row
  int needed_{0};    // of them
  int at_end_{0};    // samples in a row at an end of the travel, no flow
  std::optional<double> last_cv_;
  double mean_cv_{0.0};
  int averaged_{0};  // samples in mean_cv_, at most as many as it settles in
  std::optional<std::int64_t> last_stamp_ns_;
  CoverageReasons excused_{0};
  CoverageReasons reasons_{0};
};

}  // namespace fdi
