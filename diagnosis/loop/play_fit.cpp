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
constexpr double kNarrowest = 0.04;  // Share of the range of OP.
constexpr double kWidest = 0.90;
constexpr std::array kSides{-0.5, 0.0, 0.5};  // Start of a play, in widths.
constexpr std::size_t kFewestSamples = 20;

double WidthShare(int i) {
  return kNarrowest + (kWidest - kNarrowest) * i / (kWidths - 1);
}

// Calls visit(w, p) for OP itself, w = 0, and for plays of widths from `low` to
// `high`.
template <typename Visit>
void ForEachPlay(std::span<const double> op, double low, double high,
                 const Visit& visit) {
  visit(0.0, std::vector<double>(op.begin(), op.end()));
  constexpr int kTried = 5;
  for (int i = 0; i < kTried; ++i) {
    const double width = low + (high - low) * i / (kTried - 1);
    for (const double side : kSides) {
      visit(width, PlayOf(op, width, op.front() + side * width));
    }
  }
}

// r² of the regression of y(k + delay) on x(k); 0 if its slope has another
// sign.
double FitLine(std::span<const double> x, std::span<const double> y,
               std::size_t delay, int sign) {
  using Values = Eigen::Map<const Eigen::ArrayXd>;
  const auto n = static_cast<Eigen::Index>(y.size() - delay);
  const Values xs(x.data(), n);
  const Values ys(y.data() + delay, n);
  const Eigen::ArrayXd dx = xs - xs.mean();
  const Eigen::ArrayXd dy = ys - ys.mean();
  const double xx = dx.matrix().squaredNorm();
  const double yy = dy.matrix().squaredNorm();
  const double xy = dx.matrix().dot(dy.matrix());
  return xx <= 0.0 || yy <= 0.0 || xy * sign <= 0.0 ? 0.0 : xy * xy / (xx * yy);
}

constexpr std::array kLags{0, 2, kLongestLag};  // Lags of the filter [samples].
constexpr std::size_t kDelays = 3;              // 0, 1 and 2 samples.

// A lane for each of kSides; the fourth fills up the registers.
using Lanes = Eigen::Array4d;

// Sums over z(k), OP through a play and a filter, and PV(k + delay).
struct Sums {
  Lanes z{Lanes::Zero()};
  Lanes zz{Lanes::Zero()};
  std::array<Lanes, kDelays> zy{Lanes::Zero(), Lanes::Zero(), Lanes::Zero()};
};

// y_k = y_{k-1} + (1 - e^(-1/lag)) (x_k - y_{k-1}), y_{-1} = x_0, for each lag.
std::array<Sums, kLags.size()> SumsOf(std::span<const double> op,
                                      std::span<const double> pv,
                                      double width) {
  std::array<double, kLags.size()> shares{};
  std::ranges::transform(kLags, shares.begin(), [](int lag) {
    return lag > 0 ? 1.0 - std::exp(-1.0 / lag) : 1.0;
  });
  const double half = 0.5 * width;
  Lanes play = op.front() + width * Lanes(kSides[0], kSides[1], kSides[2], 0.0);
  play = play.max(op.front() - half).min(op.front() + half);
  std::array<Lanes, kLags.size()> filters{play, play, play};
  std::array<Sums, kLags.size()> sums;
  for (std::size_t k = 0; k + kDelays <= op.size(); ++k) {
    play = play.max(op[k] - half).min(op[k] + half);
    for (std::size_t i = 0; i < kLags.size(); ++i) {
      Lanes& z = filters[i];
      z += shares[i] * (play - z);
      sums[i].z += z;
      sums[i].zz += z * z;
      for (std::size_t d = 0; d < kDelays; ++d) {
        sums[i].zy[d] += z * pv[k + d];
      }
    }
  }
  return sums;
}

// PV(k + delay) over as many pairs: its mean, and Σ (y - mean)².
struct Delayed {
  double mean{0.0};
  double square{0.0};
};
std::array<Delayed, kDelays> DelaysOf(std::span<const double> pv) {
  const auto pairs = static_cast<Eigen::Index>(pv.size() + 1 - kDelays);
  std::array<Delayed, kDelays> delays;
  for (std::size_t d = 0; d < kDelays; ++d) {
    const Eigen::Map<const Eigen::ArrayXd> y(pv.data() + d, pairs);
    delays[d].mean = y.mean();
    delays[d].square = (y - delays[d].mean).square().sum();
  }
  return delays;
}

