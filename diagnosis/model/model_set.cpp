#include "diagnosis/model/model_set.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <functional>

#include "base/error.h"
#include "diagnosis/model/fault_catalogue.h"

namespace fdi {
namespace {

// Conditions are written so that NaN fails them.
void Check(bool condition, const ModelSet& models, const std::string& what) {
  if (!condition) {
    throw DataError("model set '" + models.name + "': " + what);
  }
}

void ValidateDecision(const ModelSet& models) {
  const DecisionParameters& p = models.decision;
  Check(p.isolation_threshold > 0.0 && p.isolation_threshold < 1.0, models,
        "isolation threshold T must be in (0, 1)");
  Check(p.isolation_fraction > 0.0 && p.isolation_fraction <= 1.0, models,
        "isolation fraction must be in (0, 1]");
  // IsolationWindow::Supported() relies on it: what supports a set also joins
  // it.
  Check(p.join_fraction > 0.0 && p.join_fraction <= p.isolation_fraction,
        models, "join fraction must be in (0, isolation fraction]");
  Check(p.detection_samples >= 1 && p.detection_samples <= 1000, models,
        "n_d must be in 1..1000");
  Check(p.isolation_samples >= 1 && p.isolation_samples <= 10000, models,
        "t_k must be in 1..10000");
  Check(p.reisolation_samples >= 1 && p.reisolation_samples <= 10000, models,
        "samples before another set is isolated must be in 1..10000");
  Check(p.clearing_samples >= 1 && p.clearing_samples <= 100000, models,
        "t_c must be in 1..100000");
  Check(p.settling_samples >= 0 && p.settling_samples <= 100000, models,
        "settling samples must be in 0..100000");
  // StrengthTracker divides by λ = 1 − 1/window, FaultBank by support − core.
  Check(p.evidence_window >= 2.0 && p.evidence_window <= 1e6, models,
        "evidence window must be in 2..1e6 samples");
  Check(p.evidence_core >= 0.0 && p.evidence_support > p.evidence_core, models,
        "evidence support must be beyond its core");
  Check(p.early_error >= 0.0 && p.early_error <= 0.1, models,
        "probability of a wrong early name must be in [0, 0.1]");
  Check(p.interpolation_allowance >= 0.0 && p.interpolation_allowance <= 1.0,
        models, "interpolation allowance must be in [0, 1]");
}

void ValidateChannel(const ModelSet& models, const ChannelSpec& channel) {
  const std::string where = "channel " + channel.name + ": ";
  Check(channel.lower_threshold < 0.0 && channel.upper_threshold > 0.0, models,
        where + "thresholds must enclose zero");
  Check(channel.windows.size() <= kMaxWindows, models,
        where + "at most 4 windows are accepted");
  for (const WindowLimits& window : channel.windows) {
    Check(window.length >= 2 && window.length <= 100000, models,
          where + "windows must be 2 to 100000 samples long");
    Check(window.lower_mean < 0.0 && window.upper_mean > 0.0, models,
          where + "limits of a window must enclose zero");
    Check(std::isfinite(window.upper_log_rms) &&
              std::isfinite(window.log_activity),
          models, where + "limits of a window must be finite");
    Check(window.command.minimum < window.command.maximum, models,
          where + "commands of a window must not be empty");
    Check(window.activity_slope >= 0.0 && window.activity_slope <= 1.0, models,
          where + "the slope of a window must be in [0, 1]");
  }
}

void ValidateObserver(const ModelSet& models, const Observer& observer) {
  const std::string where = "observer '" + observer.name + "': ";
  Check(observer.channels.size() == models.channels.size(), models,
        where + "not one model per channel");
  Check(observer.fault >= 0 && observer.fault <= kLastFault, models,
        where + "fault beyond " + std::string(kFaultNames));
  Check(std::abs(observer.strength) <= 1.0, models,
        where + "strength beyond [-1, 1]");
  Check(observer.fault != 0 ||
            std::none_of(observer.channels.begin(), observer.channels.end(),
                         [](const auto& c) { return c.difference; }),
        models, where + "the normal observer is no difference to itself");
  Check((observer.fault == 0) == (observer.strength == 0.0), models,
        where + "strength 0 belongs to the normal observer alone");
  for (std::size_t c = 0; c < observer.channels.size(); ++c) {
    const ChannelObserver& channel = observer.channels[c];
    Validate(channel.model, observer.name.c_str());
    Check(channel.model.output == models.channels[c].output, models,
          where + "output is not the channel's");
    // The evidence divides by its square and takes the logarithm of that.
    Check(std::isfinite(channel.residual_sd) && channel.residual_sd > 0.0,
          models, where + "residual deviation must be positive");
    Check(channel.correlation_time >= 1.0, models,
          where + "correlation time must be at least 1 sample");
    Check(channel.interpolation_error >= 0.0, models,
          where + "interpolation error must not be negative");
    const FitBounds& fit = channel.fit;
    Check(
        fit == FitBounds{} || (fit.lower_mean < 0.0 && fit.upper_mean > 0.0 &&
                               fit.upper_square > 0.0 &&
                               std::isfinite(fit.upper_mean - fit.lower_mean) &&
                               std::isfinite(fit.upper_square)),
        models, where + "limits of a fit must be finite and enclose zero");
    const Trapezoid& m = channel.membership;
    Check(m.a <= m.b && m.b <= m.c && m.c <= m.d && std::isfinite(m.d - m.a),
          models, where + "corners of the membership are not ascending");
  }
}

void ValidateRegion(const ModelSet& models) {
  const ValidityRegion& region = models.validity;
  for (const SignalRange& range : {region.cv, region.cv_mean, region.dp,
                                   region.t1, region.p1, region.p2}) {
    Check(range.minimum < range.maximum, models,
          "ranges of validity must not be empty");
  }
  Check(std::min({models.stuck.t1, models.stuck.p1, models.stuck.p2}) >= 0,
        models, "limits on repeated readings must not be negative");
  Check(std::min({models.every.p1, models.every.p2, models.every.t1,
                  models.every.x, models.every.f}) >= 0,
        models, "samples between two readings must not be negative");
  Check(region.cv_step > 0.0, models, "the step of CV must be positive");
  Check(region.flow_cutoff >= 0.0, models,
        "the flow cut-off must not be negative");
  Check(region.rearm_samples >= 0 && region.rearm_samples <= 100000, models,
        "samples before a valve is armed again must be in 0..100000");
}

void ValidateFloor(const ModelSet& models, const FloorLimits& floor) {
  for (const FloorLimits::Rod& rod : {floor.quick, floor.slow}) {
    Check(rod.share > 0.0 && rod.share <= 1.0 && rod.rate > 0.0, models,
          "the rod of the floor must move towards the command");
  }
  // RodBand keeps the last kMaxLag commands.
  Check(floor.delay >= 0 && floor.delay < kMaxLag, models,
        "the delay of the floor must be in 0..." + std::to_string(kMaxLag - 1));
  Check(floor.deviation > 0.0 && floor.stuck_travel > 0.0 &&
            floor.flow_factor >= 1.0 && floor.flow_margin > 0.0 &&
            floor.flow_gain >= 0.0 && floor.flow_high >= 0.0 &&
            floor.flow_share >= 0.0 && floor.flow_share <= 1.0,
        models, "limits of the floor must be positive");
  Check(
      floor.flow_shape.empty() ||
          (floor.flow_shape.size() == FloorLimits::kShapePoints &&
           std::ranges::all_of(floor.flow_shape,
                               [](double f) { return f >= 0.0 && f <= 1.0; })),
      models,
      "the trim of the floor must be " +
          std::to_string(FloorLimits::kShapePoints) + " values in 0..1");
  Check(floor.deviation_samples >= 1 && floor.deviation_samples <= 1000 &&
            floor.flow_samples >= 1 && floor.flow_samples <= 1000,
        models, "the floor takes at least one sample");
}

// By its models.
unsigned SignalsRead(const ModelSet& models) {
  unsigned mask = 0;
  for (const Observer& observer : models.observers) {
    for (const ChannelObserver& channel : observer.channels) {
      mask |= static_cast<unsigned>(RequiredSignals(channel.model)) |
              MaskOf(channel.model.output);
    }
  }
  return mask;
}

}  // namespace

// The test of too little flow is the last: without a flow there is none.
int FindingCount(const ModelSet& models) {
  const int all = kLastFloorFinding - kFirstFinding + 1;
  return !models.floor ? 0 : models.floor->flow_share > 0.0 ? all : all - 1;
}

void AddFindings(ModelSet& models) {
  for (int i = 0; i < FindingCount(models); ++i) {
    models.faults.push_back(kFirstFinding + i);
  }
}

FaultSet FindingsOf(const ModelSet& models) {
  FaultSet findings = 0;
  for (std::size_t i = 0; i < models.faults.size(); ++i) {
    findings |= IsFinding(models.faults[i]) ? FaultSet{1} << i : 0;
  }
  return findings;
}

int FaultIndex(const ModelSet& models, int fault) {
  const auto it = std::find(models.faults.begin(), models.faults.end(), fault);
  return it == models.faults.end()
             ? -1
             : static_cast<int>(it - models.faults.begin());
}

std::string FaultSetName(const ModelSet& models, FaultSet faults) {
  std::string name;
  for (std::size_t i = 0; i < models.faults.size(); ++i) {
    if ((faults >> i & 1U) != 0) {
      name += (name.empty() ? "" : "|") + FaultName(models.faults[i]);
    }
  }
  return name.empty() ? "unknown" : name;
}

SignalMask RequiredSignals(const ModelSet& models) {
  const unsigned mask = SignalsRead(models);
  const unsigned cv = MaskOf(Signal::kCv);
  return static_cast<SignalMask>(models.position_as_command && (mask & cv) != 0
                                     ? (mask & ~cv) | MaskOf(Signal::kX)
                                     : mask);
}

void Validate(const ModelSet& models) {
  Check(!models.name.empty() && models.name.size() <= 64, models,
        "the name must have 1 to 64 characters");
  Check(models.sample_period_s > 0.0 && models.sample_period_s <= 3600.0,
        models, "the sample period must be in (0, 3600] s");
  // Sizes are checked before anything is indexed: the arrays of Verdict and the
  // bits of a FaultSet hold no more.
  Check(!models.channels.empty() && models.channels.size() <= kMaxChannels,
        models, "there must be 1 to 16 channels");
  Check(!models.observers.empty() && models.observers.size() <= kMaxObservers,
        models, "there must be 1 to 128 observers");
  Check(models.faults.size() <= kMaxFaults, models,
        "there may be at most 64 faults");
  Check(models.observers.front().fault == 0, models,
        "the first observer must be the normal one");
  // Findings have the largest numbers, so they are the last bits: Floor and
  // Episode count them from the end.
  Check(std::ranges::adjacent_find(models.faults, std::greater_equal<>{}) ==
            models.faults.end(),
        models, "faults must be ascending");
  ValidateDecision(models);
  ValidateRegion(models);
  if (models.floor) {
    ValidateFloor(models, *models.floor);
  }
  const int drift = Contains(models.faults, kPositionDrift) ? 1 : 0;
  Check(std::popcount(FindingsOf(models)) == FindingCount(models) + drift &&
            (drift == 0 || models.floor),
        models, "a floor and its findings belong together");
  for (std::size_t i = 0; i < models.observers.size(); ++i) {
    const Observer& observer = models.observers[i];
    Check((i == 0) == (observer.fault == 0), models,
          "there must be exactly one normal observer");
    Check(i == 0 || FaultIndex(models, observer.fault) >= 0, models,
          "observer '" + observer.name + "' has a fault that is not listed");
    ValidateObserver(models, observer);
  }
  for (const std::vector<int>& group : models.groups) {
    for (const int fault : group) {
      Check(FaultIndex(models, fault) >= 0, models,
            "a group names a fault that is not listed");
    }
  }
  for (const ChannelSpec& channel : models.channels) {
    ValidateChannel(models, channel);
  }
  Check(!models.position_as_command ||
            (SignalsRead(models) & MaskOf(Signal::kX)) == 0,
        models, "a set that reads the position as command has no X");
}

}  // namespace fdi
