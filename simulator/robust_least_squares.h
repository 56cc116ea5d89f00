#pragma once

#include <functional>
#include <vector>

#include <Eigen/Core>

namespace fdi::simulator {

/// Residuals at several points: one matrix (instants x channels) per point.
/// Points of one call do not depend on each other.
using ResidualFunction = std::function<std::vector<Eigen::MatrixXd>(
    const std::vector<Eigen::VectorXd>& points)>;

/// Where a point may lie, and what is believed of it before; p entries each.
struct PointBounds {
  Eigen::VectorXd lower;
  Eigen::VectorXd upper;
  Eigen::VectorXd prior_mean;
  Eigen::VectorXd prior_sd;
};

struct RobustFitOptions {
  int max_iterations{10};
  double difference_step{0.02};  ///< Of the numeric Jacobian.
  double huber{1.345};           ///< Corner of the loss, in scales.
  double tolerance{2e-3};        ///< Relative fall of the loss that ends it.
  Eigen::VectorXd least_scale;   ///< Per channel: noise of the transmitter.
  Eigen::Index block_rows{60};   ///< Of the blocks that estimate `scatter`.
};

/// Outcome of a fit; see StandardDeviations().
struct RobustFit {
  Eigen::VectorXd point;
  Eigen::VectorXd scale;        ///< Per channel.
  Eigen::MatrixXd information;  ///< p x p, sum of w J'J / scale^2.
  Eigen::MatrixXd scatter;      ///< p x p, sum of the blocks' scores s s'.
  Eigen::MatrixXd residuals;    ///< At the point.
};

/// Mean of Huber's loss rho(r_kj / s_j) over all residuals.
double MeanHuberLoss(const Eigen::MatrixXd& residuals,
                     const Eigen::VectorXd& scale, double huber);

/// Minimises over `point`, inside its bounds,
///
///   c sum_kj rho(r_kj / s_j) + 1/2 sum_i ((point_i - mean_i) / sd_i)^2
///
/// by Levenberg-Marquardt with Huber's loss rho. The scale s_j of channel j is
/// the residuals' median absolute deviation, at least `least_scale`; c <= 1
/// discounts rows whose residuals resemble their neighbours'. Both are found
/// anew in each iteration.
///
/// @param start p entries, moved into the bounds.
RobustFit FitRobustly(const ResidualFunction& residuals,
                      const Eigen::VectorXd& start, const PointBounds& bounds,
                      const RobustFitOptions& options);

/// How far the data leave each of the `kept` entries of the point open, the
/// others known: the larger of the root of H^-1 and of the sandwich
/// H^-1 (scatter + P) H^-1 with H = information + P, P the prior's. The
/// sandwich holds for residuals that are neither white nor independent.
Eigen::VectorXd StandardDeviations(const RobustFit& fit,
                                   const PointBounds& bounds,
                                   const std::vector<Eigen::Index>& kept);

}  // namespace fdi::simulator
