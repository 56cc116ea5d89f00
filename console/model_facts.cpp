#include "console/model_facts.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <optional>

#include "base/error.h"
#include "base/text.h"
#include "diagnosis/model/fault_catalogue.h"
#include "diagnosis/observers/residual_windows.h"
#include "storage/models/models.h"

namespace fdi::console {
namespace {

constexpr std::size_t kCachedSets = 32;
constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

std::string UnitOf(Signal signal, FlowUnit flow_unit) {
  return std::string(signal == Signal::kF ? FlowUnitName(flow_unit)
                                          : SignalUnit(signal));
}

std::shared_ptr<const ModelFacts> FactsOf(const storage::Episode& episode) {
  auto facts = std::make_shared<ModelFacts>();
  facts->model_set = episode.model_set;
  facts->hash = episode.model_hash;
  facts->isolation_threshold = kNone;
  facts->flow_unit = episode.flow_unit;
  for (const std::string& name : episode.channels) {
    const Signal signal = ParseSignal(name).value_or(Signal::kX);
    facts->channels.push_back(
        {name, signal, UnitOf(signal, episode.flow_unit), kNone, kNone});
  }
  facts->faults = episode.faults;
  return facts;
}

// In the order of Signal.
constexpr std::array<std::string_view, kSignalCount> kPlainNames{
    "command",         "inlet pressure",     "outlet pressure",
    "temperature",     "rod position",       "flow",
    "set point",       "positioner output",  "chamber pressure",
    "supply pressure", "controlled variable"};

// Residual relative to the threshold of its sign; abnormal above 1.
double Excess(const ModelFacts::Channel& channel, double residual) {
  const double threshold = residual < 0.0 ? channel.low : channel.high;
  return threshold != 0.0 ? residual / threshold : 0.0;
}

std::optional<std::size_t> FarthestBeyond(const ModelFacts& models,
                                          const TracePoint& point) {
  std::optional<std::size_t> farthest;
  double most = 1.0;
  const std::size_t count =
      std::min(models.channels.size(), point.residuals.size());
  for (std::size_t c = 0; c < count; ++c) {
    const double excess = Excess(models.channels[c], point.residuals[c]);
    if (excess > most) {  // False for NaN.
      most = excess;
      farthest = c;
    }
  }
  return farthest;
}

std::string Fitting(const ModelFacts& models, const TracePoint& point,
                    const FaultNamer& name) {
  std::vector<std::size_t> fitting;
  for (std::size_t f = 0;
       f < std::min(models.faults.size(), point.factors.size()); ++f) {
    if (point.factors[f] >= 0.5 * models.isolation_threshold) {
      fitting.push_back(f);
    }
  }
  std::stable_sort(fitting.begin(), fitting.end(),
                   [&](std::size_t a, std::size_t b) {
                     return point.factors[a] > point.factors[b];
                   });
  const auto name_of = [&](std::size_t f) { return name(models.faults[f]); };
  return fitting.empty() ? "no known fault fits"
                         : "fits: " + JoinText(fitting, ", ", name_of);
}

}  // namespace

std::shared_ptr<const ModelFacts> FactsOf(const ModelSet& models) {
  auto facts = std::make_shared<ModelFacts>();
  facts->model_set = models.name + "@" + std::to_string(models.version);
  facts->hash = models.content_hash;
  for (const ChannelSpec& channel : models.channels) {
    facts->channels.push_back(
        {channel.name, channel.output, UnitOf(channel.output, models.flow_unit),
         channel.lower_threshold, channel.upper_threshold, channel.windows});
  }
  for (const int fault : models.faults) {
    facts->faults.push_back(FaultName(fault));
  }
  for (const int fault : models.undetectable) {
    facts->undetectable.push_back(FaultName(fault));
  }
  facts->isolation_threshold = models.decision.isolation_threshold;
  facts->isolation_samples = models.decision.isolation_samples;
  facts->detection_samples = models.decision.detection_samples;
  facts->period_s = models.sample_period_s;
  facts->flow_unit = models.flow_unit;
  facts->required = RequiredSignals(models);
  facts->command = models.position_as_command ? Signal::kX : Signal::kCv;
  return facts;
}

std::shared_ptr<const ModelFacts> StoredModels::For(
    const storage::Episode& episode) {
  const MutexLock lock(mutex_);
  const auto known = known_.find(episode.model_set);
  if (known != known_.end() && known->second->hash == episode.model_hash) {
    return known->second;
  }
  std::shared_ptr<const ModelFacts> facts;
  try {
    if (!path_.empty()) {
      facts = FactsOf(storage::ModelStore(path_).Load(episode.model_set));
    }
  } catch (const NotFoundError&) {
  }
  // The same name and version in another models.db has another hash.
  if (!facts || facts->hash != episode.model_hash) {
    return FactsOf(episode);
  }
  Cache(facts);
  return facts;
}

void StoredModels::Add(std::shared_ptr<const ModelFacts> facts) {
  const MutexLock lock(mutex_);
  Cache(std::move(facts));
}

void StoredModels::Cache(std::shared_ptr<const ModelFacts> facts) {
  if (known_.size() >= kCachedSets) {
    known_.erase(known_.begin());
  }
  const std::string name = facts->model_set;
  known_[name] = std::move(facts);
}

std::vector<WindowBeyond> WindowsBeyond(const ModelFacts& models,
                                        const std::vector<TracePoint>& points) {
  ModelSet set;  // With only the channels, from which windows are made.
  for (const ModelFacts::Channel& channel : models.channels) {
    set.channels.emplace_back().windows = channel.windows;
  }
  ResidualWindows windows(set);
  for (const TracePoint& point : points) {
    if (point.quality == Quality::kLive &&
        point.residuals.size() == set.channels.size()) {
      windows.Push(point.residuals, point.sample.Has(models.command)
                                        ? point.sample[models.command]
                                        : kNone);
    }
  }
  std::vector<WindowBeyond> beyond;
  for (std::size_t c = 0; c < set.channels.size(); ++c) {
    for (std::size_t w = 0; w < set.channels[c].windows.size(); ++w) {
      const WindowLimits& limits = set.channels[c].windows[w];
      const ResidualWindow& window = windows.window(c, w);
      const ResidualWindow& command = windows.command(c, w);
      if (!Applies(limits, window, command)) {
        continue;
      }
      if (window.mean() < limits.lower_mean ||
          window.mean() > limits.upper_mean) {
        beyond.push_back({c, limits.length, false, window.mean(),
                          limits.lower_mean, limits.upper_mean});
      }
      if (const double upper = UpperLogRms(limits, command);
          window.log_rms() > upper) {
        beyond.push_back({c, limits.length, true, std::exp(window.log_rms()),
                          0.0, std::exp(upper)});
      }
    }
  }
  return beyond;
}

std::string TwoDigits(double value) {
  char text[32];
  if (std::abs(value) >= 10.0) {
    std::snprintf(text, sizeof text, "%.0f", value);
  } else {
    std::snprintf(text, sizeof text, "%.2g", value);
  }
  return text;
}

std::string Explain(const ModelFacts& models, const TracePoint& point,
                    const FaultNamer& name) {
  const std::optional<std::size_t> channel = FarthestBeyond(models, point);
  if (!channel && point.state == State::kNormal) {
    return "as the normal model expects";
  }
  std::string text = "no reading beyond its threshold now";
  if (channel) {
    const ModelFacts::Channel& c = models.channels[*channel];
    const double residual = point.residuals[*channel];
    text = std::string(kPlainNames.at(static_cast<std::size_t>(c.output))) +
           " " + TwoDigits(std::abs(residual)) + " " + c.unit +
           (residual < 0.0 ? " below" : " above") +
           " what the normal model expects";
  }
  return point.state == State::kNormal
             ? text
             : text + "; " + Fitting(models, point, name);
}

}  // namespace fdi::console
