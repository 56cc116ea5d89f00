#include "trainer/cluster_antecedents.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <string>
#include <utility>

#include "base/error.h"
#include "trainer/gustafson_kessel.h"

namespace fdi::trainer {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
// Heights from here on belong to the core.
constexpr double kCoreHeight = 0.95;
// Lower bound of a width as a share of the range of the regressor.
constexpr double kMinWidthShare = 1e-3;

// Points that a width is fitted to; more only cost time.
constexpr Index kMaxFitPoints = 200;

// The order of equal values is arbitrary: MergeTies() makes it irrelevant.
std::vector<Index> SortedOrder(const Eigen::Ref<const VectorXd>& x) {
  std::vector<Index> order(static_cast<std::size_t>(x.size()));
  std::iota(order.begin(), order.end(), Index{0});
  std::sort(order.begin(), order.end(),
            [&x](Index a, Index b) { return x(a) < x(b); });
  return order;
}

// Gives points at the same position the largest of their heights, so that the
// order in which they came is no matter.
void MergeTies(const VectorXd& x, VectorXd& h) {
  for (Index k = 1; k < h.size(); ++k) {
    h(k) = x(k) == x(k - 1) ? std::max(h(k), h(k - 1)) : h(k);
  }
  for (Index k = h.size() - 2; k >= 0; --k) {
    h(k) = x(k) == x(k + 1) ? h(k + 1) : h(k);
  }
}

// The envelope of memberships over ascending positions.
Envelope MakeEnvelope(VectorXd positions, VectorXd memberships) {
  Envelope envelope{std::move(positions), std::move(memberships)};
  VectorXd& h = envelope.heights;
  MergeTies(envelope.positions, h);
  Index peak = 0;
  const double height = h.maxCoeff(&peak);
  for (Index k = 1; k <= peak; ++k) {
    h(k) = std::max(h(k), h(k - 1));
  }
  for (Index k = h.size() - 2; k > peak; --k) {
    h(k) = std::max(h(k), h(k + 1));
  }
  if (height > 0.0) {
    h /= height;
  } else {
    // A cluster without members has no shape: its set is 1 everywhere.
    h.setOnes();
  }
  return envelope;
}

// The width w that minimizes Σ (h − exp(−d²/2w²))² over distances d > 0, by
// golden section over log w.
// In log w the search is as fine for narrow sets as for wide ones. At 10 times
// the largest distance the Gaussian is above 0.995 on all points, so that wider
// ones would look the same.
double FitWidth(const VectorXd& all_distances, const VectorXd& all_heights,
                double min_width) {
  const Index size = all_distances.size();
  if (size == 0 || all_distances.maxCoeff() <= min_width) {
    return min_width;
  }
  const auto kept = Eigen::seq(0, size - 1, 1 + size / kMaxFitPoints);
  const VectorXd distances = all_distances(kept);
  const VectorXd heights = all_heights(kept);
  const auto error = [&](double log_width) {
    const double scale = -0.5 * std::exp(-2.0 * log_width);
    return (heights.array() - (scale * distances.array().square()).exp())
        .square()
        .sum();
  };
  constexpr double kGolden = 0.6180339887498949;
  double low = std::log(min_width);
  double high = std::log(10.0 * all_distances.maxCoeff());
  double left = high - kGolden * (high - low);
  double right = low + kGolden * (high - low);
  double error_left = error(left);
  double error_right = error(right);
  while (high - low > 1e-3) {
    if (error_left <= error_right) {
      high = right;
      right = left;
      error_right = error_left;
      left = high - kGolden * (high - low);
      error_left = error(left);
    } else {
      low = left;
      left = right;
      error_left = error_right;
      right = low + kGolden * (high - low);
      error_right = error(right);
    }
  }
  return std::exp(0.5 * (low + high));
}

double Middle(const FuzzySet& set) {
  return 0.5 * (set.left_center + set.right_center);
}

}  // namespace

Envelope ProjectMembership(const Eigen::Ref<const VectorXd>& x,
                           const Eigen::Ref<const VectorXd>& memberships) {
  Require(x.size() > 0 && x.size() == memberships.size(),
          "x and memberships need the same size, at least 1");
  const std::vector<Index> order = SortedOrder(x);
  return MakeEnvelope(x(order), memberships(order));
}

FuzzySet FitFuzzySet(const Envelope& envelope, double min_width) {
  Require(min_width > 0.0, "min_width must be above 0");
  const VectorXd& x = envelope.positions;
  const VectorXd& h = envelope.heights;
  Require(x.size() > 0 && x.size() == h.size(),
          "an envelope needs as many heights as positions, at least 1");
  Index first = 0;
  while (first + 1 < h.size() && h(first) < kCoreHeight) {
    ++first;
  }
  Index last = h.size() - 1;
  while (last > first && h(last) < kCoreHeight) {
    --last;
  }
  FuzzySet set;
  set.left_center = x(first);
  set.right_center = x(last);
  set.left_width =
      FitWidth(x(first) - x.head(first).array(), h.head(first), min_width);
  const Index right = h.size() - 1 - last;
  set.right_width =
      FitWidth(x.tail(right).array() - x(last), h.tail(right), min_width);
  return set;
}

