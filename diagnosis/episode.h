#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include "diagnosis/clearing.h"
#include "diagnosis/detection.h"
#include "diagnosis/fault_bank.h"
#include "diagnosis/isolation.h"
#include "diagnosis/observer_bank.h"
#include "diagnosis/verdict.h"

namespace fdi {

/// What was found in one sample.
struct Findings {
  std::optional<std::int64_t> detected;  ///< Stamp of a detection.
  bool abnormal{false};  ///< Something is beyond its threshold right now.
  FaultSet stuck{0};     ///< Faults of transmitters that are stuck: certain.
};

/// The episode of a valve from its detection to its end: which faults explain
/// it, equation (6), and when it is over. State, set and transitions stand in
/// the verdict that every call is given; its factors must have been scored.
class Episode {
 public:
  explicit Episode(std::shared_ptr<const FaultPlan> plan);

  /// Instant factors of the observers.
  void Score(const ObserverBank& bank, Verdict& verdict) const;

  /// A sample that is judged: opens, continues or clears the episode.
  void Step(const Sample& sample, const ObserverBank& bank,
            const Findings& findings, Verdict& verdict);

  /// A sample that is not: an open episode waits, with the evidence so far.
  void Hold(Verdict& verdict) const;

  /// Ends an open episode from outside. @returns its kClosed transition.
  Transition Close(EndReason reason, std::int64_t stamp_ns, Verdict& verdict);

  /// While held, the set of an episode stays empty.
  void HoldIsolation(bool hold) { isolation_held_ = hold; }

 private:
  void Open(std::int64_t stamp_ns, Verdict& verdict);
  void Isolate(Verdict& verdict);
  void JudgeUnknown(Verdict& verdict);
  FaultSet FactorsFrom(double threshold, const Verdict& verdict) const;
  FaultSet WithGroups(FaultSet set, const Verdict& verdict) const;
  Transition Make(TransitionKind kind, std::int64_t stamp_ns, EndReason reason,
                  const Verdict& verdict) const;
  void Emit(TransitionKind kind, std::int64_t stamp_ns, Verdict& verdict,
            EndReason reason = EndReason::kNone) const;

  const ModelSet* models_;
  FaultBank faults_;
  IsolationWindow isolation_;
  ClearingWindow clearing_;
  bool isolation_held_{false};
  std::int64_t detection_stamp_ns_{0};
  int age_{0};             // samples since the detection
  int without_fault_{0};   // since some factor was T/2
  FaultSet contender_{0};  // another set than the isolated one
  int contender_run_{0};
};

}  // namespace fdi
