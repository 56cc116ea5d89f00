#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "diagnosis/decision/fault_bank.h"
#include "diagnosis/decision/floor.h"
#include "diagnosis/decision/misfit_counts.h"
#include "diagnosis/decision/rules.h"
#include "diagnosis/model/model_set.h"
#include "diagnosis/model/verdict.h"
#include "diagnosis/observers/detection.h"
#include "diagnosis/observers/observer_bank.h"

namespace fdi {

/// Counts over the last t_k samples of an open episode which faults had a
/// factor of at least T. Faults with this in at least the isolation fraction of
/// the samples support a set; those with at least the join fraction are added
/// to it, so that noise on one factor does not exclude a neighbouring fault.
class IsolationWindow {
 public:
  /// @param faults number of faults in the model set.
  IsolationWindow(const DecisionParameters& parameters, std::size_t faults);

  void Restart();
  void Push(FaultSet above_threshold);

  /// The supported set; empty until the window is full.
  FaultSet Supported() const;

  bool full() const { return filled_ == length_; }

 private:
  int length_;
  int needed_;
  int joining_;
  int filled_{0};
  int next_{0};
  std::vector<FaultSet> ring_;
  std::vector<int> counts_;  // by fault bit
};

/// The commands of the most recent samples.
class CommandHistory {
 public:
  explicit CommandHistory(int length)
      : ring_(static_cast<std::size_t>(length)) {}

  void Push(double cv);

  /// Standard deviation of CV [%]; 0 without samples.
  double deviation() const;
  /// Maximum minus minimum of CV [%].
  double range() const;

 private:
  std::vector<double> ring_;
  std::size_t filled_{0};
  std::size_t next_{0};
};

/// Decides when a valve with an open episode is normal again: over the last t_c
/// samples no residual beyond its threshold, d_0 ≥ T in at least the isolation
/// fraction of them, and every mean residual within 0.3 thresholds, so that a
/// fault just below the threshold does not clear.
///
/// A valve that stands still is not proven healthy: CV must vary at least half
/// as much as at the detection, or have covered as wide a range since the last
/// residual beyond a threshold.
class ClearingWindow {
 public:
  explicit ClearingWindow(const ModelSet& models);

  /// Takes the command of every judged sample, with or without an episode.
  void Observe(double cv);

  /// Call at a detection.
  void Restart();

  /// @param residuals of the normal observer by channel; NaN abstains.
  void Push(std::span<const double> residuals, double normal_factor,
            bool abnormal);

  bool Cleared() const;

 private:
  struct Entry {
    std::array<double, kMaxChannels> residuals{};
    bool normal{false};
  };

  bool Excited() const;

  const ModelSet* models_;
  CommandHistory commands_;
  double deviation_then_{0.0};  // standard deviation of CV at the detection
  double range_then_{0.0};
  double lowest_{0.0};  // CV since the last abnormal sample
  double highest_{0.0};
  double cv_{0.0};
  int quiet_{0};  // samples since the last abnormal one
  int filled_{0};
  std::size_t next_{0};
  int normal_count_{0};
  std::vector<Entry> ring_;
  std::array<double, kMaxChannels> sums_{};
};

/// Number of findings: those of the floor, and a drift.
inline constexpr std::size_t kFindings = Floor::kTests + 1;

/// Findings in one sample.
struct Findings {
  std::optional<std::int64_t> detected;  ///< Stamp of a new detection.
  bool abnormal{false};                  ///< Some limit is exceeded at present.
  FaultSet stuck{0};      ///< Faults of stuck transmitters: certain.
  FaultSet floor{0};      ///< Findings of the floor.
  FaultSet beginning{0};  ///< Would be findings after some more such samples.
  std::array<double, kFindings> sizes{};  ///< Their sizes.
  bool drift{false};   ///< One of them, instead of any fault.
  bool settled{true};  ///< The observers have settled.
};

/// The episode of a valve from its detection to its end: which faults explain
/// it, equation (6), and when it ends. State, set and transitions are kept in
/// the verdict passed to every call, whose factors must have been scored.
class Episode {
 public:
  explicit Episode(std::shared_ptr<const FaultPlan> plan);

  /// Sets the instantaneous factors from the observers.
  void Score(const ObserverBank& bank, Verdict& verdict) const;

  /// A judged sample: opens, continues or clears the episode.
  void Step(const Sample& sample, const ObserverBank& bank,
            const Findings& findings, Verdict& verdict);

  /// A sample that is not judged: an open episode keeps its evidence.
  void Hold(Verdict& verdict) const;

  /// Ends an open episode as cleared.
  void End(Verdict& verdict) const;

