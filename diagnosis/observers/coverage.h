#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "diagnosis/model/model_set.h"
#include "diagnosis/model/snapshot.h"
#include "diagnosis/model/verdict.h"
#include "diagnosis/observers/observer_bank.h"

namespace fdi {

/// Longest interruption after which accumulators are still valid: 10 min.
inline constexpr std::int64_t kMaxInterruptionNs = 600'000'000'000;

/// Decides whether a valve operates where its model set was trained. It is
/// either ARMED, and judged, or not.
///
/// The process disarms it: by a mode other than AUTO, by a command that stays
/// outside the trained range or steps as never in training, or by parking it,
/// i.e. an end of travel without flow. A command that is outside for moments,
/// its running mean inside, does not: the valve is
/// only not judged until no observer reads that command any more. It is armed
/// again after `rearm_samples` in a row without any of these and with dP, T1,
/// P1 and P2 as in normal operation: cold feedwater and rising pressure at a
/// start-up do not mean a broken transmitter. A new stream only needs the
/// settling samples. Once the valve is armed, dP, T1, P1 and P2 never disarm
/// it, because they are judged themselves. Deviations of these during an open
/// episode do not prevent re-arming.
///
/// Disarming only works before a deviation: with a floor in the model set, an
/// abnormal valve stays armed whatever its command does, because the fault
/// moves the command; only other modes disarm it.
class Coverage {
 public:
  /// `models` must outlive it.
  explicit Coverage(const ModelSet& models);

  /// Begins a new stream, without any history.
  void Restart();

  /// The observers were initialised at `stamp_ns` and have to settle. @returns
  /// true if the earlier state is still valid, i.e. the last sample is at most
  /// kMaxInterruptionNs older.
  bool StartSettling(std::int64_t stamp_ns);

  /// @returns kLive, kSettling, kInhibited or kUncovered.
  /// @param found the floor has a finding.
  /// @param pending a limit was exceeded at the last judged sample.
  Quality Judge(const Sample& sample, const ObserverBank& bank,
                bool episode_open, bool found = false, bool pending = false);

  /// Why the last sample was not judged.
  CoverageReasons reasons() const { return reasons_; }
  /// True for the sample at which the valve became armed.
  bool armed_now() const { return armed_now_; }
  /// True if the observers have settled.
  bool settled() const { return settled_; }

  void Save(SnapshotWriter& writer) const;
  /// @returns false, leaving the state undefined, if the snapshot is
  ///   incomplete.
  bool Restore(SnapshotReader& reader);

 private:
  struct Input {  // T1, P1 or P2
    Signal signal;
    CoverageReason reason;
    SignalRange range;
    std::optional<int> channel;  // that compares it with its normal band
  };

  CoverageReasons Operation(const Sample& sample);
  CoverageReasons Inputs(const Sample& sample, const ObserverBank& bank) const;
  bool IsParked(const Sample& sample);
  Quality JudgeArmed(CoverageReasons inputs, bool episode_open);
  Quality JudgeDisarmed(CoverageReasons operation, CoverageReasons inputs);

  const ModelSet* models_;
  int read_for_;  // samples that some observer reads a command for
  std::array<Input, 3> inputs_;
  bool armed_{false};
  bool armed_now_{false};
  bool settled_{false};
  int settling_{0};  // samples until the observers have settled
  int inside_{0};    // consecutive samples inside
  int needed_{0};    // required value of inside_
  int passing_{0};  // samples until none reads a command that was outside for a
                    // moment; read_for_ while it is
  int at_end_{0};   // consecutive samples at an end of travel, no flow
  std::optional<double> last_cv_;
  double mean_cv_{0.0};
  int averaged_{0};  // samples in mean_cv_, up to kCvMeanSettling
  std::optional<std::int64_t> last_stamp_ns_;
  CoverageReasons excused_{0};
  CoverageReasons reasons_{0};
};

}  // namespace fdi
