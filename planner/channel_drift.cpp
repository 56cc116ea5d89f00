#include "planner/channel_drift.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "base/time_text.h"
#include "base/time_units.h"
#include "planner/health_series.h"
#include "report/text_table.h"

namespace fdi::planner {
namespace {

constexpr std::array kSpansH{24.0, 72.0, 168.0, 720.0};
constexpr double kLeastSpanH = 20.0;
constexpr double kLeastRise = 0.5;  // deviations of the single residual

// Sums of squares about the line, and about the means before and after the step
// that leaves least.
bool IsLineRatherThanStep(std::span<const DailyValue> values,
                          const TrendLine& line) {
  double sum = 0.0;
  double square = 0.0;
  double about_line = 0.0;
  for (const DailyValue& value : values) {
    const double r = value.value - line.At(value.day);
    sum += value.value;
    square += value.value * value.value;
    about_line += r * r;
  }
  double about_step = std::numeric_limits<double>::infinity();
  double before = 0.0;
  for (std::size_t i = 1; i < values.size(); ++i) {
    before += values[i - 1].value;
    const auto left = static_cast<double>(i);
    const auto right = static_cast<double>(values.size() - i);
    const double after = sum - before;
    about_step = std::min(
        about_step, square - before * before / left - after * after / right);
  }
  return about_line < about_step;
}

// With two significant digits.
std::string SizeText(double value) {
  const double size = std::abs(value);
  const double digits = size > 0.0 ? 1.0 - std::floor(std::log10(size)) : 0.0;
  return report::FormatNumber(size,
                              static_cast<int>(std::clamp(digits, 0.0, 6.0)));
}

std::optional<ChannelDrift> DriftIn(std::span<const DailyValue> values,
                                    double deviation) {
  if (values.empty() || values.back().day - values.front().day < kLeastSpanH) {
    return std::nullopt;
  }
  const std::optional<TrendLine> line = FitTrend(values);
  if (!line || !line->significant()) {
    return std::nullopt;
  }
  const double span = line->last_day - line->first_day;
  const double now = line->At(line->last_day);
  if (now * line->slope <= 0.0 ||
      std::abs(line->slope) * span < kLeastRise * deviation ||
      !IsLineRatherThanStep(values, *line)) {
    return std::nullopt;
  }
  const double zero = line->last_day - now / line->slope;
  ChannelDrift drift;
  drift.now = now;
  drift.per_hour = line->slope;
  drift.since_ns =
      std::llround(std::max(zero, line->first_day)) * std::int64_t{kNsPerHour};
  drift.last_ns = std::llround(line->last_day) * std::int64_t{kNsPerHour};
  return drift;
}

}  // namespace

std::vector<ChannelDrift> DriftsOf(std::span<const HealthHour> hours) {
  std::vector<ChannelDrift> drifts;
  if (hours.empty()) {
    return drifts;
  }
  for (const HealthChannel& channel : hours.back().channels) {
    const bool known = std::ranges::any_of(drifts, [&](const auto& drift) {
      return drift.signal == channel.output;
    });
    if (known) {
      continue;  // F has two models, and one drift.
    }
    const HourlyResiduals residuals = HourlyResidualsOf(hours, channel.output);
    for (const double span_h : kSpansH) {
      const std::span<const DailyValue> all = residuals.hours;
      const auto first = std::ranges::find_if(all, [&](const DailyValue& v) {
        return v.day > all.back().day - span_h;
      });
      std::optional<ChannelDrift> drift =
          DriftIn(all.subspan(static_cast<std::size_t>(first - all.begin())),
                  residuals.deviation);
      if (drift) {
        drift->signal = channel.output;
        drift->flow_unit = hours.back().flow_unit;
        drifts.push_back(*drift);
        break;
      }
    }
  }
  return drifts;
}

std::string DriftText(const ChannelDrift& drift) {
  const std::string unit(drift.signal == Signal::kF
                             ? FlowUnitName(drift.flow_unit)
                             : SignalUnit(drift.signal));
  return std::string(SignalName(drift.signal)) + " reads " +
         SizeText(drift.now) + ' ' + unit +
         (drift.now > 0.0 ? " above" : " below") + " its model since " +
         FormatTime(drift.since_ns, true) + ", growing by " +
         SizeText(drift.per_hour) + ' ' + unit +
         " an hour: a fault that grows, or the transmitter";
}

}  // namespace fdi::planner