std::vector<std::vector<FuzzySet>> ProjectAntecedents(
    const Eigen::Ref<const Eigen::MatrixXd>& x,
    const Eigen::Ref<const Eigen::MatrixXd>& memberships) {
  Require(x.rows() > 0 && x.rows() == memberships.rows(),
          "X and U need the same number of rows, at least 1");
  const auto n = static_cast<std::size_t>(x.cols());
  const auto c = static_cast<std::size_t>(memberships.cols());
  std::vector<std::vector<FuzzySet>> sets(c, std::vector<FuzzySet>(n));
  for (std::size_t j = 0; j < n; ++j) {
    const auto column = x.col(static_cast<Index>(j));
    const std::vector<Index> order = SortedOrder(column);
    const VectorXd positions = column(order);
    const double range = positions(positions.size() - 1) - positions(0);
    std::size_t lowest = 0;
    std::size_t highest = 0;
    for (std::size_t i = 0; i < c; ++i) {
      if (!(range > 0.0)) {
        sets[i][j] = {positions(0), positions(0), kInfinity, kInfinity};
        continue;
      }
      const auto u = memberships.col(static_cast<Index>(i));
      sets[i][j] = FitFuzzySet(MakeEnvelope(positions, u(order)),
                               kMinWidthShare * range);
      lowest = Middle(sets[i][j]) < Middle(sets[lowest][j]) ? i : lowest;
      highest = Middle(sets[i][j]) > Middle(sets[highest][j]) ? i : highest;
    }
    sets[lowest][j].left_width = kInfinity;
    sets[highest][j].right_width = kInfinity;
  }
  return sets;
}

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// A column that varies by less than this share of its size is constant.
constexpr double kConstantTolerance = 1e-12;
// Least thickness of a cluster as a share of the deviation of a regressor.
constexpr double kMinThickness = 0.01;
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
// Only y can be constant here, as at the limit of a transmitter; it becomes 0.
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

// With z in the units of the data, and without a partition.
RuleClusters Unclustered(const RegressionData& data,
                         const TakagiSugenoOptions& options) {
  CheckData(data, options.num_rules);
  RuleClusters clusters;
  clusters.columns = VaryingColumns(data.x, options.antecedents);
  clusters.z.resize(data.x.rows(),
                    static_cast<Index>(clusters.columns.size()) + 1);
  clusters.z << data.x(Eigen::all, clusters.columns), data.y;
  return clusters;
}

FuzzyPartition OneCluster(const MatrixXd& z) {
  FuzzyPartition partition;
  partition.memberships = MatrixXd::Ones(z.rows(), 1);
  partition.centers = z.colwise().mean();
  partition.converged = partition.separated = true;
  return partition;
}

// If no regressor varies, z is only y, and clusters of it would have no place
// in the space of the antecedents. The trivial partition would give the same
// rule many times.
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

// y is the last column of z, and the covariance of a cluster without it is the
// upper left block. In the units of the regressors, with D = diag(deviation),
//
//     v_x = D v + mean,   F_x = D (F + 0.01² I) D.
//
// No cluster is thinner than 1 % of a deviation in any direction.
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
    restricted.diagonal().array() += kMinThickness * kMinThickness;
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
  RuleClusters clusters = Unclustered(data, options);
  Standardize(clusters);
  clusters.partition = Cluster(clusters.z, options);
  return clusters;
}

const RuleClusters& KnownClusters::Of(const RegressionData& data,
                                      const TakagiSugenoOptions& options) {
  constexpr std::size_t kMostKnown = 4;
  RuleClusters fresh = Unclustered(data, options);
  const auto same = [&](const Known& known) {
    return known.num_rules == options.num_rules &&
           known.points.rows() == fresh.z.rows() &&
           known.points.cols() == fresh.z.cols() && known.points == fresh.z;
  };
  const auto found = std::ranges::find_if(known_, same);
  if (found != known_.end()) {
    found->clusters.columns = std::move(fresh.columns);
    return found->clusters;
  }
  if (known_.size() == kMostKnown) {
    known_.erase(known_.begin());
  }
  Eigen::MatrixXd points = fresh.z;
  Standardize(fresh);
  fresh.partition = Cluster(fresh.z, options);
  known_.push_back({std::move(points), options.num_rules, std::move(fresh)});
  return known_.back().clusters;
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
