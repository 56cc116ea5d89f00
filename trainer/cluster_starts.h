#pragma once

#include <Eigen/Core>

#include "trainer/gustafson_kessel.h"

namespace fdi::trainer {

/// A start for FitGustafsonKessel(): spheres around centers among the points
/// Z, N×n, each drawn with a probability proportional to the squared distance
/// from the nearest one drawn before. Fills centers and covariances.
FuzzyPartition DrawCenters(const Eigen::Ref<const Eigen::MatrixXd>& z,
                           Eigen::Index num_clusters, unsigned seed);

/// A start for FitGustafsonKessel(): memberships at random, each row summing
/// to 1. All clusters begin in the middle, so that thin parallel ones are not
/// cut across. Fills the memberships.
FuzzyPartition DrawMemberships(Eigen::Index num_points,
                               Eigen::Index num_clusters, unsigned seed);

}  // namespace fdi::trainer
