#include "diagnosis/loop/standing.h"

#include <algorithm>
#include <vector>

#include "base/correlation.h"
#include "diagnosis/loop/play.h"

namespace fdi::loop {
namespace {

constexpr std::size_t kLeastSamples = 3;
constexpr std::size_t kLongestDelay = 1;  // Samples; records differ by one.
constexpr double kStill = 0.5;            // X stays within this [%].
constexpr double kOpMoves = 4.0;          // OP moves by this [%].
constexpr double kStop = 3.0;     // Nearer to an end X stands anyway [%].
constexpr double kFollows = 0.1;  // r² of the lag.

double Bounded(double op) {
  return std::clamp(op, 0.0, 100.0);
}

bool IsHeld(std::span<const double> x) {
  std::size_t repeats = 0;
  for (std::size_t k = 1; k < x.size(); ++k) {
    repeats += x[k] == x[k - 1] ? 1U : 0U;
  }
  return 2 * repeats > x.size();
}

// dX(k) over OP(k - delay) - X(k-1).
CorrelationSums LagSums(std::span<const double> op, std::span<const double> x,
                        std::size_t delay) {
  CorrelationSums sums;
  for (std::size_t k = std::max<std::size_t>(1, delay); k < x.size(); ++k) {
    sums.Add(Bounded(op[k - delay]) - x[k - 1], x[k] - x[k - 1]);
  }
  return sums;
}

// OP behind the lag of X; empty if X does not follow it.
std::vector<double> Lagged(std::span<const double> op,
                           std::span<const double> x) {
  std::size_t delay = 0;
  double best = 0.0;
  for (std::size_t d = 0; d <= kLongestDelay; ++d) {
    if (const double r = LagSums(op, x, d).Correlation(); r > best) {
      best = r;
      delay = d;
    }
  }
  if (best * best < kFollows) {
    return {};
  }
  const CorrelationSums s = LagSums(op, x, delay);
  const double slope = (s.n * s.xy - s.x * s.y) / (s.n * s.xx - s.x * s.x);
  const double share = std::clamp(slope, 0.1, 1.0);
  std::vector<double> lagged{x[0]};
  for (std::size_t k = 1; k < x.size(); ++k) {
    const double moved = Bounded(op[k - std::min(k, delay)]) - lagged.back();
    lagged.push_back(lagged.back() + share * moved);
  }
  return lagged;
}

}  // namespace

Standing FindStanding(std::span<const double> op, std::span<const double> x) {
  Standing standing;
  if (x.size() < kLeastSamples || IsHeld(x)) {
    return standing;
  }
  const std::vector<double> lagged = Lagged(op, x);
  std::vector<double> moves;
  std::vector<double> places;
  std::size_t samples = 0;
  for (std::size_t begin = 0; begin < lagged.size();) {
    double low = x[begin];
    double high = x[begin];
    std::size_t end = begin + 1;
    for (; end < x.size(); ++end) {
      if (std::max(high, x[end]) - std::min(low, x[end]) > kStill) {
        break;
      }
      high = std::max(high, x[end]);
      low = std::min(low, x[end]);
    }
    const double moved = RangeOf(std::span(lagged).subspan(begin, end - begin));
    if (end - begin >= kLeastSamples && moved >= kOpMoves && low > kStop &&
        high < 100.0 - kStop) {
      samples += end - begin;
      moves.push_back(moved);
      places.push_back(low);
    }
    begin = end;
  }
  const auto quartile = [n = moves.size()](const auto& sorted, std::size_t i) {
    return sorted[i * n / 4];
  };
  std::ranges::sort(moves);
  std::ranges::sort(places);
  // Always at one place it is a stop.
  if (moves.empty() || quartile(places, 3) - quartile(places, 1) <= kStill) {
    return standing;
  }
  standing.times = moves.size();
  standing.share = static_cast<double>(samples) / static_cast<double>(x.size());
  standing.low = quartile(moves, 1);
  standing.middle = quartile(moves, 2);
  standing.high = quartile(moves, 3);
  return standing;
}

}  // namespace fdi::loop