std::vector<double> Without(double level, std::span<const double> values) {
  std::vector<double> result(values.begin(), values.end());
  std::ranges::for_each(result, [level](double& v) { v -= level; });
  return result;
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
  std::vector<std::pair<double, double>> errors;  // Errors 1 - r², by width.
  // About their means, so that the sums of squares lose nothing.
  const double op_level = Mean(op);
  const double pv_level = Mean(pv);
  const std::vector<double> input = Without(op_level, op);
  const std::vector<double> answer = Without(pv_level, pv);
  const std::array<Delayed, kDelays> delays = DelaysOf(answer);
  const auto n = static_cast<double>(op.size() + 1 - kDelays);
  const double range = RangeOf(op);
  for (int w = -1; w < kWidths; ++w) {
    const double width = w < 0 ? 0.0 : range * WidthShare(w);
    double best = 0.0;
    const auto sums = SumsOf(input, answer, width);
    for (std::size_t i = 0; i < kLags.size() * kDelays; ++i) {
      const Sums& z = sums[i / kDelays];
      const Delayed& y = delays[i % kDelays];
      const Lanes xx = z.zz - z.z.square() / n;
      const Lanes xy = z.zy[i % kDelays] - z.z * y.mean;
      for (std::size_t side = 0; side < kSides.size(); ++side) {
        const auto lane = static_cast<Eigen::Index>(side);
        if (xx(lane) <= 0.0 || y.square <= 0.0 || xy(lane) * sign <= 0.0) {
          continue;
        }
        const double r2 = xy(lane) * xy(lane) / (xx(lane) * y.square);
        best = std::max(best, r2);
        if (width > 0.0 && r2 > fit.play) {
          fit.play = r2;
          fit.band = width;
          fit.start = op.front() + kSides[side] * width;
          fit.lag = kLags[i / kDelays];
          fit.delay = static_cast<int>(i % kDelays);
          fit.slope = xy(lane) / xx(lane);
          fit.offset =
              pv_level + y.mean - (op_level + z.z(lane) / n) * fit.slope;
        }
      }
    }
    if (width > 0.0) {
      errors.emplace_back(width, 1.0 - best);
    } else {
      fit.linear = best;
    }
  }
  fit.step = range * (WidthShare(1) - WidthShare(0));
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
                          std::span<const double> pv, const PlayFit& fit) {
  constexpr int kOrder = 4;
  const auto rows = static_cast<Eigen::Index>(pv.size()) - kOrder;
  if (rows < Eigen::Index{4} * kOrder || RangeOf(op) <= 0.0 ||
      RangeOf(pv) <= 0.0) {
    return 0.0;
  }
  // Columns: PV(k-1..k-4), 1, u(k-1..k-4). The terms of OP in the normal
  // equations are new for each play.
  using Table = Eigen::Matrix<double, Eigen::Dynamic, 2 * kOrder + 1>;
  const auto lagged = [rows](const Eigen::VectorXd& series, int i) {
    return series.segment(kOrder - i, rows);
  };
  const double mean = Mean(pv);
  const Eigen::VectorXd readings =
      Eigen::Map<const Eigen::VectorXd>(pv.data(), rows + kOrder).array() -
      mean;
  const Eigen::VectorXd output = lagged(readings, 0);
  Table table(rows, 2 * kOrder + 1);
  for (int i = 1; i <= kOrder; ++i) {
    table.col(i - 1) = lagged(readings, i);
  }
  table.col(kOrder).setOnes();
  Eigen::Matrix<double, 2 * kOrder + 1, 2 * kOrder + 1> known;
  known.setZero();
  const auto fixed = table.leftCols<kOrder + 1>();
  known.topLeftCorner<kOrder + 1, kOrder + 1>() = fixed.transpose() * fixed;
  double linear = 0.0;
  double least = std::numeric_limits<double>::infinity();
  const double low = std::max(fit.band_low - 2.0 * fit.step, fit.step);
  const double high = fit.band_high + 2.0 * fit.step;
  const auto try_play = [&](double width, const std::vector<double>& play) {
    const Eigen::VectorXd input =
        Eigen::Map<const Eigen::VectorXd>(play.data(), rows + kOrder).array() -
        op[0];
    for (int i = 1; i <= kOrder; ++i) {
      table.col(kOrder + i) = lagged(input, i);
    }
    const auto inputs = table.rightCols<kOrder>();
    auto normal = known;
    normal.bottomLeftCorner<kOrder, kOrder + 1>() =
        inputs.transpose().lazyProduct(fixed);
    normal.bottomRightCorner<kOrder, kOrder>() =
        inputs.transpose().lazyProduct(inputs);
    // A little ridge keeps a play that stands still solvable.
    normal.diagonal() *= 1.0 + 1e-10;
    normal.diagonal().array() += 1e-300;
    const Eigen::Matrix<double, 2 * kOrder + 1, 1> solution =
        normal.selfadjointView<Eigen::Lower>().ldlt().solve(table.transpose() *
                                                            output);
    const double error = (output - table * solution).squaredNorm();
    if (width > 0.0) {
      least = std::min(least, error);
    } else {
      linear = error;
    }
  };
  ForEachPlay(op, low, high, try_play);
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
      best = std::max(best, FitLine(mean, rise, delay, sign));
    }
  }
  return best;
}

}  // namespace fdi::loop
