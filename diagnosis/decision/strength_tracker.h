#pragma once

#include <array>
#include <vector>

#include "diagnosis/decision/fault_plan.h"
#include "diagnosis/decision/observer_evidence.h"
#include "diagnosis/observers/fit_window.h"
#include "diagnosis/observers/observer_bank.h"

namespace fdi {

/// Tracks how strong one fault would have to be, in one direction, to explain
/// the samples since a detection, and how well it then explains them.
///
/// Between the observers of the fault, at strengths s_1 < s_2 < ..., and the
/// normal one at s_0 = 0, predictions are interpolated,
///
///     ŷ(s) = ŷ_j + (ŷ_{j+1} − ŷ_j) (s − s_j) / (s_{j+1} − s_j),
///
/// with a variance that includes the interpolation error. A Kalman filter with
/// fading memory tracks s and its rate over all active channels, so that a
/// developing fault matches at every strength, not only at the trained ones.
/// The innovations ν of variance S give the evidence
///
///     L ← λ L − ½ Σ_c (ν²/S + ln S) / τ_c,
///
/// with τ_c (FaultPlan) common to all faults: log-likelihoods differ long
/// before single residuals do. During the search at the start of an episode λ
/// is 1, unlike in ObserverEvidence: with λ < 1 there, more of the benchmark's
/// sets keep a look-alike. A reading at the transmitter's limit has no density:
/// it costs ν²/S if the prediction is below the limit, and nothing if it is
/// beyond; earlier evidence of the channel is held. Each observer gathers
/// evidence for its own strength in the same way (ObserverEvidence); the fault
/// has that of the best, so that interpolation cannot degrade a trained
/// strength.
class StrengthTracker {
 public:
  /// `plan` and `path` must outlive the tracker.
  StrengthTracker(const FaultPlan& plan, const StrengthPath& path);

  /// Restarts at a detection.
  void Restart();

  /// Adds the residuals of one sample.
  void Step(const ObserverBank& bank);

  /// Raises the evidence to at least `least`.
  void RaiseEvidence(double least);

  /// For the best explanation, tracked or trained.
  double strength(const ObserverEvidence& trained) const;
  double evidence(const ObserverEvidence& trained) const;
  /// The distance of that explanation to a trained strength, 4 |h (1 − h)| at a
  /// share h of the way between two of them: 0 at either, 1 midway and at most.
  double Interpolation(const ObserverEvidence& trained) const;
  /// The same of the tracked strength, whichever explains better.
  double TrackedInterpolation() const;

  /// Judges, over the first t_k samples, whether the best explanation, tracked
  /// or trained, accounts for what is seen. Call after Step().
  void JudgeAccount(const ObserverBank& bank, const ObserverEvidence& trained);
  /// Where the normal observer is furthest off, in deviations, the residual is
  /// less than half as large. Else the fault only tolerates the readings, as a
  /// sticking rod does with nearly any.
  bool accounts() const { return accounts_; }

  /// Smallest membership over the active channels of the residual at the
  /// tracked strength.
  double factor() const { return factor_; }

  /// Takes the residuals of the best explanation, tracked or trained, into the
  /// window that fits() judges. Call after Step().
  /// @param shown an input has moved as the fault always moves it. In the first
  ///   t_k samples, what it does elsewhere may then be off by half: the
  ///   rod is on its way, and observers know faults that have acted for long.
  void PushFit(const ObserverBank& bank, const ObserverEvidence& trained,
               bool shown);
  /// False if the best explanations of the last t_k samples do not look like
  /// the fault's own validation data (FitBounds). True until there are so many.
  bool fits() const { return !fit_.full() || fits_so_far(); }
  /// The same of fewer samples, within wider limits.
  bool fits_so_far() const { return misfit_ <= 1.0; }
  /// Where X or F is furthest from normal operation, the fault does not account
  /// for what is seen (AccountedShare): that it fits says little.
  bool tolerates() const { return tolerates_; }

  const StrengthPath& path() const { return *path_; }

 private:
  struct Account {  // for what normal operation does not explain in X and F
    SignalMask lacks{0};
    bool tolerates{false};  // lacks where that is most, or half as much
  };
  struct Segment {  // of one channel
    double low;     // prediction of the weaker node
    double slope;   // dŷ/ds
    double low_variance;
    double high_variance;
    double low_sd;
    double high_sd;
  };
  struct Prediction {
    double residual;
    double slope;
    double variance;  // of the residual, interpolation error included
    double error;     // variance of the interpolation error
  };
  using Parts = std::array<double, kMaxChannels>;  // evidence by channel

  const StrengthPath::Node& BestNode(const ObserverEvidence& trained) const;
  Segment SegmentOf(const ObserverBank& bank, std::size_t channel,
                    std::size_t segment) const;
  Prediction At(const ObserverBank& bank, std::size_t channel,
                const Segment& segment, const PathPlace& place) const;
  double Gain(const ObserverBank& bank, std::size_t channel, double residual,
              double variance) const;
  double Sum(const double* parts) const;
  void Search(const ObserverBank& bank);
  void SearchChannel(const ObserverBank& bank, std::size_t channel);
  void Track(const ObserverBank& bank);
  void Correct(const Prediction& prediction, double strength, double spread);
  void ClampEstimate();
  void UpdateFactor(const ObserverBank& bank);
  PathPlace PlaceOfBest(const ObserverEvidence& trained) const;
  void PushAccount(const ObserverBank& bank, std::size_t channel,
                   double residual);
  Account AccountOf(int least) const;

  const FaultPlan* plan_;
  const StrengthPath* path_;
  std::size_t channels_;

  int age_{0};
  double strength_{0.0};
  double rate_{0.0};
  double var_strength_{0.0};
  double var_rate_{0.0};
  double covariance_{0.0};
  double total_{0.0};  // of the evidence
  Parts evidence_{};
  double factor_{0.0};
  bool accounts_{false};
  FitWindow fit_;
  double misfit_{0.0};  // 1 at the limit
  bool tolerates_{false};
  std::array<AccountedShare, kMaxChannels> accounted_{};
  std::vector<double> cells_;  // evidence by cell and channel
};

}  // namespace fdi
