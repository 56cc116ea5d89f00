#pragma once

#include <algorithm>
#include <vector>

#include "diagnosis/channel_evidence.h"
#include "diagnosis/observer_bank.h"

namespace fdi {

/// Follows how strong one fault would have to be, in one direction, to explain
/// the samples since a detection, and how well it then explains them.
///
/// Between the observers of the fault, at strengths s_1 < s_2 < ..., and the
/// normal one at s_0 = 0, predictions are interpolated,
///
///     ŷ(s) = ŷ_j + (ŷ_{j+1} − ŷ_j) (s − s_j) / (s_{j+1} − s_j),
///
/// with a variance that grows with what interpolation errs by there. s is
/// followed with its rate by a Kalman filter of fading memory over all active
/// channels, so that a developing fault is met at every strength, not at the
/// trained ones only. The innovations ν of variance S give the evidence
///
///     L ← λ L − ½ Σ_c (ν²/S + ln S) / τ_c,
///
/// τ_c (ChannelTimes) the same for all faults: log-likelihoods of faults differ
/// long before single residuals do. A reading at the transmitter's limit has no
/// density: it costs ν²/S of a prediction below the limit, and nothing of one
/// beyond; what the channel said before is held (ChannelEvidence). Each
/// observer gathers evidence of its own strength alike; the fault has that of
/// the best, so that no interpolation can spoil a strength that was trained.
class StrengthTracker {
 public:
  /// `observers`: indices of one fault and direction by rising |strength|;
  /// empty for normal operation, which has nothing to follow.
  StrengthTracker(const ModelSet& models, const std::vector<int>& observers);

  /// Begins anew at a detection.
  void Restart();

  /// Takes the residuals of one sample.
  void Step(const ObserverBank& bank);

  /// Lifts all evidence to `least` where it is below.
  void RaiseEvidence(double least);

  /// Of the best explanation, followed or trained.
  double strength() const;
  double evidence() const;

  /// True once a reading since the detection could have refuted the fault: on a
  /// channel where it differs from normal operation and the transmitter's limit
  /// does not hide both. A fault that is not yet refutable is not named.
  bool refutable() const { return refutable_; }

  /// Smallest membership over the active channels of the residual at the
  /// followed strength.
  double factor() const { return factor_; }

 private:
  struct Node {
    int observer;
    double strength;  // |s|
    ChannelEvidence evidence;
  };
  using Errors = std::vector<double>;  // κ per channel, between two nodes
  struct Prediction {
    double residual;
    double slope;     // dŷ/ds
    double variance;  // of the residual, interpolation error included
    int nearest;      // observer at the nearer node
  };

  const ChannelObserver& Channel(int observer, int channel) const;
  Errors ErrorsBetween(const Node& low, const Node& high) const;
  void SetReach();
  Prediction At(const ObserverBank& bank, int channel, double strength) const;
  double Variance(const ObserverBank& bank, int observer, int channel) const;
  const Node& BestNode() const;
  double Gain(const ObserverBank& bank, int channel, double residual,
              double variance) const;
  void GatherOfNodes(const ObserverBank& bank);
  bool CouldBeRefuted(const ObserverBank& bank) const;
  void Search(const ObserverBank& bank);
  void Follow(const ObserverBank& bank);
  void KeepBounded();
  void UpdateFactor(const ObserverBank& bank);
  double Cell(int index) const;

  static constexpr int kCells = 33;          // strengths tried at the start
  static constexpr int kSearchSamples = 40;  // for so many samples
  static constexpr double kOutlier = 25.0;   // bound of ν²/S

  const ModelSet* models_;
  std::vector<Node> nodes_;       // the normal observer first
  std::vector<Errors> segments_;  // between node j and j + 1
  double sign_{1.0};
  double lowest_{0.0};
  double highest_{0.0};
  double memory_;                      // λ
  std::vector<double> channel_times_;  // τ_c

  int age_{0};
  double strength_{0.0};
  double rate_{0.0};
  double var_strength_{0.0};
  double var_rate_{0.0};
  double covariance_{0.0};
  ChannelEvidence evidence_;
  double factor_{0.0};
  bool refutable_{false};
  std::vector<ChannelEvidence> cells_;
};

}  // namespace fdi
