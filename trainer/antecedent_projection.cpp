#include "trainer/antecedent_projection.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "diagnosis/error.h"

namespace fdi::trainer {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
// Heights from here on belong to the core.
constexpr double kCoreHeight = 0.95;
// Lower bound of a width as a share of the range of the regressor.
constexpr double kMinWidthShare = 1e-3;

// Indices that sort x; equal x by membership, so that row order is no matter.
std::vector<Index> SortedOrder(const Eigen::Ref<const VectorXd>& x,
                               const Eigen::Ref<const VectorXd>& memberships) {
  std::vector<Index> order(static_cast<std::size_t>(x.size()));
  std::iota(order.begin(), order.end(), Index{0});
  std::sort(order.begin(), order.end(), [&](Index a, Index b) {
    return x(a) != x(b) ? x(a) < x(b) : memberships(a) < memberships(b);
  });
  return order;
}

// The width w that minimizes Σ (h − exp(−d²/2w²))² over distances d > 0, by
// golden section over log w; `longest` bounds it from above.
double FitWidth(const VectorXd& distances, const VectorXd& heights,
                double min_width) {
  if (distances.size() == 0 || distances.maxCoeff() <= min_width) {
    return min_width;
  }
  const auto error = [&](double log_width) {
    const double scale = -0.5 * std::exp(-2.0 * log_width);
    return (heights.array() - (scale * distances.array().square()).exp())
        .square()
        .sum();
  };
  constexpr double kGolden = 0.6180339887498949;
  double low = std::log(min_width);
  double high = std::log(10.0 * distances.maxCoeff());
  double left = high - kGolden * (high - low);
  double right = low + kGolden * (high - low);
  double error_left = error(left);
  double error_right = error(right);
  while (high - low > 1e-4) {
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

}  // namespace

Envelope ProjectMembership(const Eigen::Ref<const VectorXd>& x,
                           const Eigen::Ref<const VectorXd>& memberships) {
  Require(x.size() > 0 && x.size() == memberships.size(),
          "x and memberships need the same size, at least 1");
  const std::vector<Index> order = SortedOrder(x, memberships);
  Envelope envelope{x(order), memberships(order)};
  VectorXd& h = envelope.heights;
  Index peak = 0;
  const double height = h.maxCoeff(&peak);
  for (Index k = 1; k <= peak; ++k) {
    h(k) = std::max(h(k), h(k - 1));
  }
  for (Index k = h.size() - 2; k > peak; --k) {
    h(k) = std::max(h(k), h(k + 1));
  }
  h = height > 0.0 ? VectorXd(h / height) : VectorXd::Ones(h.size());
  return envelope;
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
    const double range = column.maxCoeff() - column.minCoeff();
    std::size_t lowest = 0;
    std::size_t highest = 0;
    for (std::size_t i = 0; i < c; ++i) {
      if (!(range > 0.0)) {
        sets[i][j] = {column(0), column(0), kInfinity, kInfinity};
        continue;
      }
      sets[i][j] = FitFuzzySet(
          ProjectMembership(column, memberships.col(static_cast<Index>(i))),
          kMinWidthShare * range);
      const auto middle = [&](std::size_t rule) {
        return sets[rule][j].left_center + sets[rule][j].right_center;
      };
      lowest = middle(i) < middle(lowest) ? i : lowest;
      highest = middle(i) > middle(highest) ? i : highest;
    }
    sets[lowest][j].left_width = kInfinity;
    sets[highest][j].right_width = kInfinity;
  }
  return sets;
}

}  // namespace fdi::trainer
