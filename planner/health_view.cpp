#include "planner/health_view.h"

#include <algorithm>
#include <cmath>

#include "base/time_text.h"
#include "base/time_units.h"
#include "diagnosis/model/fault_catalogue.h"
#include "storage/history/episode.h"
#include "storage/history/history_database.h"

namespace fdi::planner {
namespace {

using report::Json;

Json Hours(std::int64_t ms) {
  return SixDigits(static_cast<double>(ms) / kMsPerHour);
}

// The sums are integers in units of `quantum`, so that parts of an hour add up
// exactly across restarts; only here they are converted to the channel's unit.
Json MeanOf(const ResidualSums& sums, double quantum) {
  return SixDigits(static_cast<double>(sums.residual) /
                   static_cast<double>(sums.samples) * quantum);
}
Json RmsOf(const ResidualSums& sums, double quantum) {
  return SixDigits(std::sqrt(static_cast<double>(sums.square) /
                             static_cast<double>(sums.samples)) *
                   quantum);
}

Json ChannelJson(const HealthHour& hour, std::size_t c) {
  const Signal signal = hour.channels[c].output;
  const double quantum = hour.channels[c].quantum();
  ResidualSums all;
  Json bins = Json::array();
  for (std::size_t b = 0; b < hour.bins.size(); ++b) {
    if (c >= hour.bins[b].size() || hour.bins[b][c].samples == 0) {
      continue;
    }
    const ResidualSums& sums = hour.bins[b][c];
    all.Add(sums);
    bins.push_back({{"cv_from", b * 100 / kCommandBins},
                    {"cv_to", (b + 1) * 100 / kCommandBins},
                    {"samples", sums.samples},
                    {"mean", MeanOf(sums, quantum)},
                    {"rms", RmsOf(sums, quantum)}});
  }
  // The measured output minus the residual is what the normal model expected.
  // Its sum and the number of samples may be 0: 0/0 is not finite and becomes
  // null.
  const auto residual = static_cast<double>(all.residual);
  const double expected = static_cast<double>(all.output) - residual;
  return {
      {"signal", std::string(SignalName(signal))},
      {"unit", std::string(signal == Signal::kF ? FlowUnitName(hour.flow_unit)
                                                : SignalUnit(signal))},
      {"mean", MeanOf(all, quantum)},
      {"rms", RmsOf(all, quantum)},
      {"percent", SixDigits(100.0 * residual / expected)},
      {"bins", std::move(bins)}};
}

// In full strokes.
Json Strokes(std::int64_t travel) {
  return SixDigits(static_cast<double>(travel) * HealthHour::kTravel /
                   HealthHour::kFullStroke);
}

// The figures, and the status that follows from them and from what was
// isolated.
void AddFigures(const HealthHour& hour, const report::FaultTexts& texts,
                Json& json) {
  std::optional<report::NamurClass> status;
  Json exceeded = Json::array();
  for (std::size_t i = 0; i < loop::kFigureCount; ++i) {
    const auto figure = static_cast<loop::Figure>(i);
    const std::string name(loop::FigureName(figure));
    const auto value = loop::FigureOf(figure, hour.counts, hour.seen_ms);
    json[name] = value ? SixDigits(*value) : Json();
    if (const auto& text = texts.Of(figure); value && text.Exceeded(*value)) {
      exceeded.push_back(name);
      status = std::max(status, std::optional(text.namur));
    }
  }
  for (const StrengthSums& sums : hour.strengths) {
    status = std::max(status, std::optional(texts.Of(sums.fault).namur));
  }
  json["exceeded"] = std::move(exceeded);
  json["status"] = std::string(report::StatusName(status));
}

Json HourJson(const HealthHour& hour, const report::FaultTexts& texts) {
  Json channels = Json::array();
  for (std::size_t c = 0; c < hour.channels.size(); ++c) {
    channels.push_back(ChannelJson(hour, c));
  }
  Json strengths = Json::array();
  for (const StrengthSums& sums : hour.strengths) {
    const double mean =
        static_cast<double>(sums.strength) / static_cast<double>(sums.samples);
    strengths.push_back({{"fault", FaultName(sums.fault)},
                         {"strength", SixDigits(mean * HealthHour::kShare)},
                         {"samples", sums.samples}});
  }
  const double normal_factor = static_cast<double>(hour.normal_factor) /
                               static_cast<double>(hour.live_samples);
  Json json{{"hour_utc", FormatTime(hour.hour * kNsPerHour, true)},
            {"epoch", hour.epoch},
            {"model_hash", storage::EpisodeIdText(hour.model_hash)},
            {"seen_h", Hours(hour.seen_ms)},
            {"live_h", Hours(hour.live_ms)},
            {"alarm_h", Hours(hour.alarm_ms)},
            {"auto_h", Hours(hour.counts.auto_ms)},
            {"open_h", Hours(hour.open_ms)},
            {"shut_h", Hours(hour.shut_ms)},
            {"d0", SixDigits(normal_factor * HealthHour::kShare)},
            {"travel_strokes", Strokes(hour.travel)},
            {"path_strokes", Strokes(hour.counts.path)},
            {"reversals", hour.reversals},
            {"slip_jumps", hour.counts.slips},
            {"turns", hour.counts.turns},
            {"steps", hour.counts.steps},
            {"channels", std::move(channels)},
            {"strengths", std::move(strengths)}};
  AddFigures(hour, texts, json);
  if (!hour.monitor.empty()) {
    json.update({{"host", hour.host}, {"monitor", hour.monitor}});
  }
  return json;
}

std::string DayText(double day) {
  return FormatTime(static_cast<std::int64_t>(day) * 24 * kNsPerHour, true)
      .substr(0, 10);
}

Json TrendJson(const LimitTrend& trend) {
  const HealthForecast& f = trend.forecast;
  const auto number = [](const std::optional<double>& value) {
    return value ? SixDigits(*value) : Json();
  };
  const auto of_time = [&f](double TimeToLimit::*part) {
    return f.time ? SixDigits(*f.time.*part) : Json();
  };
  const bool any = f.days > 0;
  return {{"limit", HealthLimitText(trend.limit)},
          {"unit", HealthUnit(trend.limit, trend.flow_unit)},
          {"answer", std::string(AnswerName(f.answer))},
          {"text", ForecastText(f)},
          {"now", number(f.now)},
          {"per_day", number(f.slope)},
          {"days", of_time(&TimeToLimit::days)},
          {"lower_days", of_time(&TimeToLimit::lower)},
          {"upper_days", of_time(&TimeToLimit::upper)},
          {"from_day", any ? Json(DayText(f.first_day)) : Json()},
          {"to_day", any ? Json(DayText(f.last_day)) : Json()},
          {"rests_on_days", f.days}};
}

}  // namespace

Json SixDigits(double value) {
  if (!std::isfinite(value)) {
    return nullptr;
  }
  if (value == 0.0) {
    return 0.0;
  }
  const double scale =
      std::pow(10.0, 5.0 - std::floor(std::log10(std::abs(value))));
  return std::round(value * scale) / scale;
}

std::vector<HealthLimit> DefaultLimits() {
  return ParseLimits({"F=-10%", "F=10%"});
}

std::vector<HealthLimit> ParseLimits(const std::vector<std::string>& texts) {
  if (texts.empty()) {
    return DefaultLimits();
  }
  std::vector<HealthLimit> limits;
  for (const std::string& text : texts) {
    limits.push_back(ParseHealthLimit(text));
  }
  return limits;
}

std::vector<LimitTrend> TrendsOf(std::span<const HealthHour> hours,
                                 const std::vector<HealthLimit>& limits) {
  std::vector<LimitTrend> trends;
  for (const HealthLimit& limit : limits) {
    const HealthSeries series = SeriesOf(hours, limit);
    trends.push_back({limit, Forecast(series, limit), series.flow_unit});
  }
  return trends;
}

Json TrendsJson(std::span<const LimitTrend> trends) {
  Json list = Json::array();
  for (const LimitTrend& trend : trends) {
    list.push_back(TrendJson(trend));
  }
  return list;
}

Json HealthHoursJson(std::span<const HealthHour> hours,
                     const report::FaultTexts& texts) {
  Json list = Json::array();
  for (const HealthHour& hour : hours) {
    list.push_back(HourJson(hour, texts));
  }
  return list;
}

// Days are those of UTC, also before 1970, hence the second remainder. Hours of
// another model set, epoch or list of channels stay apart, because their
// residuals do not add up.
std::vector<HealthHour> DaysOf(std::span<const HealthHour> hours) {
  std::vector<HealthHour> days;
  for (HealthHour hour : hours) {
    hour.hour -= ((hour.hour % 24) + 24) % 24;
    const auto place = std::find_if(
        days.rbegin(), days.rend(), [&hour](const HealthHour& day) {
          return day.SameKey(hour) && day.channels == hour.channels;
        });
    if (place != days.rend()) {
      place->Add(hour);
      place->host = hour.host;
      place->monitor = hour.monitor;
    } else {
      days.push_back(std::move(hour));
    }
  }
  return days;
}

}  // namespace fdi::planner
