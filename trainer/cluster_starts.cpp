#include "trainer/cluster_starts.h"

#include <limits>
#include <random>

namespace fdi::trainer {
namespace {

using Eigen::ArrayXd;
using Eigen::Index;
using Eigen::MatrixXd;

// A number in [0, 1) of 53 random bits: the library's distributions are not
// the same everywhere.
double Uniform(std::mt19937_64& generator) {
  return static_cast<double>(generator() >> 11U) * 0x1p-53;
}

}  // namespace

FuzzyPartition DrawCenters(const Eigen::Ref<const MatrixXd>& z,
                           Index num_clusters, unsigned seed) {
  std::mt19937_64 generator(seed);
  FuzzyPartition start;
  start.centers.resize(num_clusters, z.cols());
  start.covariances.assign(static_cast<std::size_t>(num_clusters),
                           MatrixXd::Identity(z.cols(), z.cols()));
  ArrayXd nearest = ArrayXd::Ones(z.rows());
  for (Index i = 0; i < num_clusters; ++i) {
    double left = Uniform(generator) * nearest.sum();
    Index k = 0;
    while (k + 1 < z.rows() && left >= nearest(k)) {
      left -= nearest(k);
      ++k;
    }
    start.centers.row(i) = z.row(k);
    const ArrayXd squared =
        (z.rowwise() - z.row(k)).rowwise().squaredNorm().array();
    nearest = i == 0 ? squared : nearest.min(squared).eval();
  }
  return start;
}

FuzzyPartition DrawMemberships(Index rows, Index num_clusters, unsigned seed) {
  std::mt19937_64 generator(seed);
  FuzzyPartition start;
  start.memberships = MatrixXd::NullaryExpr(
      rows, num_clusters, [&generator] { return Uniform(generator); });
  const ArrayXd sum = start.memberships.rowwise().sum().array().max(
      std::numeric_limits<double>::min());
  start.memberships.array().colwise() /= sum;
  return start;
}

}  // namespace fdi::trainer
