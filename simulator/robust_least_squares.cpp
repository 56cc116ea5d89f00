#include "simulator/robust_least_squares.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "base/error.h"
#include "base/median.h"

namespace fdi::simulator {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Residuals of 0 are skipped: they mark rows that do not count.
double RobustScale(const VectorXd& residuals) {
  std::vector<double> counted;
  for (const double r : residuals) {
    if (r != 0.0) {
      counted.push_back(r);
    }
  }
  return counted.empty() ? 0.0 : RobustSd(std::move(counted));
}

// Share of independent rows in a series whose correlation at lag k is q^k:
//
//   1 / (1 + 2 sum_(k>0) q^k) = (1 - q) / (1 + q)
//
// q is that at lag 1. A negative one counts as 0, so that a series never has
// more independent rows than rows; 0.99 keeps the share above 0.
double IndependentShare(const VectorXd& r) {
  const double power = r.squaredNorm();
  if (r.size() < 2 || power == 0.0) {
    return 1.0;
  }
  const double correlation =
      r.head(r.size() - 1).dot(r.tail(r.size() - 1)) / power;
  const double bounded = std::clamp(correlation, 0.0, 0.99);
  return (1.0 - bounded) / (1.0 + bounded);
}

// rho(u) = u^2 / 2 up to the corner c, and c (|u| - c / 2) beyond it. The
// weight is rho'(u) / u.
double HuberWeight(double u, double corner) {
  return std::abs(u) <= corner ? 1.0 : corner / std::abs(u);
}

double HuberLoss(double u, double corner) {
  const double size = std::abs(u);
  return size <= corner ? 0.5 * u * u : corner * (size - 0.5 * corner);
}

}  // namespace

double MeanHuberLoss(const MatrixXd& residuals, const VectorXd& scale,
                     double huber) {
  double total = 0.0;
  for (Index j = 0; j < residuals.cols(); ++j) {
    for (Index k = 0; k < residuals.rows(); ++k) {
      total += HuberLoss(residuals(k, j) / scale[j], huber);
    }
  }
  return total / static_cast<double>(residuals.size());
}

namespace {

class Minimiser {
 public:
  Minimiser(const ResidualFunction& residuals, const PointBounds& bounds,
            const RobustFitOptions& options)
      : residuals_(residuals),
        bounds_(bounds),
        options_(options),
        damping_(options.damping) {}

  RobustFit Run(const VectorXd& start);

 private:
  void Rescale();
  double Loss(const MatrixXd& r, const VectorXd& point) const;
  void Linearise();
  VectorXd Step(double damping) const;
  bool Improve();

  VectorXd Inside(const VectorXd& point) const {
    return point.cwiseMax(bounds_.lower).cwiseMin(bounds_.upper);
  }
  VectorXd PriorPrecision() const {
    return bounds_.prior_sd.array().square().inverse();
  }

