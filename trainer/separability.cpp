#include "trainer/separability.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>

#include "diagnosis/fault_bank.h"
#include "diagnosis/observer_bank.h"
#include "diagnosis/residual_windows.h"

namespace fdi::trainer {
namespace {

constexpr double kLowestInterpolationError = 0.02;
constexpr double kHighestInterpolationError = 1.0;
constexpr double kErrorFloor = 0.3;  // residual deviations
constexpr double kDetectableShare = 0.05;
constexpr double kGroupShare = 0.5;
constexpr int kEvidenceSamples = 60;  // before a factor counts

// Observers of one fault and direction by rising |strength|, normal first.
std::vector<int> Chain(const ModelSet& models, int fault, bool negative) {
  std::vector<int> chain{0};
  for (std::size_t i = 1; i < models.observers.size(); ++i) {
    const Observer& observer = models.observers[i];
    if (observer.fault == fault && (observer.strength < 0.0) == negative) {
      chain.push_back(static_cast<int>(i));
    }
  }
  std::sort(chain.begin(), chain.end(), [&](int a, int b) {
    return std::abs(models.observers[static_cast<std::size_t>(a)].strength) <
           std::abs(models.observers[static_cast<std::size_t>(b)].strength);
  });
  return chain;
}

struct InterpolationSums {
  double error{0.0};
  double move{0.0};
  double samples{0.0};
};

// Squares of: neighbours' interpolation less the observer between them, and
// how far the interpolation moved from the nearer neighbour.
std::vector<InterpolationSums> CompareWithNeighbours(
    const std::vector<Condition>& conditions, const ModelSet& models, int low,
    int middle, int high) {
  const auto strength = [&](int i) {
    return models.observers[static_cast<std::size_t>(i)].strength;
  };
  const double w =
      (strength(middle) - strength(low)) / (strength(high) - strength(low));
  std::vector<InterpolationSums> sums(models.channels.size());
  const Condition& condition = conditions[static_cast<std::size_t>(middle)];
  for (const Stretch& stretch : condition.validation) {
    ObserverBank bank(models);
    bank.Initialise(stretch.samples.front());
    for (std::size_t k = 0; k < stretch.samples.size(); ++k) {
      bank.Step(stretch.samples[k]);
      if (static_cast<int>(k) < models.decision.settling_samples) {
        continue;
      }
      for (std::size_t c = 0; c < sums.size(); ++c) {
        const int channel = static_cast<int>(c);
        if (!bank.active(channel)) {
          continue;
        }
        const double from = bank.prediction(low, channel);
        const double to = bank.prediction(high, channel);
        const double between = from + w * (to - from);
        const double nearer = w < 0.5 ? from : to;
        const double error = between - bank.prediction(middle, channel);
        sums[c].samples += 1.0;
        sums[c].error += error * error;
        sums[c].move += (between - nearer) * (between - nearer);
      }
    }
  }
  return sums;
}

void SetInterpolationErrors(const std::vector<InterpolationSums>& sums,
                            Observer& observer) {
  for (std::size_t c = 0; c < sums.size(); ++c) {
    ChannelObserver& channel = observer.channels[c];
    const double floor = kErrorFloor * channel.residual_sd;
    const double excess =
        std::max(0.0, sums[c].error - floor * floor * sums[c].samples);
    channel.interpolation_error =
        std::clamp(sums[c].move > 0.0 ? std::sqrt(excess / sums[c].move) : 0.0,
                   kLowestInterpolationError, kHighestInterpolationError);
  }
}

void TakeOverErrors(const Observer& from, Observer& to) {
  for (std::size_t c = 0; c < to.channels.size(); ++c) {
    to.channels[c].interpolation_error = from.channels[c].interpolation_error;
  }
}

// Share of samples beyond a threshold, and per fault index with d ≥ T.
struct Shares {
  double samples{0.0};
  double abnormal{0.0};
  std::vector<double> accepted;
};

// True if a residual or a window of the normal observer is beyond its limits.
bool IsAbnormal(const ModelSet& models, const ObserverBank& bank,
                const ResidualWindows& windows) {
  for (std::size_t c = 0; c < models.channels.size(); ++c) {
    const ChannelSpec& channel = models.channels[c];
    const double r = bank.residual(0, static_cast<int>(c));
    bool beyond = r < channel.lower_threshold || r > channel.upper_threshold;
    for (std::size_t w = 0; w < channel.windows.size(); ++w) {
      beyond = beyond || IsBeyond(channel.windows[w], windows.window(c, w),
                                  windows.command(c, w));
    }
    if (bank.active(static_cast<int>(c)) && beyond) {
      return true;
    }
  }
  return false;
}

void ScoreStretch(const Stretch& stretch, const ModelSet& models,
                  Shares& shares) {
  ObserverBank bank(models);
  FaultBank faults(models);
  Verdict verdict;
  bank.Initialise(stretch.samples.front());
  ResidualWindows windows(models);
  faults.Restart();
  const int start = models.decision.settling_samples;
  for (std::size_t k = 0; k < stretch.samples.size(); ++k) {
    bank.Step(stretch.samples[k]);
    if (static_cast<int>(k) < start) {
      continue;
    }
    std::array<double, kMaxChannels> residuals{};
    for (std::size_t c = 0; c < models.channels.size(); ++c) {
      residuals[c] = bank.residual(0, static_cast<int>(c));
    }
    windows.Push({residuals.data(), models.channels.size()},
                 stretch.samples[k][Signal::kCv]);
    faults.Score(bank, verdict);
    faults.Follow(bank);
    faults.Compete(verdict);
    if (static_cast<int>(k) < start + kEvidenceSamples) {
      continue;
    }
    shares.samples += 1.0;
    shares.abnormal += IsAbnormal(models, bank, windows) ? 1.0 : 0.0;
    for (std::size_t i = 0; i < models.faults.size(); ++i) {
      shares.accepted[i] +=
          verdict.fault_factors[i] >= models.decision.isolation_threshold;
    }
  }
}

}  // namespace

void FitInterpolationErrors(const std::vector<Condition>& conditions,
                            ModelSet& models) {
  for (const int fault : models.faults) {
    for (const bool negative : {false, true}) {
      const std::vector<int> chain = Chain(models, fault, negative);
      for (std::size_t n = 1; n + 1 < chain.size(); ++n) {
        const auto sums = CompareWithNeighbours(
            conditions, models, chain[n - 1], chain[n], chain[n + 1]);
        SetInterpolationErrors(
            sums, models.observers[static_cast<std::size_t>(chain[n])]);
      }
      if (chain.size() > 2) {
        TakeOverErrors(
            models.observers[static_cast<std::size_t>(chain[chain.size() - 2])],
            models.observers[static_cast<std::size_t>(chain.back())]);
      }
    }
  }
}

void FindGroups(const std::vector<Condition>& conditions, ModelSet& models) {
  models.groups.clear();
  models.undetectable.clear();
  std::map<int, Shares> by_fault;
  for (const Condition& condition : conditions) {
    if (condition.fault == 0) {
      continue;
    }
    Shares& shares = by_fault[condition.fault];
    shares.accepted.resize(models.faults.size(), 0.0);
    for (const Stretch& stretch : condition.validation) {
      ScoreStretch(stretch, models, shares);
    }
  }
  std::vector<std::size_t> root(models.faults.size());
  std::iota(root.begin(), root.end(), std::size_t{0});
  for (const auto& [fault, shares] : by_fault) {
    if (shares.abnormal < kDetectableShare * shares.samples) {
      models.undetectable.push_back(fault);
      continue;
    }
    const auto i = static_cast<std::size_t>(FaultIndex(models, fault));
    for (std::size_t l = 0; l < root.size(); ++l) {
      if (l != i && shares.accepted[l] > kGroupShare * shares.samples) {
        const std::size_t merged = std::min(root[i], root[l]);
        const std::size_t gone = std::max(root[i], root[l]);
        std::replace(root.begin(), root.end(), gone, merged);
      }
    }
  }
  for (std::size_t first = 0; first < root.size(); ++first) {
    std::vector<int> group;
    for (std::size_t i = 0; i < root.size(); ++i) {
      if (root[i] == first) {
        group.push_back(models.faults[i]);
      }
    }
    if (group.size() > 1) {
      models.groups.push_back(group);
    }
  }
}

}  // namespace fdi::trainer
