#include "report/plot/episode_figure.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <iterator>
#include <limits>
#include <numeric>

#include "base/error.h"
#include "base/time_units.h"
#include "diagnosis/model/fault_catalogue.h"
#include "diagnosis/observers/residual_windows.h"
#include "storage/models/models.h"
#include "storage/models/repairs.h"

namespace fdi::plot {
namespace {

using storage::Episode;
using storage::HistoryEntry;

// The first faults get colours of their own; the others are grey.
constexpr std::array<const char*, 5> kFaultInks = {
    ink::kVermilion, ink::kBlue, ink::kGreen, ink::kOrange, ink::kSky};

constexpr const char* kGapInk = "#d0d0d0";

double SecondsFrom(std::int64_t stamp_ns, std::int64_t origin_ns) {
  return static_cast<double>(stamp_ns - origin_ns) * 1e-9;
}

template <typename Value>
std::vector<double> Values(const std::vector<TracePoint>& trace,
                           Value value_of) {
  std::vector<double> values;
  values.reserve(trace.size());
  std::transform(trace.begin(), trace.end(), std::back_inserter(values),
                 value_of);
  return values;
}

std::vector<double> Readings(const std::vector<TracePoint>& trace,
                             Signal signal) {
  return Values(trace, [signal](const TracePoint& instant) {
    const Sample& sample = instant.sample;
    return sample.Has(signal) ? sample[signal] : kMissing;
  });
}

std::vector<double> Residuals(const std::vector<TracePoint>& trace,
                              std::size_t channel) {
  return Values(trace, [channel](const TracePoint& instant) {
    return channel < instant.residuals.size() ? instant.residuals[channel]
                                              : kMissing;
  });
}

// ŷ = y − r of the normal observer of the channel with output `signal`.
std::vector<double> Estimates(const EpisodeEvidence& evidence,
                              const std::vector<TracePoint>& trace,
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

// Samples that the engine accepted, ordered by sampling time.
std::vector<TracePoint> Accepted(const EpisodeEvidence& evidence) {
  std::vector<TracePoint> accepted;
  std::copy_if(evidence.trace.begin(), evidence.trace.end(),
               std::back_inserter(accepted), [](const TracePoint& instant) {
                 return instant.intake == Intake::kAccepted;
               });
  std::stable_sort(accepted.begin(), accepted.end(),
                   [](const auto& a, const auto& b) {
                     return a.sample.stamp_ns < b.sample.stamp_ns;
                   });
  return accepted;
}

std::vector<double> TimesOf(const EpisodeEvidence& evidence,
                            const std::vector<TracePoint>& trace) {
  return Values(trace, [&evidence](const TracePoint& instant) {
    return SecondsFrom(instant.sample.stamp_ns, evidence.episode.detected_ns);
  });
}

// Adds a reading as simulated with the fault that explains it best.
void AddSimulated(const EpisodeEvidence& evidence,
                  const std::vector<TracePoint>& trace,
                  const std::vector<double> EpisodeLook::*column,
                  const std::string& reading, Panel& panel) {
  const std::optional<EpisodeLook>& look = evidence.look;
  if (!look || look->faults.empty()) {
    return;
  }
  panel.series.push_back(
      {reading + " simulated with " + FaultName(look->faults.front().fault),
       ink::kVermilion, 1.6, Dash::kDashDot,
       Values(trace, [&](const TracePoint& instant) {
         const auto row = look->RowAt(instant.sample.stamp_ns);
         return row ? ((*look).*column)[*row] : kMissing;
       })});
}

Panel FlowPanel(const EpisodeEvidence& evidence,
                const std::vector<TracePoint>& trace) {
  const std::string unit(FlowUnitName(evidence.episode.flow_unit));
  Panel panel{
      "flow F [" + unit + "]",
      {{"F measured", ink::kBlack, 1.6, Dash::kSolid,
        Readings(trace, Signal::kF)},
       {"F if normal", ink::kBlue, 1.6, Dash::kDashed,
        Estimates(evidence, trace, Signal::kF)}},
  };
  AddSimulated(evidence, trace, &EpisodeLook::flow, "F", panel);
  return panel;
}

bool AnyHas(const std::vector<TracePoint>& trace, Signal signal) {
  return std::ranges::any_of(trace, [signal](const TracePoint& instant) {
    return instant.sample.Has(signal);
  });
}

// Quantities that the valve moves: PV if the loop has one, else F or with it.
std::vector<Panel> AnswerPanels(const EpisodeEvidence& evidence,
                                const std::vector<TracePoint>& trace) {
  std::vector<Panel> panels;
  const bool has_pv = AnyHas(trace, Signal::kPv);
  if (has_pv) {
    panels.push_back(
        {"PV, SP [unit of PV]",
         {{"PV", ink::kBlack, 1.6, Dash::kSolid, Readings(trace, Signal::kPv)},
          {"SP", ink::kBlue, 1.6, Dash::kDashed,
           Readings(trace, Signal::kSp)}}});
  }
  if (!has_pv || AnyHas(trace, Signal::kF)) {
    panels.push_back(FlowPanel(evidence, trace));
  }
  return panels;
}

Panel TravelPanel(const EpisodeEvidence& evidence,
                  const std::vector<TracePoint>& trace) {
  Panel panel{
      "closing [%]",
      {{"command CV", ink::kGrey, 1.6, Dash::kSolid,
        Readings(trace, Signal::kCv)},
       {"X measured", ink::kBlack, 1.6, Dash::kSolid,
        Readings(trace, Signal::kX)},
       {"X if normal", ink::kBlue, 1.6, Dash::kDashed,
        Estimates(evidence, trace, Signal::kX)}},
  };
  AddSimulated(evidence, trace, &EpisodeLook::x_pct, "X", panel);
  return panel;
}

// Unit of a channel's output. Channels are named after it, followed by the
// signals that they read if there are several channels: "F", "F(CV)".
std::string_view UnitOf(const EpisodeEvidence& evidence, std::size_t channel) {
  const std::string& name = evidence.episode.channels[channel];
  const auto signal = evidence.models
                          ? evidence.models->channels[channel].output
                          : ParseSignal(name.substr(0, name.find('(')));
  return !signal                 ? ""
         : *signal == Signal::kF ? FlowUnitName(evidence.episode.flow_unit)
                                 : SignalUnit(*signal);
}

std::string LabelOf(const EpisodeEvidence& evidence, std::size_t channel) {
  return "residual of " + evidence.episode.channels[channel] + " [" +
         std::string(UnitOf(evidence, channel)) + "]";
}

Panel ResidualPanel(const EpisodeEvidence& evidence,
                    const std::vector<TracePoint>& trace, std::size_t channel) {
  Panel panel{LabelOf(evidence, channel)};
  panel.series = {{"measured − normal", ink::kBlack, 1.4, Dash::kSolid,
                   Residuals(trace, channel)}};
  if (evidence.models) {
    const ChannelSpec& spec = evidence.models->channels[channel];
    panel.limits = {{spec.upper_threshold, "thresholds", ink::kPurple},
                    {spec.lower_threshold, "", ink::kPurple}};
  }
  return panel;
}

// One window of a channel over the trace, as Detection computes it.
struct WindowTrace {
  std::size_t channel{0};
  const WindowLimits* limits{nullptr};
  std::vector<double> mean;
  std::vector<double> deviation;
  std::vector<double> upper_deviation;  // It depends on the motion of CV.
  std::vector<bool> mean_beyond;
  std::vector<bool> deviation_beyond;
};

// Recomputes the windows of all channels, because the trace does not contain
// them. Only LIVE samples count. The trace begins half an hour before the
// detection, so windows of up to 200 samples are full by then.
std::vector<WindowTrace> ComputeWindows(const ModelSet& models,
                                        const std::vector<TracePoint>& trace) {
  std::vector<WindowTrace> traces;
  for (std::size_t c = 0; c < models.channels.size(); ++c) {
    for (const WindowLimits& limits : models.channels[c].windows) {
      traces.push_back({c, &limits, {}, {}, {}, {}, {}});
    }
  }
  ResidualWindows windows(models);
  for (const TracePoint& instant : trace) {
    const Sample& sample = instant.sample;
    const bool live = instant.quality == Quality::kLive &&
                      instant.residuals.size() == models.channels.size();
    if (live) {
      windows.Push(instant.residuals,
                   sample.Has(Signal::kCv) ? sample[Signal::kCv] : kMissing);
    }
    // `index` counts the windows within a channel: the traces are ordered by
    // channel.
    std::size_t index = 0;
    for (std::size_t i = 0; i < traces.size(); ++i) {
      WindowTrace& out = traces[i];
      index = i > 0 && traces[i - 1].channel == out.channel ? index + 1 : 0;
      const ResidualWindow& window = windows.window(out.channel, index);
      const ResidualWindow& command = windows.command(out.channel, index);
      const bool applies = live && Applies(*out.limits, window, command);
      const double upper = UpperLogRms(*out.limits, command);
      // A window is shown wherever it has a value, and counts as beyond only
      // where its limits apply, as in Detection.
      out.mean.push_back(live ? window.mean() : kMissing);
      out.deviation.push_back(live ? std::exp(window.log_rms()) : kMissing);
      out.upper_deviation.push_back(applies ? std::exp(upper) : kMissing);
      out.mean_beyond.push_back(applies &&
                                (window.mean() < out.limits->lower_mean ||
                                 window.mean() > out.limits->upper_mean));
      out.deviation_beyond.push_back(applies && window.log_rms() > upper);
    }
  }
  return traces;
}

// The windows whose limits were exceeded by the n_d samples that made the
// detection, with their limits. None if single residuals made it.
std::vector<Panel> WindowPanels(const EpisodeEvidence& evidence,
                                const std::vector<TracePoint>& trace) {
  std::vector<Panel> panels;
  // detected_ns is the stamp of the first abnormal sample. The detection took
  // it and the n_d - 1 samples after it, all beyond the same limit
  // (docs/method.md, (1)).
  const auto first = static_cast<std::size_t>(std::distance(
      trace.begin(),
      std::find_if(trace.begin(), trace.end(), [&](const auto& t) {
        return t.sample.stamp_ns >= evidence.episode.detected_ns;
      })));
  const auto needed = static_cast<std::size_t>(
      std::max(1, evidence.models->decision.detection_samples));
  if (first + needed > trace.size()) {
    return panels;
  }
  const auto made_detection = [&](const std::vector<bool>& beyond) {
    const auto from = beyond.begin() + static_cast<std::ptrdiff_t>(first);
    return std::all_of(from, from + static_cast<std::ptrdiff_t>(needed),
                       [](bool is_beyond) { return is_beyond; });
  };
  const std::vector<double> x = TimesOf(evidence, trace);
  for (const WindowTrace& w : ComputeWindows(*evidence.models, trace)) {
    const std::string samples = std::to_string(w.limits->length) + " samples";
    if (made_detection(w.mean_beyond)) {
      Panel panel{LabelOf(evidence, w.channel)};
      panel.series = {
          {"mean over " + samples, ink::kBlack, 1.4, Dash::kSolid, w.mean, x}};
      panel.limits = {{w.limits->upper_mean, "limits of the mean"},
                      {w.limits->lower_mean, ""}};
      panels.push_back(std::move(panel));
    }
    if (made_detection(w.deviation_beyond)) {
      Panel panel{LabelOf(evidence, w.channel)};
      panel.series = {{"deviation of " + samples, ink::kBlack, 1.4,
                       Dash::kSolid, w.deviation, x},
                      {"its limit", ink::kPurple, 1.4, Dash::kDashDot,
                       w.upper_deviation, x}};
      panels.push_back(std::move(panel));
    }
  }
  return panels;
}

// Isolated faults first, then by largest factor.
std::vector<std::size_t> ByWeight(const Episode& episode,
                                  const std::vector<std::vector<double>>& d) {
  const auto greatest = [&](std::size_t f) {
    // A factor is at most 1, so isolated faults rank before all others.
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

Panel FactorPanel(const EpisodeEvidence& evidence,
                  const std::vector<TracePoint>& trace) {
  const Episode& episode = evidence.episode;
  Panel panel{"decision factor d [-]"};
  panel.range = Range{-0.05, 1.05};
  if (evidence.models) {
    panel.limits = {{evidence.models->decision.isolation_threshold,
                     "threshold T", ink::kPurple}};
  }
  // Factors are shown from the detection on: before it, a fault that looks
  // normal also has a factor near 1.
  std::vector<std::vector<double>> factors;
  for (std::size_t f = 0; f < episode.faults.size(); ++f) {
    factors.push_back(Values(trace, [f](const TracePoint& instant) {
      return instant.state != State::kNormal && f < instant.factors.size()
                 ? instant.factors[f]
                 : kMissing;
    }));
  }
  const auto order = ByWeight(episode, factors);
  for (std::size_t i = order.size(); i-- > 0;) {  // The most important on top.
    const std::size_t f = order[i];
    const bool isolated = (episode.fault_bits >> f & 1U) != 0;
    const bool coloured = i < kFaultInks.size();
    panel.series.push_back(
        {coloured ? episode.faults[f] + (isolated ? " (isolated)" : "") : "",
         coloured ? kFaultInks[i] : ink::kPale, isolated ? 3.0 : 1.2,
         isolated ? Dash::kSolid : Dash::kDashDot, std::move(factors[f])});
  }
  std::reverse(panel.series.begin(), panel.series.end());
  panel.series.push_back({"normal (d_0)", ink::kBlack, 1.8, Dash::kDashed,
                          Values(trace, [](const TracePoint& instant) {
                            return instant.normal_factor;
                          })});
  return panel;
}

// Text and colour of a mark; empty text for events without one.
std::pair<std::string, const char*> MarkOf(const HistoryEntry& event) {
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

// An episode is dated back to its first abnormal sample ("start"). The engine
// opens it some samples later ("detected").
std::vector<Mark> Marks(const EpisodeEvidence& evidence) {
  const std::int64_t origin_ns = evidence.episode.detected_ns;
  std::vector<Mark> marks = {{0.0, "start", ink::kVermilion}};
  const auto detected =
      std::find_if(evidence.trace.begin(), evidence.trace.end(),
                   [origin_ns](const TracePoint& instant) {
                     return instant.sample.stamp_ns >= origin_ns &&
                            instant.state != State::kNormal;
                   });
  if (detected != evidence.trace.end()) {
    marks.push_back({SecondsFrom(detected->sample.stamp_ns, origin_ns),
                     "detected", ink::kVermilion});
  }
  for (const HistoryEntry& event : evidence.events) {
    const auto [text, colour] = MarkOf(event);
    if (!text.empty()) {
      marks.push_back({SecondsFrom(event.stamp_ns, origin_ns), text, colour});
    }
  }
  for (const storage::ValveEvent& repair : evidence.repairs) {
    if (repair.kind != storage::ValveEventKind::kOrdered) {
      marks.push_back({SecondsFrom(repair.at_ns, origin_ns),
                       std::string(ValveEventKindName(repair.kind)),
                       ink::kGreen});
    }
  }
  return marks;
}

// The trace's own gaps, each with the reason that the history gives for it: a
// monitor that was started again says nothing either until it has settled.
std::vector<Band> Gaps(const EpisodeEvidence& evidence,
                       const std::vector<TracePoint>& trace) {
  constexpr double kPeriods = 3.0;  // As on the page.
  const std::vector<double> t_s = TimesOf(evidence, trace);
  std::vector<double> steps;
  std::adjacent_difference(t_s.begin(), t_s.end(), std::back_inserter(steps));
  double longest = std::numeric_limits<double>::infinity();
  if (steps.size() > 1) {
    const auto middle =
        steps.begin() + static_cast<std::ptrdiff_t>((steps.size() + 1) / 2);
    std::nth_element(steps.begin() + 1, middle, steps.end());
    longest = std::max(kPeriods * *middle, 2.5);
  }
  std::vector<Band> gaps;
  for (std::size_t i = 1; i < t_s.size(); ++i) {
    if (t_s[i] - t_s[i - 1] > longest) {
      gaps.push_back({t_s[i - 1], t_s[i], "no samples", kGapInk});
    }
  }
  const auto found = static_cast<std::ptrdiff_t>(gaps.size());
  for (const DataGap& gap : evidence.gaps) {
    const std::int64_t origin_ns = evidence.episode.detected_ns;
    const Band said{SecondsFrom(gap.from_ns, origin_ns),
                    SecondsFrom(gap.to_ns, origin_ns), gap.reason, kGapInk};
    const auto same = std::find_if(
        gaps.begin(), gaps.begin() + found, [&said](const Band& band) {
          return said.from < band.to && said.to > band.from;
        });
    if (same == gaps.begin() + found) {
      gaps.push_back(said);
    } else {
      same->text = said.text;
    }
  }
  return gaps;
}

// Periods in which the engine did not decide, and gaps in the record.
std::vector<Band> Bands(const EpisodeEvidence& evidence,
                        const std::vector<TracePoint>& trace) {
  const std::int64_t origin_ns = evidence.episode.detected_ns;
  std::vector<Band> bands;
  for (std::size_t i = 0; i < trace.size(); ++i) {
    if (trace[i].quality == Quality::kLive) {
      continue;
    }
    const std::string name(QualityName(trace[i].quality));
    const double t_s = SecondsFrom(trace[i].sample.stamp_ns, origin_ns);
    const bool goes_on = i > 0 && trace[i - 1].quality == trace[i].quality;
    if (!goes_on) {
      bands.push_back({t_s, t_s, name, "#efefef"});
    }
    // A quality holds until the next sample; the last one has none behind it.
    bands.back().to = i + 1 < trace.size()
                          ? SecondsFrom(trace[i + 1].sample.stamp_ns, origin_ns)
                          : t_s;
  }
  std::ranges::move(Gaps(evidence, trace), std::back_inserter(bands));
  return bands;
}

std::string Subtitle(const Episode& e) {
  char strength[32];
  std::snprintf(strength, sizeof strength, "%.2f", e.strength);
  return "detected " + e.detected_utc +
         (e.isolated_ns ? ",  strength " + std::string(strength) : "") +
         ",  model set " + e.model_set + " (" +
         storage::EpisodeIdText(e.model_hash) + "),  episode " + e.episode_id;
}

}  // namespace

EpisodeEvidence LoadEvidence(storage::History& history, std::string_view id,
                             const std::filesystem::path& models_path) {
  EpisodeEvidence evidence;
  evidence.episode = history.Show(id);
  const Episode& episode = evidence.episode;
  evidence.events = history.Events(episode.id);
  evidence.trace = history.Trace(episode.id);
  evidence.look = history.Look(episode.id);
  if (!evidence.trace.empty()) {
    storage::EpisodeFilter filter;
    filter.since_ns = evidence.trace.front().sample.stamp_ns;
    filter.until_ns = evidence.trace.back().sample.stamp_ns + 1;
    evidence.gaps = history.Gaps(filter);
    // A gap without a valve is one of all valves.
    std::erase_if(evidence.gaps, [&episode](const DataGap& gap) {
      return !gap.valve_id.empty() && gap.valve_id != episode.valve_id;
    });
  }
  if (std::filesystem::exists(models_path)) {
    try {
      storage::ModelStore store(models_path);
      evidence.repairs = storage::RepairsOf(store, episode.valve_id);
      ModelSet models = store.Load(episode.model_set);
      // NAME@VERSION does not identify a set across databases, and the
      // thresholds of another set would explain the alarm wrongly. The content
      // hash does.
      if (models.content_hash == episode.model_hash &&
          models.channels.size() == episode.channels.size()) {
        evidence.models = std::move(models);
      }
    } catch (const NotFoundError&) {  // It may be from elsewhere,
    } catch (const DataError&) {      // or in an older format.
    }
  }
  return evidence;
}

Figure EpisodeFigure(const EpisodeEvidence& evidence,
                     const EpisodeFigureOptions& options) {
  const Episode& episode = evidence.episode;
  const std::vector<TracePoint> accepted = Accepted(evidence);
  // Windows are computed from all accepted samples, because their memory
  // reaches back beyond what is shown.
  std::vector<TracePoint> trace = accepted;
  std::erase_if(trace, [&](const TracePoint& instant) {
    const double t_s =
        SecondsFrom(instant.sample.stamp_ns, episode.detected_ns);
    return t_s < options.from_s || t_s > options.to_s;
  });
  Figure figure;
  figure.title = episode.valve_id + ":  " +
                 (IsNamed(episode) ? *episode.fault + "  " + options.fault_name
                                   : options.fault_name);
  figure.subtitle = Subtitle(episode);
  figure.is_time = true;
  figure.x = TimesOf(evidence, trace);
  if (!figure.x.empty()) {
    figure.x_range = Range{figure.x.front(),
                           std::max(figure.x.back(), figure.x.front() + 1e-3)};
  }
  // Beyond a day, from the first abnormal sample on.
  const bool is_clock =
      figure.x_range &&
      figure.x_range->to - figure.x_range->from < 1e-9 * kNsPerDay;
  figure.x_label = is_clock ? "UTC of " + episode.detected_utc.substr(0, 10)
                            : "time from the first abnormal sample";
  if (is_clock) {
    figure.clock_s = SecondsFrom(episode.detected_ns % kNsPerDay, 0);
  }
  figure.gap = evidence.models ? 1.5 * evidence.models->sample_period_s : 1.5;
  figure.panels = AnswerPanels(evidence, trace);
  figure.panels.push_back(TravelPanel(evidence, trace));
  for (std::size_t c = 0; c < episode.channels.size(); ++c) {
    figure.panels.push_back(ResidualPanel(evidence, trace, c));
  }
  if (evidence.models) {
    const std::vector<Panel> windows = WindowPanels(evidence, accepted);
    figure.panels.insert(figure.panels.end(), windows.begin(), windows.end());
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

}  // namespace fdi::plot
