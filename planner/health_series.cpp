#include "planner/health_series.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <map>
#include <utility>

#include "base/error.h"
#include "base/text.h"
#include "base/time_units.h"
#include "diagnosis/model/fault_catalogue.h"

namespace fdi::planner {
namespace {

constexpr double kMinLiveHours = 1.0;                // A day needs this many.
constexpr std::int64_t kMinLiveMs = kMsPerHour / 4;  // An hour needs this.
// Below this share of LIVE time, days are missing because the valve runs
// outside the trained region and not because it has not been followed for long
// enough.
constexpr double kCoveredShare = 0.2;

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
  // Fixed notation of a double has at most 309 digits before the point and some
  // 324 behind it, not both.
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
  } else if (const auto fault = ParseFinding(name)) {
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

// Rounds down; the division of integers rounds towards zero.
std::int64_t DayOf(const HealthHour& hour) {
  return hour.hour / 24 - (hour.hour % 24 < 0 ? 1 : 0);
}

// A daily mean: of all samples, or of one bin of CV.
struct Cell {
  std::int64_t day{0};
  int bin{0};
  double numerator{0.0};
  double denominator{0.0};
  double weight{0.0};  // samples

  double mean() const { return numerator / denominator; }
};

// Sums of cells by day and bin.
class Cells {
 public:
  void Add(std::int64_t day, int bin, double numerator, double denominator,
           double weight) {
    Cell& cell = cells_[{day, bin}];
    cell.day = day;
    cell.bin = bin;
    cell.numerator += numerator;
    cell.denominator += denominator;
    cell.weight += weight;
  }
  std::vector<Cell> Usable() const {
    std::vector<Cell> usable;
    for (const auto& [key, cell] : cells_) {
      if (cell.weight > 0.0 && cell.denominator != 0.0) {
        usable.push_back(cell);
      }
    }
    return usable;
  }

 private:
  std::map<std::pair<std::int64_t, int>, Cell> cells_;
};

// With r = y − ŷ, the sums give Σŷ = Σy − Σr. A deviation is the ratio of sums
// 100 Σr / Σŷ, in which the quantum cancels. It is not a mean of ratios, which
// samples with a small ŷ would dominate.
//
// @param at Day or hour, as the cells are counted.
void AddResiduals(const HealthHour& hour, const HealthLimit& limit,
                  std::int64_t at, Cells& cells) {
  for (std::size_t b = 0; b < hour.bins.size(); ++b) {
    for (std::size_t c = 0; c < hour.bins[b].size(); ++c) {
      const ResidualSums& sums = hour.bins[b][c];
      if (hour.channels[c].output != limit.signal || sums.samples == 0) {
        continue;
      }
      const auto n = static_cast<double>(sums.samples);
      const auto r = static_cast<double>(sums.residual);
      const double quantum = hour.channels[c].quantum();
      const double expected = static_cast<double>(sums.output) - r;
      if (limit.kind == Kind::kDeviation) {
        cells.Add(at, static_cast<int>(b), 100.0 * r, expected, n);
      } else {
        cells.Add(at, static_cast<int>(b), r * quantum, n, n);
      }
    }
  }
}

void AddStrengths(const HealthHour& hour, int fault, Cells& cells) {
  for (const StrengthSums& sums : hour.strengths) {
    if (sums.fault == fault) {
      const auto n = static_cast<double>(sums.samples);
      cells.Add(DayOf(hour), 0,
                static_cast<double>(sums.strength) * HealthHour::kShare, n, n);
    }
  }
}

// The a_b of m_db = a_b + slope t, weighted by samples.
//
// Minimises Σ_b Σ_d w_db (m_db − a_b − slope t_d)², with w_db the samples of
// day d in bin b. ∂/∂a_b = 0 gives a_b = (Σ_d w m − slope Σ_d w t) / Σ_d w;
// inserted into ∂/∂slope = 0 this gives the slope below, which compares days
// only within their bin. A slope that cannot be determined, as on a single day,
// is 0.
std::map<int, double> Intercepts(const std::vector<Cell>& cells) {
  struct Bin {
    double w{0.0}, wt{0.0}, wm{0.0}, wtt{0.0}, wtm{0.0};
  };
  // Days count from the first one. Counted since 1970, their squares are some
  // 4e8, and S_tt below, a difference of sums of them, would lose seven digits
  // over a month.
  std::map<int, Bin> bins;
  const auto origin = static_cast<double>(cells.front().day);
  for (const Cell& cell : cells) {
    Bin& bin = bins[cell.bin];
    const double t = static_cast<double>(cell.day) - origin;
    bin.w += cell.weight;
    bin.wt += cell.weight * t;
    bin.wm += cell.weight * cell.mean();
    bin.wtt += cell.weight * t * t;
    bin.wtm += cell.weight * t * cell.mean();
  }
  // slope = Σ_b S_tm / Σ_b S_tt with S_xy = Σ w x y − Σ w x Σ w y / Σ w within
  // bin b.
  double spread = 0.0;
  double product = 0.0;
  for (const auto& [index, bin] : bins) {
    spread += bin.wtt - bin.wt * bin.wt / bin.w;
    product += bin.wtm - bin.wt * bin.wm / bin.w;
  }
  const double slope = spread > 0.0 ? product / spread : 0.0;
  std::map<int, double> intercepts;
  for (const auto& [index, bin] : bins) {
    intercepts[index] = (bin.wm - slope * bin.wt) / bin.w;
  }
  return intercepts;
}

// Value of day d = Σ_b w_db (m_db − a_b) / Σ_b w_db + ā, where ā is the mean of
// a_b over all samples. Expects cells in order of their days, as Cells has
// them.
std::vector<DailyValue> Adjusted(const std::vector<Cell>& cells) {
  std::vector<DailyValue> days;
  if (cells.empty()) {
    return days;
  }
  const std::map<int, double> intercepts = Intercepts(cells);
  double weight = 0.0;
  double mean = 0.0;
  for (const Cell& cell : cells) {
    weight += cell.weight;
    mean += cell.weight * intercepts.at(cell.bin);
  }
  mean /= weight;
  for (std::size_t i = 0; i < cells.size();) {
    const std::int64_t day = cells[i].day;
    double w = 0.0;
    double sum = 0.0;
    for (; i < cells.size() && cells[i].day == day; ++i) {
      w += cells[i].weight;
      sum += cells[i].weight * (cells[i].mean() - intercepts.at(cells[i].bin));
    }
    days.push_back({static_cast<double>(day), mean + sum / w});
  }
  return days;
}

// Totals of the days with samples.
std::vector<DailyValue> Totals(std::span<const HealthHour> hours, Kind kind) {
  std::map<std::int64_t, double> days;
  for (const HealthHour& hour : hours) {
    days[DayOf(hour)] += kind == Kind::kTravel
                             ? static_cast<double>(hour.travel) *
                                   HealthHour::kTravel / HealthHour::kFullStroke
                             : static_cast<double>(hour.reversals);
  }
  std::vector<DailyValue> values;
  for (const auto& [day, value] : days) {
    values.push_back({static_cast<double>(day), value});
  }
  return values;
}

// Hours of the last epoch and, unless `any_models`, of the last model set.
std::vector<HealthHour> Comparable(std::span<const HealthHour> hours,
                                   bool any_models) {
  std::vector<HealthHour> comparable;
  if (hours.empty()) {
    return comparable;
  }
  // A model hash of 0 means that none was assigned. Such hours at the end must
  // not hide the set that judged before them.
  const auto last = std::find_if(
      hours.rbegin(), hours.rend(),
      [&](const HealthHour& h) { return any_models || h.model_hash != 0; });
  const HealthHour& key = last != hours.rend() ? *last : hours.back();
  for (const HealthHour& hour : hours) {
    if (hour.epoch == key.epoch &&
        (any_models || hour.model_hash == key.model_hash)) {
      comparable.push_back(hour);
    }
  }
  return comparable;
}

}  // namespace

HealthSeries SeriesOf(std::span<const HealthHour> all,
                      const HealthLimit& limit) {
  HealthSeries series;
  const std::vector<HealthHour> hours = Comparable(all, limit.cumulative());
  std::map<std::int64_t, double> live;
  Cells cells;
  for (const HealthHour& hour : hours) {
    series.flow_unit = hour.flow_unit;
    series.seen_hours += static_cast<double>(hour.seen_ms) / kMsPerHour;
    series.live_hours += static_cast<double>(hour.live_ms) / kMsPerHour;
    live[DayOf(hour)] += static_cast<double>(hour.live_ms) / kMsPerHour;
    if (limit.kind == Kind::kStrength) {
      AddStrengths(hour, limit.fault, cells);
    } else if (!limit.cumulative()) {
      AddResiduals(hour, limit, DayOf(hour), cells);
    }
  }
  if (limit.cumulative()) {
    series.days = Totals(hours, limit.kind);
    return series;
  }
  std::vector<Cell> usable = cells.Usable();
  std::erase_if(usable, [&live](const Cell& cell) {
    return live[cell.day] < kMinLiveHours;
  });
  series.days = Adjusted(usable);
  return series;
}

HourlyResiduals HourlyResidualsOf(std::span<const HealthHour> all,
                                  Signal signal) {
  const HealthLimit limit{Kind::kResidual, signal, 0, 0.0};
  Cells cells;
  double scatter = 0.0;
  double samples = 0.0;
  for (const HealthHour& hour : Comparable(all, false)) {
    if (hour.live_ms < kMinLiveMs) {
      continue;
    }
    AddResiduals(hour, limit, hour.hour, cells);
    for (const std::vector<ResidualSums>& bin : hour.bins) {
      for (std::size_t c = 0; c < bin.size(); ++c) {
        if (hour.channels[c].output == signal && bin[c].samples > 0) {
          const auto n = static_cast<double>(bin[c].samples);
          const auto r = static_cast<double>(bin[c].residual);
          const double quantum = hour.channels[c].quantum();
          scatter += quantum * quantum *
                     (static_cast<double>(bin[c].square) - r * r / n);
          samples += n;
        }
      }
    }
  }
  return {Adjusted(cells.Usable()),
          samples > 0.0 ? std::sqrt(std::max(0.0, scatter / samples)) : 0.0};
}

HealthForecast Forecast(const HealthSeries& series, const HealthLimit& limit) {
  HealthForecast forecast;
  forecast.days = static_cast<int>(series.days.size());
  if (forecast.days > 0) {
    forecast.first_day = series.days.front().day;
    forecast.last_day = series.days.back().day;
  }
  if (limit.cumulative()) {
    double total = 0.0;
    for (const DailyValue& day : series.days) {
      total += day.value;
    }
    forecast.now = total;
    if (forecast.days > 0) {
      forecast.slope = total / forecast.days;
    }
    forecast.time = ToTotal(series.days, limit.value - total);
    // A total that has passed its limit needs no trend for that answer.
    forecast.answer = total >= limit.value         ? Answer::kReached
                      : forecast.time              ? Answer::kTime
                      : forecast.days < kTrendDays ? Answer::kTooFew
                                                   : Answer::kNoTrend;
    return forecast;
  }
  const std::optional<TrendLine> line = FitTrend(series.days);
  if (!line) {
    forecast.answer =
        series.seen_hours > 24.0 * kTrendDays * kCoveredShare &&
                series.live_hours < kCoveredShare * series.seen_hours
            ? Answer::kOutside
            : Answer::kTooFew;
    return forecast;
  }
  forecast.now = line->At(line->last_day);
  forecast.slope = line->slope;
  // The sign of the limit says from which side it is reached. That is why
  // ParseHealthLimit() refuses 0.
  const bool reached = limit.value < 0.0 ? *forecast.now <= limit.value
                                         : *forecast.now >= limit.value;
  forecast.time = ToLimit(*line, limit.value, line->last_day);
  forecast.answer = reached                ? Answer::kReached
                    : !line->significant() ? Answer::kNoTrend
                    : forecast.time        ? Answer::kTime
                                           : Answer::kAway;
  return forecast;
}

// Text form of limits and forecasts.

//     limit  = name "=" number ["%"]
//     name   = SIGNAL | FAULT | "travel" | "reversals"
//     number = as std::from_chars() reads it, so without "+"; finite and not 0
//
// "%" is for signals only, totals are positive, and strengths within -1..1.
HealthLimit ParseHealthLimit(std::string_view text) {
  const std::size_t sign = text.find('=');
  if (sign == std::string_view::npos) {
    Refuse(text, "'=' is missing");
  }
  std::string_view number = text.substr(sign + 1);
  const bool percent = number.ends_with('%');
  number.remove_suffix(percent ? 1 : 0);
  HealthLimit limit;
  limit.value = ParseWhole<double>(number).value_or(0.0);
  if (!std::isfinite(limit.value) || limit.value == 0.0) {
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

}  // namespace fdi::planner
