#pragma once

#include <functional>
#include <vector>

#include <Eigen/Core>

namespace fdi::simulator {

/// Residuals at several points: one matrix (instants x channels) per point. The
/// points of one call are independent.
using ResidualFunction = std::function<std::vector<Eigen::MatrixXd>(
    const std::vector<Eigen::VectorXd>& points)>;

/// Bounds and prior of a point; p entries each.
struct PointBounds {
  Eigen::VectorXd lower;
  Eigen::VectorXd upper;
  Eigen::VectorXd prior_mean;
  Eigen::VectorXd prior_sd;
};

struct RobustFitOptions {
  int max_iterations{10};
  double difference_step{0.02};  ///< For the numeric Jacobian.
  double huber{1.345};           ///< Corner of the loss, in scales.
  double tolerance{2e-3};        ///< Relative decrease of the loss to stop.
  Eigen::VectorXd least_scale;   ///< Per channel: transmitter noise.
  Eigen::Index block_rows{60};   ///< Block length for estimating `scatter`.
  double damping{1e-2};          ///< In the first iteration.
};

/// Result of a fit; see StandardDeviations().
struct RobustFit {
  Eigen::VectorXd point;
  Eigen::VectorXd scale;        ///< Per channel.
  Eigen::MatrixXd information;  ///< p x p, sum of w J'J / scale^2.
  Eigen::MatrixXd scatter;      ///< p x p, sum of the blocks' scores s s'.
  Eigen::MatrixXd residuals;    ///< At the point.
  /// For the next iteration: a fit that begins with it at `point` goes on as if
  /// this one had not ended.
  double damping{RobustFitOptions{}.damping};
  bool settled{false};  ///< It ended because nothing lowers the loss by enough.
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
/// discounts correlated residuals. Both are re-estimated in each iteration.
///
/// @param start p entries, clamped to the bounds.
RobustFit FitRobustly(const ResidualFunction& residuals,
                      const Eigen::VectorXd& start, const PointBounds& bounds,
                      const RobustFitOptions& options);

/// Uncertainty of each of the `kept` entries of the point, given the others:
/// the larger of the root of H^-1 and that of the sandwich H^-1 (scatter + P)
/// H^-1, where H = information + P and P is the prior's precision. The sandwich
/// is valid for residuals that are neither white nor independent.
Eigen::VectorXd StandardDeviations(const RobustFit& fit,
                                   const PointBounds& bounds,
                                   const std::vector<Eigen::Index>& kept);

}  // namespace fdi::simulator
