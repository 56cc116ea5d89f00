#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <vector>

#include "diagnosis/observer_plan.h"

namespace fdi {

/// Strengths tried at the start of an episode, evenly over the reach.
inline constexpr int kStrengthCells = 33;

/// A place between two nodes of a StrengthPath.
struct PathPlace {
  std::size_t segment{0};  ///< Between node `segment` and the next.
  std::size_t nearest{0};  ///< Node.
  double high_share{0.0};  ///< Of the stronger node, in [0, 1].
  double from_low{0.0};    ///< Strength less that of the weaker node.
  double from_nearest{0.0};
};

/// The observers of one fault in one direction by rising |strength|, the normal
/// one before them at 0: what a StrengthTracker moves along.
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
  };

  PathPlace PlaceOf(double strength) const;

  std::size_t fault_index{0};
  double sign{1.0};
  double lowest{0.0};  ///< Reach of |s|.
  double highest{0.0};
  std::vector<Node> nodes;
  std::vector<Point> points;                   ///< By node and channel.
  std::vector<double> errors;                  ///< κ by segment and channel.
  std::array<double, kStrengthCells> cells{};  ///< Strengths.
  std::array<PathPlace, kStrengthCells> places{};
};

/// What FaultBank needs of a model set: made once, shared by all valves.
class FaultPlan {
 public:
  explicit FaultPlan(std::shared_ptr<const ObserverPlan> observers);

  const ObserverPlan& observers() const { return *observers_; }
  const ModelSet& models() const { return observers_->models(); }
  /// One per fault and direction.
  const std::vector<StrengthPath>& paths() const { return paths_; }
  /// Fault index of an observer, of any but the normal one.
  std::size_t fault_index(std::size_t observer) const {
    return fault_indices_[observer];
  }
  /// τ_c: the median correlation time of the residuals of a channel over the
  /// observers, times the channels of the same output: they share its noise,
  /// and what one of them says the others repeat [samples].
  double channel_time(std::size_t channel) const {
    return channel_times_[channel];
  }
  /// λ
  double memory() const { return memory_; }

 private:
  std::shared_ptr<const ObserverPlan> observers_;
  std::vector<std::size_t> fault_indices_;
  std::vector<double> channel_times_;
  double memory_;
  std::vector<StrengthPath> paths_;
};

/// The path of `observers`, indices of one fault and direction by rising
/// |strength|, at least one.
StrengthPath MakeStrengthPath(const ObserverPlan& plan,
                              const std::vector<std::size_t>& observers);

}  // namespace fdi