  const ResidualFunction& residuals_;
  const PointBounds& bounds_;
  const RobustFitOptions& options_;
  MatrixXd present_;  // Residuals at fit_.point.
  VectorXd gradient_;
  double share_{1.0};  // c.
  double damping_;
  RobustFit fit_;
};

void Minimiser::Rescale() {
  fit_.scale.resize(present_.cols());
  share_ = 1.0;
  for (Index j = 0; j < present_.cols(); ++j) {
    fit_.scale[j] =
        std::max(options_.least_scale[j], RobustScale(present_.col(j)));
    share_ = std::min(share_, IndependentShare(present_.col(j)));
  }
}

double Minimiser::Loss(const MatrixXd& r, const VectorXd& point) const {
  const VectorXd off =
      (point - bounds_.prior_mean).cwiseQuotient(bounds_.prior_sd);
  return share_ * static_cast<double>(r.size()) *
             MeanHuberLoss(r, fit_.scale, options_.huber) +
         0.5 * off.squaredNorm();
}

// Computes information, scatter and gradient of the data at the present point.
// With u = r / s, w its weight and J = du / d point,
//
//   information = sum w J J',  gradient = sum w u J,  scatter = sum_b g_b g_b'
//
// where g_b is the sum of w u J over block b of the rows. Within a block the
// residuals may be correlated, and the scatter still has what that adds to the
// variance of the gradient. J is a one-sided difference that stays within the
// bounds.
void Minimiser::Linearise() {
  const Index p = fit_.point.size();
  std::vector<VectorXd> points;
  VectorXd steps(p);
  for (Index i = 0; i < p; ++i) {
    const double ahead = fit_.point[i] + options_.difference_step;
    steps[i] = ahead <= bounds_.upper[i] ? options_.difference_step
                                         : -options_.difference_step;
    points.push_back(fit_.point);
    points.back()[i] += steps[i];
  }
  const std::vector<MatrixXd> moved = residuals_(points);
  fit_.information = MatrixXd::Zero(p, p);
  fit_.scatter = MatrixXd::Zero(p, p);
  gradient_ = VectorXd::Zero(p);
  VectorXd score = VectorXd::Zero(p);
  for (Index k = 0; k < present_.rows(); ++k) {
    for (Index j = 0; j < present_.cols(); ++j) {
      VectorXd slope(p);
      for (Index i = 0; i < p; ++i) {
        slope[i] = (moved[static_cast<std::size_t>(i)](k, j) - present_(k, j)) /
                   (steps[i] * fit_.scale[j]);
      }
      const double u = present_(k, j) / fit_.scale[j];
      const double weight = HuberWeight(u, options_.huber);
      fit_.information.noalias() += weight * slope * slope.transpose();
      score += weight * u * slope;
    }
    if ((k + 1) % options_.block_rows == 0 || k + 1 == present_.rows()) {
      fit_.scatter.noalias() += score * score.transpose();
      gradient_ += score;
      score.setZero();
    }
  }
}

// Solves (H + damping diag(H)) step = -g, in which H and g include the prior.
// The prior makes H positive definite even if the data do not determine an
// entry. Entries at a bound stay there if descent leads outwards.
VectorXd Minimiser::Step(double damping) const {
  const VectorXd precision = PriorPrecision();
  MatrixXd h = share_ * fit_.information;
  h.diagonal() += precision;
  VectorXd g = share_ * gradient_ +
               precision.cwiseProduct(fit_.point - bounds_.prior_mean);
  h.diagonal() *= 1.0 + damping;
  for (Index i = 0; i < g.size(); ++i) {
    const bool pressed = (fit_.point[i] <= bounds_.lower[i] && g[i] > 0.0) ||
                         (fit_.point[i] >= bounds_.upper[i] && g[i] < 0.0);
    if (pressed) {
      h.row(i).setZero();
      h.col(i).setZero();
      h(i, i) = 1.0;
      g[i] = 0.0;
    }
  }
  return -h.ldlt().solve(g);
}

// Takes one step; @returns false if none lowers the loss by enough.
bool Minimiser::Improve() {
  constexpr int kTrials = 5;
  constexpr double kDampingFactor = 8.0;
  const double before = Loss(present_, fit_.point);
  for (int trial = 0; trial < kTrials; ++trial) {
    const VectorXd point = Inside(fit_.point + Step(damping_));
    const MatrixXd r = residuals_({point}).front();
    const double after = Loss(r, point);
    if (after < before) {
      fit_.point = point;
      present_ = r;
      damping_ /= kDampingFactor;
      return before - after > options_.tolerance * before;
    }
    damping_ *= kDampingFactor;
  }
  return false;
}

RobustFit Minimiser::Run(const VectorXd& start) {
  fit_.point = Inside(start);
  present_ = residuals_({fit_.point}).front();
  bool improves = true;
  for (int i = 0; improves && i < options_.max_iterations; ++i) {
    // The scale is fixed within an iteration: losses before and after a step
    // are comparable only in the same units, and so are the slopes.
    Rescale();
    Linearise();
    improves = Improve();
  }
  // Information and scatter stay those of the last linearisation, at most a
  // step before the point: another one would take p evaluations of the
  // residuals.
  Rescale();
  fit_.residuals = present_;
  fit_.damping = damping_;
  fit_.settled = !improves;
  return fit_;
}

}  // namespace

RobustFit FitRobustly(const ResidualFunction& residuals, const VectorXd& start,
                      const PointBounds& bounds,
                      const RobustFitOptions& options) {
  const Index p = start.size();
  Require(bounds.lower.size() == p && bounds.upper.size() == p &&
              bounds.prior_mean.size() == p && bounds.prior_sd.size() == p,
          "bounds and prior must have the size of the point");
  return Minimiser(residuals, bounds, options).Run(start);
}

VectorXd StandardDeviations(const RobustFit& fit, const PointBounds& bounds,
                            const std::vector<Index>& kept) {
  // Leaving out rows and columns before the inversion takes the other entries
  // as known.
  MatrixXd h = fit.information(kept, kept);
  MatrixXd middle = fit.scatter(kept, kept);
  const VectorXd precision = bounds.prior_sd(kept).array().square().inverse();
  h.diagonal() += precision;
  middle.diagonal() += precision;
  const MatrixXd inverse = h.inverse();
  const MatrixXd sandwich = inverse * middle * inverse;
  return inverse.diagonal().cwiseMax(sandwich.diagonal()).cwiseSqrt();
}

}  // namespace fdi::simulator
