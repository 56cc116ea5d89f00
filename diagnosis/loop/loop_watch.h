#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "diagnosis/loop/audit.h"
#include "diagnosis/model/model_set.h"
#include "diagnosis/model/sample.h"
#include "diagnosis/model/severity.h"
#include "diagnosis/model/verdict.h"

namespace fdi {

/// The model set by which verdicts of an audit are told: it has no channels and
/// no observers, and its faults are what an audit finds.
/// @param interval_s between the points of the loop.
std::shared_ptr<const ModelSet> AuditModels(double interval_s);

/// The set of AuditModels() with this hash; null if it is none of them.
std::shared_ptr<const ModelSet> AuditModels(std::uint64_t content_hash);

/// The verdict of an audit as a finding of the catalogue; 0 if it opens no
/// episode (undetermined, quantised).
int FindingOf(loop::Verdict verdict);

/// Follows a loop: keeps a sliding window of its readings in AUTO and turns the
/// audits of it into verdicts and transitions, as the engine does of its
/// samples.
///
/// - A point each 10 s, or each sample if these are slower; 720 points are a
///   window, two hours or more. It starts over at a change of mode, source or
///   epoch, at a gap of three intervals, and where CV, or PV, F and X, are
///   missing.
/// - The controlled variable is PV with SP, else F, else X. A PV that follows
///   the integral of CV is a level, and never called sticky.
/// - A full window is audited each 120 points. Which of them is `phase`, so
/// that
///   the loops of a plant take turns.
/// - Three windows in a row with the same finding begin an episode, or rename
///   it; three in which OP moves by 1 % and nothing is found end it. Each
///   window estimates the size of the finding again; if it is more severe than
///   last reported, it is reported again (TransitionKind::kChanged).
///
/// No thread, no clock; Step() costs a comparison and, at each point, a store.
class LoopWatch {
 public:
  static constexpr std::size_t kPoints = 720;
  static constexpr std::size_t kHop = 120;
  static constexpr int kConfirmations = 3;
  static constexpr double kInterval_s = 10.0;

  /// @param phase in 0..kHop-1
  /// @param service of the loop, loop::ServiceOf(): what PV is.
  LoopWatch(std::size_t phase,
            std::shared_ptr<const SeverityCatalogue> severities,
            char service = '\0');

  /// Takes the next sample. @param period_s of the samples.
  const Verdict& Step(const Sample& sample, double period_s);
  /// The next sample is of a source that a newer one has superseded.
  const Verdict& Supersede();

  /// The window that is to be audited; nothing if none is due. It stays due
  /// until it is taken.
  std::optional<loop::Window> TakeWindow();

  /// The answer to the window that was taken last, unless the loop has begun a
  /// new one since; nothing: there is none. Counts from the next point on.
  void Enter(std::optional<loop::Audit> audit);

  /// Ends an open episode. @returns its kClosed transition, if there was one.
  std::optional<Transition> End(EndReason reason);

  const Verdict& verdict() const { return verdict_; }
  /// Model set of the verdicts; null until the first audit.
  const std::shared_ptr<const ModelSet>& models() const { return models_; }
  bool episode_open() const { return verdict_.detected; }
  /// The last sample was a point of the window.
  bool at_point() const { return at_point_; }
  /// The last Step() has found the loop normal three times.
  bool found_normal() const { return found_normal_; }

  /// The points of the window, as the samples that they were, oldest first; of
  /// their signals CV, F and X, and PV with SP.
  std::vector<Sample> Points() const;

  /// A sample with only these signals.
  static Sample Reduced(Sample sample);

 private:
  struct Point {
    std::uint32_t at_ms;  // Since first_ns_.
    float cv;
    float f;  // NaN: not there; so is X.
    float x;
  };
  struct Control {
    double pv;  // NaN: not there; so is SP.
    double sp;
  };
  struct Found {
    int finding{0};
    Estimate size{};
    double factor{0.0};
  };
  // The agreeing verdicts of the last windows, with the latest finding.
  struct Vote {
    Found found{};
    int times{0};
    std::int64_t since_ns{0};
  };

  bool IsInOrder(const Sample& sample);
  bool AddPoint(const Sample& sample, double period_s);
  void Restart();
  void AddControl(const Sample& sample, std::size_t row);
  void SetControlled(loop::Window& window) const;
  void Count(const loop::Audit& audit);
  void Tell();
  void Forget();
  void Transit(TransitionKind kind, EndReason reason = EndReason::kNone);
  void Name(const Found& found);
  Severity SeverityOf(const Found& found) const;

  std::size_t phase_;
  char service_;
  std::shared_ptr<const SeverityCatalogue> severities_;
  std::shared_ptr<const ModelSet> models_;
  Verdict verdict_;
  Sample last_;
  bool seen_{false};
  double interval_s_{kInterval_s};
  std::int64_t first_ns_{0};
  std::size_t added_{0};  // Points of this window's loop, also those gone.
  std::vector<Point> ring_;
  std::vector<Control> control_;  // Row by row as ring_; empty: there is no PV.
  bool due_{false};
  bool taken_{false};
  std::int64_t taken_ns_{0};
  std::optional<loop::Audit> answer_;
  Vote vote_;
  bool named_{false};                 // The open episode is told as isolated.
  Found found_;                       // Cause of the open episode.
  Severity told_{Severity::kMedium};  // As reported last.
  std::int64_t detection_ns_{0};
  bool at_point_{false};
  bool found_normal_{false};
};

}  // namespace fdi
