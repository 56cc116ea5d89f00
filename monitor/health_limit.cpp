// How limits and forecasts are written.
#include <array>
#include <charconv>
#include <cmath>

#include "diagnosis/error.h"
#include "diagnosis/fault_catalogue.h"
#include "monitor/health_series.h"

namespace fdi::monitor {
namespace {

using Kind = HealthLimit::Kind;
using Answer = HealthForecast::Answer;

constexpr std::array<std::string_view, 6> kAnswers{
    "time", "reached", "away", "no_trend", "outside", "too_few"};

[[noreturn]] void Refuse(std::string_view text, const std::string& reason) {
  throw ConfigError(
      "limit '" + std::string(text) + "': " + reason +
      "; accepted are SIGNAL=VALUE in its unit (X=3), SIGNAL=PERCENT% of what "
      "is expected (F=-10%), FAULT=STRENGTH in -1..1 (f19=0.5), "
      "travel=STROKES, reversals=NUMBER");
}

std::string NumberText(double value) {
  char text[400];
  const auto end =
      std::to_chars(text, text + sizeof text, value, std::chars_format::fixed);
  return {text, end.ptr};
}

std::string DaysText(double days) {
  if (!std::isfinite(days)) {
    return "never";
  }
  return std::to_string(std::llround(days));
}

void SetName(std::string_view text, std::string_view name, bool percent,
             HealthLimit& limit) {
  if (name == "travel" || name == "reversals") {
    limit.kind = name == "travel" ? Kind::kTravel : Kind::kReversals;
  } else if (const auto fault = ParseFault(name)) {
    limit.kind = Kind::kStrength;
    limit.fault = *fault;
  } else if (const auto signal = ParseSignal(name)) {
    limit.kind = percent ? Kind::kDeviation : Kind::kResidual;
    limit.signal = *signal;
  } else {
    Refuse(text, "'" + std::string(name) + "' is no signal and no fault");
  }
  if (percent && limit.kind != Kind::kDeviation) {
    Refuse(text, "only signals have a limit in %");
  }
}

}  // namespace

HealthLimit ParseHealthLimit(std::string_view text) {
  const std::size_t sign = text.find('=');
  if (sign == std::string_view::npos) {
    Refuse(text, "'=' is missing");
  }
  std::string_view number = text.substr(sign + 1);
  const bool percent = number.ends_with('%');
  number.remove_suffix(percent ? 1 : 0);
  HealthLimit limit;
  const auto [end, error] = std::from_chars(
      number.data(), number.data() + number.size(), limit.value);
  if (error != std::errc{} || end != number.data() + number.size() ||
      !std::isfinite(limit.value) || limit.value == 0.0) {
    Refuse(text, "'" + std::string(number) + "' is no number other than 0");
  }
  SetName(text, text.substr(0, sign), percent, limit);
  if (limit.cumulative() && limit.value < 0.0) {
    Refuse(text, "it only grows");
  }
  if (limit.kind == Kind::kStrength && std::abs(limit.value) > 1.0) {
    Refuse(text, "a strength is in -1..1");
  }
  return limit;
}

std::string HealthLimitText(const HealthLimit& limit) {
  const std::string value = "=" + NumberText(limit.value);
  switch (limit.kind) {
    case Kind::kResidual:
      return std::string(SignalName(limit.signal)) + value;
    case Kind::kDeviation:
      return std::string(SignalName(limit.signal)) + value + "%";
    case Kind::kStrength:
      return FaultName(limit.fault) + value;
    case Kind::kTravel:
      return "travel" + value;
    case Kind::kReversals:
      return "reversals" + value;
  }
  return {};
}

std::string HealthUnit(const HealthLimit& limit, FlowUnit flow_unit) {
  switch (limit.kind) {
    case Kind::kResidual:
      return std::string(limit.signal == Signal::kF ? FlowUnitName(flow_unit)
                                                    : SignalUnit(limit.signal));
    case Kind::kDeviation:
      return "%";
    case Kind::kTravel:
      return "strokes";
    case Kind::kStrength:
    case Kind::kReversals:
      return "";
  }
  return {};
}

std::string_view AnswerName(HealthForecast::Answer answer) {
  return kAnswers[static_cast<std::size_t>(answer)];
}

std::string ForecastText(const HealthForecast& forecast) {
  switch (forecast.answer) {
    case Answer::kTime:
      return "limit in " + DaysText(forecast.time->days) +
             " days (90 %: " + DaysText(forecast.time->lower) + ".." +
             DaysText(forecast.time->upper) + ")";
    case Answer::kReached:
      return "limit reached";
    case Answer::kAway:
      return "moves away from the limit";
    case Answer::kNoTrend:
      return "no significant trend";
    case Answer::kOutside:
      return "outside what was trained";
    case Answer::kTooFew:
      return "too few days: " + std::to_string(forecast.days) + " of " +
             std::to_string(kTrendDays);
  }
  return {};
}

}  // namespace fdi::monitor