  /// Ends an open episode from outside. @returns its kClosed transition.
  Transition Close(EndReason reason, std::int64_t stamp_ns, Verdict& verdict);

  /// Instruction of SecondFaultWatch for the next sample of a named episode.
  enum class NameHold : std::uint8_t {
    kNone,
    kName,       ///< Its name does not change.
    kExplained,  ///< Nor do effects of a second fault count against it.
  };
  void HoldName(NameHold hold) { hold_ = hold; }

  /// See FaultBank.
  FaultBank::Leader LeaderOf(FaultSet faults) const {
    return faults_.LeaderOf(faults);
  }
  FaultSet misfits() const { return misfits_; }
  void RaiseTo(double least) { faults_.RaiseTo(least); }
  void Excuse(SignalMask inputs) { faults_.Excuse(inputs); }

  /// While held, no fault is isolated.
  void HoldIsolation(bool hold) { isolation_held_ = hold; }

 private:
  // The result of the rules for one sample.
  struct Proposal {
    const Sample& sample;
    const Findings& findings;
    Verdict& verdict;
    FaultSet supported{0};
    bool over{false};  // no further rule of Stage::kName acts
  };

  void Apply(Rule rule, Proposal& proposal);
  void ApplyToName(Rule rule, Proposal& proposal);
  void ApplyEvidence(Verdict& verdict) const;
  void Open(std::int64_t stamp_ns, Verdict& verdict);
  FaultSet Proven(const Verdict& verdict);
  void Recognise();
  FaultSet Recognised(FaultSet set) const;
  FaultSet LossBeside(FaultSet set, FaultSet floor, const Sample& sample,
                      const Verdict& verdict) const;
  void CountMisfits(FaultSet misfits, const Verdict& verdict);
  bool IsLong() const;
  void CountSupport(FaultSet supported);
  FaultSet Lasting(FaultSet supported, const Verdict& verdict) const;
  void HoldName(Proposal& proposal);
  void Block(Proposal& proposal);
  bool LooksNormal(const Verdict& verdict) const;
  void NameFirst(Proposal& proposal);
  void Contend(Proposal& proposal);
  void Withdraw(Verdict& verdict);
  bool ExplainsLoss(FaultSet set, const Verdict& verdict) const;
  bool IsAllOf(FaultSet faults, FaultSet misfits) const;
  void ApplyMisfits(Verdict& verdict) const;
  void NameEarly(const Sample& sample, FaultSet beginning, Verdict& verdict);
  void Name(FaultSet faults, Verdict& verdict);
  void NameFloor(Verdict& verdict);
  void ForgetFindings(FaultSet present, const Verdict& verdict);
  void DropFindings(Verdict& verdict) const;
  void ApplyFloorFindings(const Findings& findings, Verdict& verdict) const;
  void JudgeUnknown(Verdict& verdict);
  FaultSet FactorsFrom(double threshold, const Verdict& verdict) const;
  Transition Make(TransitionKind kind, std::int64_t stamp_ns, EndReason reason,
                  const Verdict& verdict) const;
  void Emit(TransitionKind kind, std::int64_t stamp_ns, Verdict& verdict,
            EndReason reason = EndReason::kNone) const;

  const ModelSet* models_;
  FaultSet floor_names_;  // bits of the findings
  FaultBank faults_;
  IsolationWindow isolation_;
  bool is_taught_;               // labels have taught the set faults
  IsolationWindow recognition_;  // of these
  FaultSet recognised_{0};
  ClearingWindow clearing_;
  bool isolation_held_{false};
  NameHold hold_{NameHold::kNone};
  std::int64_t detection_stamp_ns_{0};
  FaultSet floor_{0};                  // findings that the episode shows
  std::array<int, kFindings> over_{};  // samples since each was there
  std::array<int, kFindings> kept_{};  // after which it is forgotten
  bool begun_{false};                  // gathering of evidence has begun
  int age_{0};                         // samples since the detection
  int without_fault_{0};               // samples since some factor reached T/2
  std::vector<FaultSet> left_;         // unrefuted, by sample before t_k
  bool early_{false};                  // isolated before t_k
  FaultSet contender_{0};              // candidate to replace the isolated set
  int contender_run_{0};  // samples that supported it and no other since
  FaultSet misfits_{0};   // do not fit the last t_k samples, or refuted
  MisfitCounts misfit_counts_;
  // Faults refuted by the evidence. Counted in sets without a second look: they
  // have no other rule for a name that changes with a growing strength.
  bool names_last_;
  MisfitCounts contradictions_;
  std::vector<double> shares_;  // of the episode that supported each fault
  int stood_{0};  // samples that a fault of the present name fitted
};

}  // namespace fdi
