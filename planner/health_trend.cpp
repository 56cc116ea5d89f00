#include "planner/health_trend.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "base/median.h"
#include "diagnosis/model/student.h"

namespace fdi::planner {
namespace {

constexpr double kHuber = 1.345;
constexpr double kMaxCorrelation = 0.9;
constexpr int kIterations = 50;
constexpr double kNinety = 0.95;        // quantile of a 90 % interval
constexpr double kFivePercent = 0.975;  // quantile of a two-sided 5 % test

// Weighted least squares for a line, or for a level if not `with_slope`.
void Solve(std::span<const DailyValue> values,
           const std::vector<double>& weights, bool with_slope,
           TrendLine& line) {
  double w = 0.0, wt = 0.0, wy = 0.0, wtt = 0.0, wty = 0.0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const double t = values[i].day - line.middle;
    w += weights[i];
    wt += weights[i] * t;
    wy += weights[i] * values[i].value;
    wtt += weights[i] * t * t;
    wty += weights[i] * t * values[i].value;
  }
  line.slope = with_slope ? (w * wty - wt * wy) / (w * wtt - wt * wt) : 0.0;
  line.level = (wy - line.slope * wt) / w;
}

std::vector<double> Residuals(std::span<const DailyValue> values,
                              const TrendLine& line) {
  std::vector<double> residuals;
  for (const DailyValue& v : values) {
    residuals.push_back(v.value - line.At(v.day));
  }
  return residuals;
}

// Correlation of winsorised residuals of neighbouring days.
double Correlation(std::span<const DailyValue> values,
                   const std::vector<double>& psi, int parameters) {
  double product = 0.0, square = 0.0;
  int pairs = 0;
  for (std::size_t i = 0; i < psi.size(); ++i) {
    square += psi[i] * psi[i];
    if (i > 0 && std::abs(values[i].day - values[i - 1].day - 1.0) < 0.5) {
      product += psi[i] * psi[i - 1];
      ++pairs;
    }
  }
  const auto n = static_cast<double>(psi.size());
  if (pairs < kTrendDays / 2 || square <= 0.0) {
    return 0.0;
  }
  const double raw = product / pairs / (square / n);
  // E[raw] = ρ − (p + 2 p ρ)/n for p fitted parameters.
  const double corrected = (n * raw + parameters) / (n - 2.0 * parameters);
  return std::clamp(corrected, 0.0, kMaxCorrelation);
}

// Sets the variances, from Huber's ψ of the residuals.
void Judge(std::span<const DailyValue> values, double scale, int parameters,
           TrendLine& line) {
  const auto n = static_cast<double>(values.size());
  std::vector<double> psi = Residuals(values, line);
  double inside = 0.0, square = 0.0, spread = 0.0;
  for (std::size_t i = 0; i < psi.size(); ++i) {
    inside += std::abs(psi[i]) <= kHuber * scale ? 1.0 : 0.0;
    psi[i] = std::clamp(psi[i], -kHuber * scale, kHuber * scale);
    square += psi[i] * psi[i];
    const double t = values[i].day - line.middle;
    spread += t * t;
  }
  line.correlation = Correlation(values, psi, parameters);
  const double effective =
      n * (1.0 - line.correlation) / (1.0 + line.correlation);
  line.freedom = std::max(1.0, effective - parameters);
  const double share = std::max(inside / n, 0.1);
  const double variance =
      square / (n - parameters) / (share * share) * n / effective;
  line.level_variance = variance / n;
  line.slope_variance = parameters == 2 ? variance / spread : 0.0;
}

std::optional<TrendLine> Fit(std::span<const DailyValue> values,
                             bool with_slope) {
  TrendLine line;
  line.days = static_cast<int>(values.size());
  if (line.days < kTrendDays) {
    return std::nullopt;
  }
  line.first_day = line.last_day = values[0].day;
  for (const DailyValue& v : values) {
    line.middle += v.day / line.days;
    line.first_day = std::min(line.first_day, v.day);
    line.last_day = std::max(line.last_day, v.day);
  }
  if (!(line.last_day > line.first_day)) {
    return std::nullopt;
  }
  std::vector<double> weights(values.size(), 1.0);
  double scale = 0.0;
  for (int i = 0; i < kIterations; ++i) {
    const TrendLine before = line;
    Solve(values, weights, with_slope, line);
    const std::vector<double> residuals = Residuals(values, line);
    scale = RobustSd(residuals);
    for (std::size_t k = 0; k < weights.size(); ++k) {
      const double size = std::abs(residuals[k]);
      weights[k] = size > kHuber * scale ? kHuber * scale / size : 1.0;
    }
    const double moved =
        std::abs(line.level - before.level) +
        std::abs(line.slope - before.slope) * (line.last_day - line.first_day);
    if (scale <= 0.0 || moved < 1e-6 * scale) {
      break;
    }
  }
  Judge(values, scale, with_slope ? 2 : 1, line);
  return line;
}

}  // namespace

bool TrendLine::significant() const {
  const double q = StudentQuantile(kFivePercent, freedom);
  return slope != 0.0 && slope * slope > q * q * slope_variance;
}

std::optional<TrendLine> FitTrend(std::span<const DailyValue> values) {
  return Fit(values, true);
}

std::optional<TimeToLimit> ToLimit(const TrendLine& line, double limit,
                                   double from) {
  if (!line.significant()) {
    return std::nullopt;
  }
  const double gap = limit - line.At(from);
  const double start = limit - line.At(line.first_day);
  if (gap * line.slope <= 0.0) {
    // The limit was passed before `from`, or the line leads away from it.
    return start * line.slope > 0.0 ? std::optional(TimeToLimit{})
                                    : std::nullopt;
  }
  // |level + slope τ − limit| ≤ q sqrt(V_level + V_slope τ²), τ = t − middle
  const double q = StudentQuantile(kNinety, line.freedom);
  const double off = line.level - limit;
  const double a = line.slope * line.slope - q * q * line.slope_variance;
  const double b = line.slope * off;
  const double c = off * off - q * q * line.level_variance;
  const double root = std::sqrt(std::max(0.0, b * b - a * c));
  const double shift = line.middle - from;
  return TimeToLimit{gap / line.slope, std::max(0.0, shift + (-b - root) / a),
                     std::max(0.0, shift + (-b + root) / a)};
}

std::optional<TimeToLimit> ToTotal(std::span<const DailyValue> values,
                                   double remaining) {
  const std::optional<TrendLine> rate = Fit(values, false);
  if (!rate || rate->level <= 0.0) {
    return std::nullopt;
  }
  if (remaining <= 0.0) {
    return TimeToLimit{};
  }
  const double spread =
      StudentQuantile(kNinety, rate->freedom) * std::sqrt(rate->level_variance);
  const double slowest = rate->level - spread;
  return TimeToLimit{remaining / rate->level,
                     remaining / (rate->level + spread),
                     slowest > 0.0 ? remaining / slowest
                                   : std::numeric_limits<double>::infinity()};
}

}  // namespace fdi::planner
