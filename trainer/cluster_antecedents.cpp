#include "trainer/cluster_antecedents.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <string>

#include "diagnosis/error.h"
#include "trainer/antecedent_projection.h"
#include "trainer/cluster_distance.h"

namespace fdi::trainer {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// A column that varies by less than this share of its size is constant.
constexpr double kConstantTolerance = 1e-12;
// Least thickness of a cluster as a share of the deviation of a regressor.
constexpr double kLeastThickness = 0.01;
// The set of a regressor that tells no rules apart: 1 everywhere.
constexpr FuzzySet kAnyValue{0.0, 0.0, std::numeric_limits<double>::infinity(),
                             std::numeric_limits<double>::infinity()};

void CheckData(const RegressionData& data, int num_rules) {
  Require(data.x.cols() >= 1, "X needs at least one column");
  Require(data.x.rows() == data.y.size(), "X and y need equally many rows");
  Require(num_rules >= 1 && num_rules <= kMaxRules,
          "num_rules must be within 1 to " + std::to_string(kMaxRules));
  Require(data.x.rows() >= num_rules * (data.x.cols() + 1),
          "too few rows: " + std::to_string(data.x.rows()) + " for " +
              std::to_string(num_rules) + " rules with " +
              std::to_string(data.x.cols() + 1) + " parameters each");
  Require(data.x.allFinite() && data.y.allFinite(),
          "X and y must be finite numbers");
}

// The columns of X, or of some of them, that vary.
std::vector<Index> VaryingColumns(const MatrixXd& x, std::vector<Index> among) {
  if (among.empty()) {
    among.resize(static_cast<std::size_t>(x.cols()));
    std::iota(among.begin(), among.end(), Index{0});
  }
  std::sort(among.begin(), among.end());
  std::vector<Index> columns;
  for (const Index j : among) {
    Require(j >= 0 && j < x.cols(), "an antecedent is no column of X");
    const double range = x.col(j).maxCoeff() - x.col(j).minCoeff();
    if (range > kConstantTolerance * x.col(j).cwiseAbs().maxCoeff()) {
      columns.push_back(j);
    }
  }
  return columns;
}

// Scales z to columns of mean 0 and variance 1; keeps what they were.
void Standardize(RuleClusters& clusters) {
  MatrixXd& z = clusters.z;
  clusters.mean = z.colwise().mean();
  z.rowwise() -= clusters.mean;
  clusters.deviation =
      (z.colwise().squaredNorm() / static_cast<double>(z.rows())).cwiseSqrt();
  for (Index j = 0; j < z.cols(); ++j) {
    if (clusters.deviation(j) > 0.0) {
      z.col(j) /= clusters.deviation(j);
    }
  }
}

FuzzyPartition OneCluster(const MatrixXd& z) {
  FuzzyPartition partition;
  partition.memberships = MatrixXd::Ones(z.rows(), 1);
  partition.centers = z.colwise().mean();
  partition.converged = partition.separated = true;
  return partition;
}

FuzzyPartition Cluster(const MatrixXd& z, const TakagiSugenoOptions& options) {
  if (options.num_rules == 1 || z.cols() == 1) {
    return OneCluster(z);
  }
  GustafsonKesselOptions clustering = options.clustering;
  clustering.num_clusters = options.num_rules;
  FuzzyPartition partition = FitGustafsonKessel(z, clustering);
  return partition.separated ? partition : OneCluster(z);
}

std::vector<TsRule> ProjectedRules(const RegressionData& data,
                                   const RuleClusters& clusters) {
  std::vector<TsRule> rules;
  const MatrixXd projected = data.x(Eigen::all, clusters.columns);
  for (const auto& sets :
       ProjectAntecedents(projected, clusters.partition.memberships)) {
    auto& antecedents = rules.emplace_back().antecedents;
    antecedents.assign(static_cast<std::size_t>(data.x.cols()), kAnyValue);
    for (std::size_t j = 0; j < clusters.columns.size(); ++j) {
      antecedents[static_cast<std::size_t>(clusters.columns[j])] = sets[j];
    }
  }
  return rules;
}

std::vector<TsRule> ProductSpaceRules(const RegressionData& data,
                                      const RuleClusters& clusters) {
  const auto m = static_cast<Index>(clusters.columns.size());
  const VectorXd deviation = clusters.deviation.head(m);
  std::vector<TsRule> rules;
  for (const MatrixXd& f : clusters.partition.covariances) {
    const auto i = static_cast<Index>(rules.size());
    const VectorXd center =
        clusters.partition.centers.row(i).head(m).transpose().cwiseProduct(
            deviation) +
        clusters.mean.head(m).transpose();
    MatrixXd restricted = f.topLeftCorner(m, m);
    restricted.diagonal().array() += kLeastThickness * kLeastThickness;
    PlaceByDistance(
        clusters.columns, center,
        deviation.asDiagonal() * restricted * deviation.asDiagonal(),
        data.x.cols(), rules.emplace_back());
  }
  return rules;
}

}  // namespace

RuleClusters FindRuleClusters(const RegressionData& data,
                              const TakagiSugenoOptions& options) {
  CheckData(data, options.num_rules);
  RuleClusters clusters;
  clusters.columns = VaryingColumns(data.x, options.antecedents);
  clusters.z.resize(data.x.rows(),
                    static_cast<Index>(clusters.columns.size()) + 1);
  clusters.z << data.x(Eigen::all, clusters.columns), data.y;
  Standardize(clusters);
  clusters.partition = Cluster(clusters.z, options);
  return clusters;
}

std::vector<TsRule> RuleAntecedents(const RegressionData& data,
                                    const RuleClusters& clusters,
                                    AntecedentKind kind) {
  // The one rule of a single cluster is always in force.
  return kind == AntecedentKind::kProjected ||
                 clusters.partition.covariances.empty()
             ? ProjectedRules(data, clusters)
             : ProductSpaceRules(data, clusters);
}

}  // namespace fdi::trainer
