#include "diagnosis/loop/play_fit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include <Eigen/Dense>

#include "diagnosis/loop/play.h"

namespace fdi::loop {
namespace {

constexpr int kWidths = 24;
constexpr double kNarrowest = 0.04;  // Of the range of OP.
constexpr double kWidest = 0.90;
constexpr std::size_t kFewestSamples = 20;

// Calls visit(w, start, p) for OP itself, w = 0, and for each play of it.
template <typename Visit>
void ForEachPlay(std::span<const double> op, const Visit& visit) {
  visit(0.0, op.front(), std::vector<double>(op.begin(), op.end()));
  const double range = RangeOf(op);
  for (int i = 0; i < kWidths; ++i) {
    const double width =
        range * (kNarrowest + (kWidest - kNarrowest) * i / (kWidths - 1));
    for (const double side : {-0.5, 0.0, 0.5}) {
      const double start = op.front() + side * width;
      visit(width, start, PlayOf(op, width, start));
    }
  }
}

// The regression of y on x over pairs x(k - delay), y(k).
struct Line {
  double r2{0.0};
  double offset{0.0};
  double slope{0.0};
};
Line FitLine(std::span<const double> x, std::span<const double> y,
             std::size_t delay, int sign) {
  const std::size_t n = y.size() - delay;
  double mean_x = 0.0;
  double mean_y = 0.0;
  for (std::size_t k = 0; k < n; ++k) {
    mean_x += x[k];
    mean_y += y[k + delay];
  }
  mean_x /= static_cast<double>(n);
  mean_y /= static_cast<double>(n);
  double xx = 0.0;
  double yy = 0.0;
  double xy = 0.0;
  for (std::size_t k = 0; k < n; ++k) {
    const double dx = x[k] - mean_x;
    const double dy = y[k + delay] - mean_y;
    xx += dx * dx;
    yy += dy * dy;
    xy += dx * dy;
  }
  if (xx <= 0.0 || yy <= 0.0 || xy * sign <= 0.0) {
    return {};
  }
  return {xy * xy / (xx * yy), mean_y - mean_x * xy / xx, xy / xx};
}

// y_k = y_{k-1} + (1 - e^(-1/lag)) (x_k - y_{k-1}), y_{-1} = x_0.
std::vector<double> Lagged(std::vector<double> x, int lag) {
  if (lag > 0) {
    const double share = 1.0 - std::exp(-1.0 / lag);
    for (std::size_t k = 1; k < x.size(); ++k) {
      x[k] = x[k - 1] + share * (x[k] - x[k - 1]);
    }
  }
  return x;
}

bool Moves(std::span<const double> values) {
  return values.size() >= kFewestSamples && RangeOf(values) > 0.0;
}

}  // namespace

std::optional<PlayFit> FitPlay(std::span<const double> op,
                               std::span<const double> pv, int sign) {
  if (!Moves(op) || !Moves(pv)) {
    return std::nullopt;
  }
  PlayFit fit;
  std::vector<std::pair<double, double>> errors;  // Of each width, 1 - r².
  ForEachPlay(op, [&](double width, double start, std::vector<double> play) {
    double best = 0.0;
    for (const int lag : {0, 2, 6}) {
      const std::vector<double> z = Lagged(play, lag);
      for (const int delay : {0, 1, 2}) {
        const Line line = FitLine(z, pv, static_cast<std::size_t>(delay), sign);
        best = std::max(best, line.r2);
        if (width > 0.0 && line.r2 > fit.play) {
          fit.play = line.r2;
          fit.band = width;
          fit.start = start;
          fit.lag = lag;
          fit.delay = delay;
          fit.offset = line.offset;
          fit.slope = line.slope;
        }
      }
    }
    if (width > 0.0) {
      errors.emplace_back(width, 1.0 - best);
    } else {
      fit.linear = best;
    }
  });
  fit.band_low = fit.band;
  fit.band_high = fit.band;
  for (const auto& [width, error] : errors) {
    if (error <= 1.05 * (1.0 - fit.play)) {
      fit.band_low = std::min(fit.band_low, width);
      fit.band_high = std::max(fit.band_high, width);
    }
  }
  return fit;
}

double PlayPredictionGain(std::span<const double> op,
                          std::span<const double> pv) {
  constexpr Eigen::Index kOrder = 4;
  const auto rows = static_cast<Eigen::Index>(pv.size()) - kOrder;
  if (rows < 4 * kOrder || RangeOf(op) <= 0.0 || RangeOf(pv) <= 0.0) {
    return 0.0;
  }
  double mean = 0.0;
  for (const double y : pv) {
    mean += y / static_cast<double>(pv.size());
  }
  // Columns: PV(k-1..k-4), 1, u(k-1..k-4), PV(k).
  Eigen::MatrixXd table(rows, 2 * kOrder + 2);
  for (Eigen::Index r = 0; r < rows; ++r) {
    const auto k = static_cast<std::size_t>(r + kOrder);
    for (std::size_t i = 1; i <= kOrder; ++i) {
      table(r, static_cast<Eigen::Index>(i) - 1) = pv[k - i] - mean;
    }
    table(r, kOrder) = 1.0;
    table(r, 2 * kOrder + 1) = pv[k] - mean;
  }
  double linear = 0.0;
  double least = std::numeric_limits<double>::infinity();
  ForEachPlay(op, [&](double width, double, const std::vector<double>& u) {
    for (Eigen::Index r = 0; r < rows; ++r) {
      const auto k = static_cast<std::size_t>(r + kOrder);
      for (std::size_t i = 1; i <= kOrder; ++i) {
        table(r, kOrder + static_cast<Eigen::Index>(i)) = u[k - i] - op[0];
      }
    }
    const auto inputs = table.leftCols(2 * kOrder + 1);
    const auto output = table.col(2 * kOrder + 1);
    // A little ridge keeps a play that stands still solvable.
    Eigen::MatrixXd normal = inputs.transpose() * inputs;
    normal.diagonal() *= 1.0 + 1e-10;
    normal.diagonal().array() += 1e-300;
    const Eigen::VectorXd solution =
        normal.ldlt().solve(inputs.transpose() * output);
    const double error = (output - inputs * solution).squaredNorm();
    if (width > 0.0) {
      least = std::min(least, error);
    } else {
      linear = error;
    }
  });
  if (!(linear > 0.0) || !(least > 0.0)) {
    return 0.0;
  }
  return 0.5 * static_cast<double>(rows) * std::log(linear / least);
}

double FitIncrements(std::span<const double> op, std::span<const double> pv,
                     int sign) {
  if (!Moves(op) || !Moves(pv)) {
    return 0.0;
  }
  std::vector<double> sums(op.size() + 1, 0.0);
  for (std::size_t k = 0; k < op.size(); ++k) {
    sums[k + 1] = sums[k] + op[k] - op[0];
  }
  double best = 0.0;
  for (const std::size_t h : {3U, 6U, 12U}) {
    if (pv.size() < h + 6 + kFewestSamples) {
      continue;
    }
    std::vector<double> rise(pv.size() - h);
    std::vector<double> mean(pv.size() - h);
    for (std::size_t k = 0; k < rise.size(); ++k) {
      rise[k] = pv[k + h] - pv[k];
      mean[k] = (sums[k + h] - sums[k]) / static_cast<double>(h);
    }
    for (const std::size_t delay : {0U, 1U, 3U, 6U}) {
      best = std::max(best, FitLine(mean, rise, delay, sign).r2);
    }
  }
  return best;
}

}  // namespace fdi::loop
