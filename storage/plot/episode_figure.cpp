#include "storage/plot/episode_figure.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <iterator>
#include <limits>

namespace fdi::storage {
namespace {

constexpr double kMissing = std::numeric_limits<double>::quiet_NaN();
// Faults with a line of their own colour; others are grey.
constexpr std::array<const char*, 5> kFaultInks = {
    ink::kVermilion, ink::kBlue, ink::kGreen, ink::kOrange, ink::kSky};

double SecondsFrom(std::int64_t stamp_ns, std::int64_t origin_ns) {
  return static_cast<double>(stamp_ns - origin_ns) * 1e-9;
}

template <typename Value>
std::vector<double> Values(const std::vector<TraceInstant>& trace,
                           Value value_of) {
  std::vector<double> values;
  values.reserve(trace.size());
  std::transform(trace.begin(), trace.end(), std::back_inserter(values),
                 value_of);
  return values;
}

std::vector<double> Readings(const std::vector<TraceInstant>& trace,
                             Signal signal) {
  return Values(trace, [signal](const TraceInstant& instant) {
    const Sample& sample = instant.received.sample;
    return sample.Has(signal) ? sample[signal] : kMissing;
  });
}

std::vector<double> Residuals(const std::vector<TraceInstant>& trace,
                              std::size_t channel) {
  return Values(trace, [channel](const TraceInstant& instant) {
    return channel < instant.residuals.size() ? instant.residuals[channel]
                                              : kMissing;
  });
}

// ŷ = y − r of the normal observer for the channel that watches `signal`.
std::vector<double> Estimates(const EpisodeEvidence& evidence,
                              const std::vector<TraceInstant>& trace,
                              Signal signal) {
  const auto& channels = evidence.episode.channels;
  const auto found =
      std::find(channels.begin(), channels.end(), SignalName(signal));
  if (found == channels.end()) {
    return std::vector<double>(trace.size(), kMissing);
  }
  std::vector<double> estimates = Readings(trace, signal);
  const auto residuals =
      Residuals(trace, static_cast<std::size_t>(found - channels.begin()));
  std::transform(estimates.begin(), estimates.end(), residuals.begin(),
                 estimates.begin(), std::minus<>());
  return estimates;
}

std::vector<TraceInstant> Drawn(const EpisodeEvidence& evidence,
                                const EpisodeFigureOptions& options) {
  std::vector<TraceInstant> drawn;
  std::copy_if(evidence.trace.begin(), evidence.trace.end(),
               std::back_inserter(drawn), [&](const TraceInstant& instant) {
                 const double t_s =
                     SecondsFrom(instant.received.sample.stamp_ns,
                                 evidence.episode.detected_ns);
                 return instant.received.intake == Intake::kAccepted &&
                        t_s >= options.from_s && t_s <= options.to_s;
               });
  std::stable_sort(
      drawn.begin(), drawn.end(), [](const auto& a, const auto& b) {
        return a.received.sample.stamp_ns < b.received.sample.stamp_ns;
      });
  return drawn;
}

FigurePanel FlowPanel(const EpisodeEvidence& evidence,
                      const std::vector<TraceInstant>& trace) {
  const std::string unit(FlowUnitName(evidence.episode.flow_unit));
  return {"flow F [" + unit + "]",
          {{"F measured", ink::kBlack, 1.6, Dash::kSolid,
            Readings(trace, Signal::kF)},
           {"F if normal", ink::kBlue, 1.6, Dash::kDashed,
            Estimates(evidence, trace, Signal::kF)}},
          {}};
}

FigurePanel TravelPanel(const EpisodeEvidence& evidence,
                        const std::vector<TraceInstant>& trace) {
  return {"closing [%]",
          {{"command CV", ink::kGrey, 1.6, Dash::kSolid,
            Readings(trace, Signal::kCv)},
           {"X measured", ink::kBlack, 1.6, Dash::kSolid,
            Readings(trace, Signal::kX)},
           {"X if normal", ink::kBlue, 1.6, Dash::kDashed,
            Estimates(evidence, trace, Signal::kX)}},
          {}};
}

FigurePanel ResidualPanel(const EpisodeEvidence& evidence,
                          const std::vector<TraceInstant>& trace,
                          std::size_t channel) {
  const Episode& episode = evidence.episode;
  const std::string& name = episode.channels[channel];
  const auto signal = ParseSignal(name);
  const std::string_view unit = !signal ? ""
                                : *signal == Signal::kF
                                    ? FlowUnitName(episode.flow_unit)
                                    : SignalUnit(*signal);
  FigurePanel panel;
  panel.label = "residual of " + name + " [" + std::string(unit) + "]";
  panel.curves.push_back({"measured − normal", ink::kBlack, 1.4, Dash::kSolid,
                          Residuals(trace, channel)});
  if (evidence.models) {
    const ChannelSpec& spec = evidence.models->channels[channel];
    panel.levels = {{spec.upper_threshold, "thresholds", ink::kPurple},
                    {spec.lower_threshold, "", ink::kPurple}};
  }
  return panel;
}

// The faults that were isolated come first, then by their greatest factor.
std::vector<std::size_t> ByWeight(const Episode& episode,
                                  const std::vector<std::vector<double>>& d) {
  const auto greatest = [&](std::size_t f) {
    double most = (episode.fault_bits >> f & 1U) != 0 ? 2.0 : 0.0;
    for (const double value : d[f]) {
      most = std::isfinite(value) && value > most ? value : most;
    }
    return most;
  };
  std::vector<std::pair<double, std::size_t>> order;
  for (std::size_t f = 0; f < d.size(); ++f) {
    order.emplace_back(-greatest(f), f);
  }
  std::sort(order.begin(), order.end());
  std::vector<std::size_t> faults;
  std::transform(order.begin(), order.end(), std::back_inserter(faults),
                 [](const auto& entry) { return entry.second; });
  return faults;
}

FigurePanel FactorPanel(const EpisodeEvidence& evidence,
                        const std::vector<TraceInstant>& trace) {
  const Episode& episode = evidence.episode;
  FigurePanel panel{"decision factor d [-]", {}, {}, true};
  if (evidence.models) {
    panel.levels = {{evidence.models->decision.isolation_threshold,
                     "threshold T", ink::kPurple}};
  }
  // Decisions come after the detection: before it, a fault that looks normal
  // has a factor near 1, too.
  std::vector<std::vector<double>> factors;
  for (std::size_t f = 0; f < episode.faults.size(); ++f) {
    factors.push_back(Values(trace, [f](const TraceInstant& instant) {
      return instant.state != State::kNormal && f < instant.fault_factors.size()
                 ? instant.fault_factors[f]
                 : kMissing;
    }));
  }
  const auto order = ByWeight(episode, factors);
  for (std::size_t i = order.size(); i-- > 0;) {  // The gravest on top.
    const std::size_t f = order[i];
    const bool isolated = (episode.fault_bits >> f & 1U) != 0;
    const bool coloured = i < kFaultInks.size();
    panel.curves.push_back(
        {coloured ? episode.faults[f] + (isolated ? " (isolated)" : "") : "",
         coloured ? kFaultInks[i] : "#c8c8c8", isolated ? 3.0 : 1.2,
         isolated ? Dash::kSolid : Dash::kDashDot, std::move(factors[f])});
  }
  std::reverse(panel.curves.begin(), panel.curves.end());
  panel.curves.push_back({"normal (d_0)", ink::kBlack, 1.8, Dash::kDashed,
                          Values(trace, [](const TraceInstant& instant) {
                            return instant.normal_factor;
                          })});
  return panel;
}

// Colour and word of a mark; no word for what is no mark.
std::pair<std::string, const char*> MarkOf(const EpisodeEvent& event) {
  if (event.kind == "ISOLATED" || event.kind == "REISOLATED") {
    return {(event.kind == "ISOLATED" ? "isolated " : "now ") +
                (event.faults.empty() ? "unknown" : event.faults),
            ink::kBlue};
  }
  if (event.kind == "CLEARED") {
    return {"cleared", ink::kGreen};
  }
  if (event.kind == "CLOSED") {
    return {"closed" + (event.reason == "cleared" ? "" : " " + event.reason),
            ink::kGrey};
  }
  return {event.kind == "RESUMED" ? "resumed" : "", ink::kGrey};
}

std::vector<FigureMark> Marks(const EpisodeEvidence& evidence) {
  const std::int64_t origin_ns = evidence.episode.detected_ns;
  std::vector<FigureMark> marks = {{0.0, "start", ink::kVermilion}};
  const auto detected =
      std::find_if(evidence.trace.begin(), evidence.trace.end(),
                   [origin_ns](const TraceInstant& instant) {
                     return instant.received.sample.stamp_ns >= origin_ns &&
                            instant.state != State::kNormal;
                   });
  if (detected != evidence.trace.end()) {
    marks.push_back({SecondsFrom(detected->received.sample.stamp_ns, origin_ns),
                     "detected", ink::kVermilion});
  }
  for (const EpisodeEvent& event : evidence.events) {
    const auto [text, colour] = MarkOf(event);
    if (!text.empty()) {
      marks.push_back({SecondsFrom(event.stamp_ns, origin_ns), text, colour});
    }
  }
  return marks;
}

// Stretches in which the engine did not decide, and gaps of the record.
std::vector<FigureBand> Bands(const EpisodeEvidence& evidence,
                              const std::vector<TraceInstant>& trace) {
  const std::int64_t origin_ns = evidence.episode.detected_ns;
  std::vector<FigureBand> bands;
  for (std::size_t i = 0; i < trace.size(); ++i) {
    if (trace[i].quality == Quality::kLive) {
      continue;
    }
    const std::string name(QualityName(trace[i].quality));
    const double t_s =
        SecondsFrom(trace[i].received.sample.stamp_ns, origin_ns);
    const bool goes_on = i > 0 && trace[i - 1].quality == trace[i].quality;
    if (!goes_on) {
      bands.push_back({t_s, t_s, name, "#efefef"});
    }
    bands.back().to_s =
        i + 1 < trace.size()
            ? SecondsFrom(trace[i + 1].received.sample.stamp_ns, origin_ns)
            : t_s;
  }
  for (const DataGap& gap : evidence.gaps) {
    bands.push_back({SecondsFrom(gap.from_ns, origin_ns),
                     SecondsFrom(gap.to_ns, origin_ns), gap.reason, "#d0d0d0"});
  }
  return bands;
}

std::string Subtitle(const Episode& e) {
  char strength[32];
  std::snprintf(strength, sizeof strength, "%.2f", e.strength);
  return "detected " + e.detected_utc +
         (e.isolated_ns ? ",  strength " + std::string(strength) : "") +
         ",  model set " + e.model_set + " (" + EpisodeIdText(e.model_hash) +
         "),  episode " + e.episode_id;
}

}  // namespace

TimeFigure EpisodeFigure(const EpisodeEvidence& evidence,
                         const EpisodeFigureOptions& options) {
  const Episode& episode = evidence.episode;
  const std::vector<TraceInstant> trace = Drawn(evidence, options);
  TimeFigure figure;
  const std::string name =
      options.fault_name.empty() ? "" : "  " + options.fault_name;
  figure.title =
      episode.valve_id + ":  " + episode.fault.value_or("not isolated") + name;
  figure.subtitle = Subtitle(episode);
  figure.time_label = "time from the first abnormal sample";
  figure.t_s = Values(trace, [&episode](const TraceInstant& instant) {
    return SecondsFrom(instant.received.sample.stamp_ns, episode.detected_ns);
  });
  if (evidence.models) {
    figure.gap_s = 1.5 * evidence.models->sample_period_s;
  }
  figure.panels = {FlowPanel(evidence, trace), TravelPanel(evidence, trace)};
  for (std::size_t c = 0; c < episode.channels.size(); ++c) {
    figure.panels.push_back(ResidualPanel(evidence, trace, c));
  }
  figure.panels.push_back(FactorPanel(evidence, trace));
  figure.marks = Marks(evidence);
  figure.bands = Bands(evidence, trace);
  figure.footnote =
      evidence.models
          ? "grey: nothing was decided, or not recorded"
          : "thresholds are not shown: the model set is not in models.db";
  return figure;
}

}  // namespace fdi::storage
