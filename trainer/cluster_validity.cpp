#include "trainer/cluster_validity.h"

#include "diagnosis/error.h"

namespace fdi::trainer {

double SugenoYasukawa(const Eigen::Ref<const Eigen::MatrixXd>& points,
                      const FuzzyPartition& partition, double fuzziness) {
  const Eigen::MatrixXd& u = partition.memberships;
  const Eigen::MatrixXd& v = partition.centers;
  Require(points.rows() > 0 && u.rows() == points.rows(),
          "memberships need one row per point");
  Require(v.rows() == u.cols() && v.cols() == points.cols(),
          "centers need one row per cluster and one column per dimension");
  const Eigen::RowVectorXd mean = points.colwise().mean();
  double sum = 0.0;
  for (Eigen::Index i = 0; i < v.rows(); ++i) {
    const double separation = (v.row(i) - mean).squaredNorm();
    sum += (u.col(i).array().pow(fuzziness) *
            ((points.rowwise() - v.row(i)).rowwise().squaredNorm().array() -
             separation))
               .sum();
  }
  return sum;
}

}  // namespace fdi::trainer
