#include "diagnosis/decision/fault_plan.h"

#include <algorithm>
#include <cmath>

#include "base/median.h"
#include "diagnosis/model/fault_catalogue.h"
#include "diagnosis/model/taught.h"
#include "diagnosis/observers/fit_window.h"

namespace fdi {
namespace {

// Inputs (P1, P2, T1) that `fault` changes by itself; the others stay as in
// normal operation, but for effects of the flow on them. f17 moves either
// pressure; with any other fault, one reading hides the value at the valve.
SignalMask InputsOf(int fault) {
  const FaultFacts& facts = FaultFactsOf(fault);
  if (facts.acts_on != ActsOn::kInputs) {
    return 0;
  }
  return facts.hides ? MaskOf(*facts.hides)
                     : static_cast<SignalMask>(MaskOf(Signal::kP1) |
                                               MaskOf(Signal::kP2));
}

// Reach beyond the trained strengths, as factors; less with a single observer,
// which cannot show what strength does.
constexpr double kReachBelow = 0.5;
constexpr double kReachAbove = 1.5;
constexpr double kLoneReachBelow = 1.0 - kTaughtReach;
constexpr double kLoneReachAbove = 1.0 + kTaughtReach;

std::vector<std::size_t> ObserversOf(const ModelSet& models, int fault,
                                     bool negative) {
  std::vector<std::size_t> found;
  for (std::size_t i = 1; i < models.observers.size(); ++i) {
    const Observer& observer = models.observers[i];
    if (observer.fault == fault && (observer.strength < 0.0) == negative &&
        !IsTaught(observer)) {
      found.push_back(i);
    }
  }
  std::sort(found.begin(), found.end(), [&](auto a, auto b) {
    return std::abs(models.observers[a].strength) <
           std::abs(models.observers[b].strength);
  });
  return found;
}

double ChannelTime(const ModelSet& models, std::size_t c) {
  std::vector<double> all;
  for (const Observer& observer : models.observers) {
    if (!IsTaught(observer)) {
      all.push_back(std::max(observer.channels[c].correlation_time, 1.0));
    }
  }
  const auto same =
      std::count_if(models.channels.begin(), models.channels.end(),
                    [&](const ChannelSpec& channel) {
                      return channel.output == models.channels[c].output;
                    });
  return Median(std::move(all)) * static_cast<double>(same);
}

void AddNode(const ObserverPlan& plan, std::size_t index, StrengthPath& path) {
  const Observer& observer = plan.models().observers[index];
  path.nodes.push_back({index, std::abs(observer.strength)});
  for (std::size_t c = 0; c < observer.channels.size(); ++c) {
    const ChannelObserver& channel = observer.channels[c];
    path.points.push_back({plan.slot(index, c), channel.residual_sd,
                           channel.model.saturation, channel.membership,
                           channel.fit});
  }
}

// Appends κ for the segment that ends at the last node.
void AddErrors(const ModelSet& models, StrengthPath& path) {
  const Observer& high = models.observers[path.nodes.back().observer];
  const std::size_t before = path.nodes[path.nodes.size() - 2].observer;
  for (std::size_t c = 0; c < high.channels.size(); ++c) {
    const double error = high.channels[c].interpolation_error;
    path.errors.push_back(
        before == 0
            ? error
            : std::min(
                  error,
                  models.observers[before].channels[c].interpolation_error));
  }
}

void SetReach(StrengthPath& path) {
  const bool lone = path.nodes.size() == 2;
  path.lowest = path.nodes[1].strength * (lone ? kLoneReachBelow : kReachBelow);
  path.highest = std::min(
      1.0, path.nodes.back().strength * (lone ? kLoneReachAbove : kReachAbove));
  for (int i = 0; i < kStrengthCells; ++i) {
    const double strength =
        path.lowest + (path.highest - path.lowest) * i / (kStrengthCells - 1);
    path.cells[static_cast<std::size_t>(i)] = strength;
    path.places[static_cast<std::size_t>(i)] = path.PlaceOf(strength);
  }
}

}  // namespace

PathPlace StrengthPath::PlaceOf(double strength) const {
  PathPlace place;
  std::size_t& j = place.segment;
  while (j + 2 < nodes.size() && strength >= nodes[j + 1].strength) {
    ++j;
  }
  const double low = nodes[j].strength;
  const double high = nodes[j + 1].strength;
  place.nearest = j == 0 || strength - low > high - strength ? j + 1 : j;
  place.high_share = std::clamp((strength - low) / (high - low), 0.0, 1.0);
  place.from_low = strength - low;
  place.from_nearest = strength - nodes[place.nearest].strength;
  return place;
}

// The first node is normal operation.
SignalMask MovedAlong(const ObserverPlan& plan, const StrengthPath& path) {
  SignalMask moved = kBasicSignals;
  for (std::size_t i = 1; i < path.nodes.size(); ++i) {
    moved &= plan.models().observers[path.nodes[i].observer].moved;
  }
  return moved;
}

StrengthPath MakeStrengthPath(const ObserverPlan& plan,
                              const std::vector<std::size_t>& observers) {
  StrengthPath path;
  AddNode(plan, 0, path);
  for (const std::size_t observer : observers) {
    AddNode(plan, observer, path);
    AddErrors(plan.models(), path);
  }
  const Observer& last = plan.models().observers[observers.back()];
  path.sign = last.strength < 0.0 ? -1.0 : 1.0;
  path.fault_index =
      static_cast<std::size_t>(FaultIndex(plan.models(), last.fault));
  path.inputs = InputsOf(last.fault);
  path.moved = MovedAlong(plan, path);
  path.taught = IsTaught(last);
  SetReach(path);
  return path;
}

FaultPlan::FaultPlan(std::shared_ptr<const ObserverPlan> observers)
    : observers_(std::move(observers)),
      memory_(1.0 - 1.0 / models().decision.evidence_window),
      judges_fit_(JudgesFit(models())) {
  for (const Observer& observer : models().observers) {
    fault_indices_.push_back(
        static_cast<std::size_t>(FaultIndex(models(), observer.fault)));
  }
  for (std::size_t c = 0; c < models().channels.size(); ++c) {
    channel_times_.push_back(ChannelTime(models(), c));
  }
  for (const int fault : models().faults) {
    for (const bool negative : {false, true}) {
      const auto found = ObserversOf(models(), fault, negative);
      if (!found.empty()) {
        paths_.push_back(MakeStrengthPath(*observers_, found));
      }
    }
  }
  for (std::size_t i = 1; i < models().observers.size(); ++i) {
    if (IsTaught(models().observers[i])) {
      paths_.push_back(MakeStrengthPath(*observers_, {i}));
    }
  }
}

}  // namespace fdi
