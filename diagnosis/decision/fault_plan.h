#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <vector>

#include "diagnosis/observers/observer_plan.h"

namespace fdi {

/// Number of strengths tried at the start of an episode, evenly spaced.
inline constexpr int kStrengthCells = 33;

/// A position between two nodes of a StrengthPath.
struct PathPlace {
  std::size_t segment{0};  ///< Between nodes `segment` and `segment` + 1.
  std::size_t nearest{0};  ///< Index of the nearer node.
  double high_share{0.0};  ///< Weight of the stronger node, in [0, 1].
  double from_low{0.0};    ///< Strength minus that of the weaker node.
  double from_nearest{0.0};
};

/// The observers of one fault in one direction by increasing |strength|,
/// preceded by the normal one at 0: the path that a StrengthTracker follows.
struct StrengthPath {
  struct Node {
    std::size_t observer;
    double strength;  ///< |s|
  };
  /// One channel of one node.
  struct Point {
    std::size_t slot{0};
    double sd{1.0};
    double saturation{0.0};
    Trapezoid membership;
    FitBounds fit;
  };

  PathPlace PlaceOf(double strength) const;

  std::size_t fault_index{0};
  double sign{1.0};
  SignalMask inputs{0};  ///< P1, P2, T1 that the fault acts on.
  SignalMask moved{0};   ///< Inputs moved at every trained strength.
  bool taught{false};    ///< Known only from an observer taught by a label.
  double lowest{0.0};    ///< Range of |s|.
  double highest{0.0};
  std::vector<Node> nodes;
  std::vector<Point> points;                   ///< By node and channel.
  std::vector<double> errors;                  ///< κ by segment and channel.
  std::array<double, kStrengthCells> cells{};  ///< Strengths.
  std::array<PathPlace, kStrengthCells> places{};
};

/// FaultBank's data derived from a model set; shared by all valves.
class FaultPlan {
 public:
  explicit FaultPlan(std::shared_ptr<const ObserverPlan> observers);

  const ObserverPlan& observers() const { return *observers_; }
  const ModelSet& models() const { return observers_->models(); }
  /// One per fault and direction; behind them one per taught observer, which
  /// leaves the others as they are.
  const std::vector<StrengthPath>& paths() const { return paths_; }
  /// Fault index of an observer other than the normal one.
  std::size_t fault_index(std::size_t observer) const {
    return fault_indices_[observer];
  }
  /// τ_c: the median correlation time of a channel's residuals over the
  /// observers, times the number of channels with the same output: these share
  /// its noise and repeat each other's evidence [samples].
  double channel_time(std::size_t channel) const {
    return channel_times_[channel];
  }
  /// The set says how a fault that acts fits (FitBounds).
  bool judges_fit() const { return judges_fit_; }
  /// λ
  double memory() const { return memory_; }

 private:
  std::shared_ptr<const ObserverPlan> observers_;
  std::vector<std::size_t> fault_indices_;
  std::vector<double> channel_times_;
  double memory_;
  bool judges_fit_{false};
  std::vector<StrengthPath> paths_;
};

/// The path of `observers`: indices of one fault and direction by increasing
/// |strength|, at least one.
StrengthPath MakeStrengthPath(const ObserverPlan& plan,
                              const std::vector<std::size_t>& observers);

}  // namespace fdi
