#include "trainer/learning/taught_observers.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <memory>
#include <utility>

#include "base/error.h"
#include "diagnosis/decision/fault_plan.h"
#include "diagnosis/model/fault_catalogue.h"
#include "diagnosis/model/taught.h"
#include "diagnosis/observers/fit_window.h"
#include "diagnosis/observers/observer_kernels.h"
#include "trainer/model_set_description.h"
#include "trainer/observer_adaptation.h"
#include "trainer/observer_calibration.h"
#include "trainer/regression.h"
#include "trainer/rule_text.h"
#include "trainer/statistics.h"

namespace fdi::trainer {
namespace {

constexpr double kSameStrength = 0.025;
constexpr double kMeanMargin = 0.5;    // deviations, as in SetFitBounds()
constexpr double kSquareFactor = 2.0;  // likewise

// The parent's observer of the fault that is nearest in strength; else null.
const Observer* NearestOf(const ModelSet& parent, const Lesson& lesson) {
  const Observer* nearest = nullptr;
  const auto away = [&](const Observer& observer) {
    return std::abs(observer.strength - lesson.strength);
  };
  for (const Observer& observer : parent.observers) {
    if (observer.fault == lesson.fault && !IsTaught(observer) &&
        observer.strength * lesson.strength > 0.0 &&
        (nearest == nullptr || away(observer) < away(*nearest))) {
      nearest = &observer;
    }
  }
  return nearest;
}

// κ of the parent's observers of the fault, the largest: how far the effect of
// another strength is from what is interpolated. With less than two of them it
// is not known.
double InterpolationError(const ModelSet& parent, const Lesson& lesson,
                          std::size_t c) {
  double largest = 0.0;
  int count = 0;
  for (const Observer& observer : parent.observers) {
    if (observer.fault == lesson.fault && !IsTaught(observer) &&
        observer.strength * lesson.strength > 0.0) {
      largest = std::max(largest, observer.channels[c].interpolation_error);
      ++count;
    }
  }
  return count > 1 ? largest : ChannelObserver{}.interpolation_error;
}

// The base of a channel of a fault that the parent does not know: no
// effect at all, by rules that do not read the channel's own past.
ChannelObserver WithoutEffect(const ModelSet& parent, std::size_t c) {
  const ChannelObserver& normal = parent.observers.front().channels[c];
  if (!IsFreeRunning(normal.model)) {
    return normal;
  }
  if (parent.observers.size() < 2) {
    throw DataError("model set " + parent.name +
                    " has no fault observer whose rules a new one can take");
  }
  ChannelObserver none = parent.observers[1].channels[c];
  for (TsRule& rule : none.model.rules) {
    rule.intercept = 0.0;
    std::ranges::fill(rule.slopes, 0.0);
  }
  return none;
}

// The stretches without the time in which the normal observer settles, with
// what is to be explained in place of the readings: these, or their difference
// to the normal observer's.
Condition TargetsOf(const Lesson& lesson, const ChannelObserver& normal,
                    bool difference, int settling) {
  Condition targets{lesson.fault, lesson.strength, {}, {}};
  for (const Stretch& stretch : lesson.stretches) {
    if (stretch.samples.size() <= static_cast<std::size_t>(settling)) {
      continue;
    }
    const std::vector<double> expected =
        difference ? RunPredictions(normal.model, stretch)
                   : std::vector<double>(stretch.samples.size(), 0.0);
    Stretch part{stretch.run_id, {}};
    for (auto k = static_cast<std::size_t>(settling);
         k < stretch.samples.size(); ++k) {
      Sample sample = stretch.samples[k];
      const Signal output = normal.model.output;
      sample.Set(output, sample[output] - expected[k]);
      part.samples.push_back(sample);
    }
    targets.training.push_back(std::move(part));
    // WholeStretch() pairs training and validation parts by index.
    targets.validation.push_back({stretch.run_id, {}});
  }
  return targets;
}

// Mean of the squared residuals in units of the deviation, outliers bounded as
// in the evidence.
double MeanDistance(const std::vector<double>& residuals, double sd) {
  double sum = 0.0;
  for (const double r : residuals) {
    sum += std::min(r * r / (sd * sd), kMaxSquaredDistance);
  }
  return residuals.empty() ? 0.0 : sum / static_cast<double>(residuals.size());
}

// Log-likelihood of so many residuals, less a constant.
double Likelihood(const std::vector<double>& residuals, double sd, double count,
                  double channel_time) {
  return -0.5 * count * (MeanDistance(residuals, sd) + 2.0 * std::log(sd)) /
         channel_time;
}

// The limits of `former`, in deviations of `sd`, and wide enough for what the
// blocks of t_k residuals show that the model was not fitted to.
FitBounds BoundsOf(const ChannelObserver& former, double sd,
                   const std::vector<double>& residuals, int block) {
  const double scale = former.residual_sd / sd;
  FitBounds bounds{former.fit.lower_mean * scale, former.fit.upper_mean * scale,
                   former.fit.upper_square * scale * scale};
  const auto length = static_cast<std::size_t>(block);
  for (std::size_t k = 0; k + length <= residuals.size(); k += length) {
    double mean = 0.0;
    double square = 0.0;
    for (std::size_t i = k; i < k + length; ++i) {
      const double most = std::sqrt(kMaxSquaredDistance);
      const double z = std::clamp(residuals[i] / sd, -most, most);
      mean += z / block;
      square += z * z / block;
    }
    bounds.lower_mean = std::min(bounds.lower_mean, mean - kMeanMargin);
    bounds.upper_mean = std::max(bounds.upper_mean, mean + kMeanMargin);
    bounds.upper_square = std::max(bounds.upper_square, kSquareFactor * square);
  }
  return bounds;
}

struct TaughtChannel {
  ChannelObserver channel;
  double over_normal{0.0};
  double over_former{0.0};
};

TaughtChannel TeachChannel(const ModelSet& parent, std::size_t c,
                           const ChannelObserver& former, const Lesson& lesson,
                           double channel_time) {
  const ChannelObserver& normal = parent.observers.front().channels[c];
  const int settling = parent.decision.settling_samples;
  const Condition targets =
      TargetsOf(lesson, normal, former.difference, settling);
  AdaptedModel adapted = AdaptModel(former.model, targets);
  // On another day the readings scatter as much about it as about the normal
  // observer, whatever the few minutes of the lesson show.
  const double seen = std::sqrt(MeanSquare(adapted.residuals));
  const double sd = std::max({normal.residual_sd, seen, kMinSd});
  std::vector<double> widened = adapted.residuals;
  for (double& residual : widened) {
    residual *= seen > 0.0 ? sd / seen : 1.0;
  }
  TaughtChannel taught;
  taught.channel =
      CalibrateChannel(std::move(adapted.model), widened, adapted.outputs,
                       kMinDeviation * normal.residual_sd);
  taught.channel.difference = former.difference;
  taught.channel.residual_sd = sd;
  taught.channel.correlation_time =
      std::max(taught.channel.correlation_time, normal.correlation_time);
  taught.channel.interpolation_error = InterpolationError(parent, lesson, c);
  if (JudgesFit(parent)) {
    taught.channel.fit = BoundsOf(former, sd, adapted.residuals,
                                  parent.decision.isolation_samples);
  }
  const auto count = static_cast<double>(adapted.residuals.size());
  const auto likelihood = [&](const std::vector<double>& residuals, double s) {
    return Likelihood(residuals, s, count, channel_time);
  };
  const double own = likelihood(adapted.residuals, sd);
  const std::vector<double> without =
      RunResiduals(normal.model, lesson.stretches, settling);
  const std::vector<double> before =
      RunResiduals(former.model, targets.training, 0);
  taught.over_normal = own - likelihood(without, normal.residual_sd);
  taught.over_former = own - likelihood(before, former.residual_sd);
  return taught;
}

void RequireSamples(const Lesson& lesson, int settling) {
  constexpr std::int64_t kLeast = 50;
  std::int64_t usable = 0;
  for (const Stretch& stretch : lesson.stretches) {
    usable += std::max<std::int64_t>(
        0, static_cast<std::int64_t>(stretch.samples.size()) - settling);
  }
  if (usable < kLeast) {
    throw DataError(FaultName(lesson.fault) + ": " + std::to_string(usable) +
                    " samples are left when the observers have settled, "
                    "needed are " +
                    std::to_string(kLeast));
  }
}

// Refuses a lesson that noise could explain.
void RequireEffect(const TaughtObserver& taught, double needed) {
  const double gain = taught.gain_over_normal;
  if (gain >= needed) {
    return;
  }
  std::string more;
  if (gain > 0.0) {
    const double count = static_cast<double>(taught.samples) * needed / gain;
    more = "about " + std::to_string(std::llround(count)) +
           " samples like these, or ";
  }
  throw DataError(
      FaultName(taught.observer.fault) + ": its effect is within the noise. " +
      std::to_string(taught.samples) +
      " samples are explained better than by normal operation by " +
      Digits(gain, 3) + " in log-likelihood, needed is " + Digits(needed, 3) +
      ": this takes " + more + "an episode in which the fault is stronger");
}

}  // namespace

TaughtObserver Teach(const ModelSet& parent, const Lesson& lesson) {
  const int settling = parent.decision.settling_samples;
  RequireSamples(lesson, settling);
  const Observer* nearest = NearestOf(parent, lesson);
  const FaultPlan plan(std::make_shared<const ObserverPlan>(parent));
  TaughtObserver taught;
  ModelSet naming;
  AddObserver(lesson.fault, lesson.strength, naming);
  taught.observer = naming.observers.front();
  taught.observer.name += kTaughtMark;
  taught.adapted_from = nearest == nullptr ? "" : nearest->name;
  taught.samples = CountSamples(lesson.stretches);
  for (std::size_t c = 0; c < parent.channels.size(); ++c) {
    TaughtChannel channel = TeachChannel(
        parent, c,
        nearest == nullptr ? WithoutEffect(parent, c) : nearest->channels[c],
        lesson, plan.channel_time(c));
    taught.observer.channels.push_back(std::move(channel.channel));
    taught.gain_over_normal += channel.over_normal;
    taught.gain_over_former += channel.over_former;
  }
  if (JudgesFit(parent)) {
    taught.observer.moved =
        MovedIn({lesson.fault, lesson.strength, {}, lesson.stretches}, parent);
  }
  RequireEffect(taught, parent.decision.evidence_support);
  return taught;
}

ModelSet WithTaught(const ModelSet& parent,
                    const std::vector<TaughtObserver>& taught) {
  ModelSet models = parent;
  std::erase_if(models.observers, IsTaught);
  if (models.observers.size() + taught.size() > kMaxObservers) {
    throw DataError("model set " + parent.name + " has " +
                    std::to_string(models.observers.size()) +
                    " observers, which leaves room for " +
                    std::to_string(kMaxObservers - models.observers.size()) +
                    " that are taught, not " + std::to_string(taught.size()));
  }
  for (const TaughtObserver& one : taught) {
    models.observers.push_back(one.observer);
    const auto at = std::ranges::lower_bound(models.faults, one.observer.fault);
    if (at == models.faults.end() || *at != one.observer.fault) {
      models.faults.insert(at, one.observer.fault);
    }
  }
  Validate(models);
  return models;
}

std::vector<Lesson> JoinLessons(std::vector<Lesson> lessons) {
  std::vector<Lesson> joined;
  for (Lesson& lesson : lessons) {
    const auto same = std::ranges::find_if(joined, [&](const Lesson& other) {
      return other.fault == lesson.fault &&
             std::abs(other.strength - lesson.strength) < kSameStrength;
    });
    if (same == joined.end()) {
      joined.push_back(std::move(lesson));
    } else {
      std::ranges::move(lesson.stretches, std::back_inserter(same->stretches));
    }
  }
  return joined;
}

}  // namespace fdi::trainer
