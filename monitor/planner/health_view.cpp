#include "monitor/planner/health_view.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "diagnosis/fault_catalogue.h"
#include "storage/cli/text_table.h"
#include "storage/cli/time_text.h"
#include "storage/history_types.h"

namespace fdi::planner {
namespace {

using cli::Json;

constexpr std::int64_t kNsPerMs = 1'000'000;
constexpr std::int64_t kMsPerHour = 3'600'000;
constexpr double kFullStroke = 100.0;  // [%]

// Six digits that count; null if it is not finite.
Json Number(double value) {
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

double Hours(std::int64_t ms) {
  return static_cast<double>(ms) / static_cast<double>(kMsPerHour);
}

double Strokes(std::int64_t travel) {
  return static_cast<double>(travel) * HealthHour::kTravel / kFullStroke;
}

std::string UnitOf(const HealthHour& hour, Signal signal) {
  return std::string(signal == Signal::kF ? FlowUnitName(hour.flow_unit)
                                          : SignalUnit(signal));
}

Json BinsJson(const HealthHour& hour, std::size_t c) {
  Json bins = Json::array();
  const double quantum = hour.channels[c].quantum();
  for (std::size_t b = 0; b < hour.bins.size(); ++b) {
    if (c >= hour.bins[b].size() || hour.bins[b][c].samples == 0) {
      continue;
    }
    const ResidualSums& sums = hour.bins[b][c];
    const auto n = static_cast<double>(sums.samples);
    bins.push_back(
        {{"cv_from", b * 100 / kCommandBins},
         {"cv_to", (b + 1) * 100 / kCommandBins},
         {"samples", sums.samples},
         {"mean", Number(static_cast<double>(sums.residual) / n * quantum)},
         {"rms",
          Number(std::sqrt(static_cast<double>(sums.square) / n) * quantum)}});
  }
  return bins;
}

Json ChannelsJson(const HealthHour& hour) {
  Json channels = Json::array();
  for (std::size_t c = 0; c < hour.channels.size(); ++c) {
    const ChannelFigures figures = FiguresOf(hour, c);
    const Signal signal = hour.channels[c].output;
    channels.push_back({{"signal", std::string(SignalName(signal))},
                        {"unit", UnitOf(hour, signal)},
                        {"mean", Number(figures.mean)},
                        {"rms", Number(figures.rms)},
                        {"percent", Number(figures.percent)},
                        {"bins", BinsJson(hour, c)}});
  }
  return channels;
}

Json StrengthsJson(const HealthHour& hour) {
  Json strengths = Json::array();
  for (const StrengthSums& sums : hour.strengths) {
    strengths.push_back(
        {{"fault", FaultName(sums.fault)},
         {"strength",
          Number(static_cast<double>(sums.strength) * HealthHour::kShare /
                 static_cast<double>(sums.samples))},
         {"samples", sums.samples}});
  }
  return strengths;
}

std::string DayText(double day) {
  return cli::FormatTime(
             static_cast<std::int64_t>(day) * 24 * kMsPerHour * kNsPerMs, true)
      .substr(0, 10);
}

Json RowJson(const WorkRow& row) {
  const FaultReason* fault =
      row.work.faults.empty() ? nullptr : &row.work.faults.front();
  const auto of_fault = [fault](auto value) {
    return fault != nullptr ? Json(value(*fault)) : Json();
  };
  Json trends = Json::array();
  for (const TrendReason& reason : row.work.trends) {
    trends.push_back(ForecastJson(reason));
  }
  return {{"rank", row.rank},
          {"valve", row.work.valve_id},
          {"score", Number(row.score)},
          {"why", row.why},
          {"fault", of_fault([](auto& f) { return f.fault; })},
          {"name", of_fault([](auto& f) { return f.words.name; })},
          {"discipline", of_fault([](auto& f) { return f.words.discipline; })},
          {"namur", of_fault([](auto& f) {
             return std::string(NamurName(f.words.namur));
           })},
          {"severity", of_fault([](auto& f) {
             return std::string(SeverityName(f.words.severity));
           })},
          {"check", of_fault([](auto& f) { return f.words.check; })},
          {"strength", of_fault([](auto& f) { return Number(f.strength); })},
          {"open", of_fault([](auto& f) { return !f.ended_ns.has_value(); })},
          {"episodes", of_fault([](auto& f) { return f.episodes; })},
          {"episode", of_fault([](auto& f) { return f.episode_id; })},
          {"detected_ms",
           of_fault([](auto& f) { return f.detected_ns / kNsPerMs; })},
          {"confirmed", of_fault([](auto& f) { return f.confirmed; })},
          {"trends", trends},
          {"travel_strokes", Number(row.work.travel_strokes)},
          {"service_hours", Number(row.work.service_hours)},
          {"live_share", Number(row.work.live_share)},
          {"last_ms",
           row.work.last_ns ? Json(*row.work.last_ns / kNsPerMs) : Json()}};
}

}  // namespace

Json ForecastJson(const TrendReason& reason) {
  const monitor::HealthForecast& f = reason.forecast;
  const auto number = [](const std::optional<double>& value) {
    return value ? Number(*value) : Json();
  };
  const auto of_time = [&f](double monitor::TimeToLimit::*part) {
    return f.time ? Number(*f.time.*part) : Json();
  };
  const bool any = f.days > 0;
  return {{"limit", HealthLimitText(reason.limit)},
          {"unit", HealthUnit(reason.limit, reason.flow_unit)},
          {"answer", std::string(AnswerName(f.answer))},
          {"text", ForecastText(f)},
          {"now", number(f.now)},
          {"per_day", number(f.slope)},
          {"days", of_time(&monitor::TimeToLimit::days)},
          {"lower_days", of_time(&monitor::TimeToLimit::lower)},
          {"upper_days", of_time(&monitor::TimeToLimit::upper)},
          {"from_day", any ? Json(DayText(f.first_day)) : Json()},
          {"to_day", any ? Json(DayText(f.last_day)) : Json()},
          {"rests_on_days", f.days}};
}

Json WorkListJson(std::span<const WorkRow> rows) {
  Json list = Json::array();
  for (const WorkRow& row : rows) {
    list.push_back(RowJson(row));
  }
  return {{"rows", list}};
}

ChannelFigures FiguresOf(const HealthHour& hour, std::size_t c) {
  ResidualSums sums;
  for (const auto& bin : hour.bins) {
    if (c < bin.size()) {
      sums.Add(bin[c]);
    }
  }
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  if (sums.samples == 0) {
    return {kNan, kNan, kNan, 0};
  }
  const double quantum = hour.channels[c].quantum();
  const auto n = static_cast<double>(sums.samples);
  const auto residual = static_cast<double>(sums.residual);
  const double expected = static_cast<double>(sums.output) - residual;
  return {residual / n * quantum,
          std::sqrt(static_cast<double>(sums.square) / n) * quantum,
          expected != 0.0 ? 100.0 * residual / expected : kNan, sums.samples};
}

double NormalFactorOf(const HealthHour& hour) {
  return hour.live_samples == 0
             ? std::numeric_limits<double>::quiet_NaN()
             : static_cast<double>(hour.normal_factor) * HealthHour::kShare /
                   static_cast<double>(hour.live_samples);
}

Json HealthHoursJson(std::span<const HealthHour> hours) {
  Json list = Json::array();
  for (const HealthHour& hour : hours) {
    list.push_back({{"hour_ms", hour.hour * kMsPerHour},
                    {"epoch", hour.epoch},
                    {"model_hash", storage::EpisodeIdText(hour.model_hash)},
                    {"seen_h", Number(Hours(hour.seen_ms))},
                    {"live_h", Number(Hours(hour.live_ms))},
                    {"alarm_h", Number(Hours(hour.alarm_ms))},
                    {"open_h", Number(Hours(hour.open_ms))},
                    {"shut_h", Number(Hours(hour.shut_ms))},
                    {"d0", Number(NormalFactorOf(hour))},
                    {"travel_strokes", Number(Strokes(hour.travel))},
                    {"reversals", hour.reversals},
                    {"channels", ChannelsJson(hour)},
                    {"strengths", StrengthsJson(hour)}});
  }
  return {{"hours", list}};
}

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
    } else {
      days.push_back(std::move(hour));
    }
  }
  return days;
}

}  // namespace fdi::planner
