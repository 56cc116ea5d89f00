#include "trainer/observer_adaptation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include <Eigen/Cholesky>

#include "diagnosis/error.h"
#include "diagnosis/fault_catalogue.h"
#include "trainer/regression.h"

namespace fdi::trainer {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::RowVectorXd;
using Eigen::VectorXd;

constexpr int kFolds = 4;
constexpr int kFewest = 20;
constexpr std::array<double, 5> kPenalties{0.03, 0.3, 3.0, 30.0, 300.0};
constexpr double kSharedPenalty = 0.01;  // of what all rules have in common
constexpr double kWorthAdapting = 0.98;  // of the normal model's error
constexpr int kCensoredRounds = 40;
constexpr double kCensoredTolerance = 1e-3;  // of the span of the output

// The rows of all stretches of a condition in order of time.
struct Rows {
  RegressionData data;
  std::vector<int> fold;
  std::vector<double> shares;  // strength over that of the condition
};

Rows CollectRows(const TsModel& normal, const Condition& condition) {
  Rows rows;
  std::vector<RegressionData> parts;
  Index count = 0;
  for (std::size_t i = 0; i < condition.training.size(); ++i) {
    Stretch whole = condition.training[i];
    const auto& tail = condition.validation[i].samples;
    whole.samples.insert(whole.samples.end(), tail.begin(), tail.end());
    parts.push_back(
        BuildRegression({&whole, 1}, normal.regressors, normal.output));
    whole.strengths.insert(whole.strengths.end(),
                           condition.validation[i].strengths.begin(),
                           condition.validation[i].strengths.end());
    const Index n = parts.back().y.size();
    const std::size_t lag = whole.samples.size() - static_cast<std::size_t>(n);
    for (Index k = 0; k < n; ++k) {
      rows.fold.push_back(static_cast<int>(k * kFolds / n));
      rows.shares.push_back(
          whole.strengths.empty()
              ? 1.0
              : whole.strengths[lag + static_cast<std::size_t>(k)] /
                    condition.strength);
    }
    count += n;
  }
  rows.data.saturation = normal.saturation;
  rows.data.x.resize(count, static_cast<Index>(normal.regressors.size()));
  rows.data.y.resize(count);
  Index at = 0;
  for (const RegressionData& part : parts) {
    rows.data.x.middleRows(at, part.x.rows()) = part.x;
    rows.data.y.segment(at, part.y.size()) = part.y;
    at += part.y.size();
  }
  return rows;
}

// Middle and half width of the trained range of every regressor.
struct Scale {
  RowVectorXd middle;
  RowVectorXd half;
};

Scale ScaleOf(const TsModel& model) {
  const auto n = static_cast<Index>(model.regressors.size());
  const Eigen::Map<const RowVectorXd> low(model.regressor_min.data(), n);
  const Eigen::Map<const RowVectorXd> high(model.regressor_max.data(), n);
  Scale scale{0.5 * (low + high), 0.5 * (high - low)};
  scale.half = (scale.half.array() > 0.0).select(scale.half, 1.0);
  return scale;
}

// Columns [w_1 z, w_1, w_2 z, ..., z, 1], those of a penalty below 1 scaled up.
MatrixXd Design(const TsModel& model, const MatrixXd& x, const Scale& scale) {
  const MatrixXd weights = DegreesOfFulfilment(model.rules, x);
  const Index n = x.cols();
  MatrixXd z(x.rows(), n + 1);
  z.leftCols(n) =
      (x.rowwise() - scale.middle).array().rowwise() / scale.half.array();
  z.col(n).setOnes();
  MatrixXd design(x.rows(), (weights.cols() + 1) * (n + 1));
  for (Index i = 0; i < weights.cols(); ++i) {
    design.middleCols(i * (n + 1), n + 1) = weights.col(i).asDiagonal() * z;
  }
  design.rightCols(n + 1) = z / std::sqrt(kSharedPenalty);
  return design;
}

// What a least-squares problem over some of the rows needs.
class Problem {
 public:
  Problem(const RegressionData& data, const MatrixXd& design,
          const VectorXd& normal)
      : data_(data), design_(design), normal_(normal) {}

  // θ for the rows with a non-zero weight, starting from `theta`.
  VectorXd Solve(const MatrixXd& gram, const VectorXd& use, double penalty,
                 VectorXd theta) const {
    MatrixXd regular = gram;
    regular.diagonal().array() += penalty;
    const Eigen::LLT<MatrixXd> factor(regular);
    const bool censored = data_.y.maxCoeff() >= data_.saturation;
    const double span = data_.y.maxCoeff() - data_.y.minCoeff();
    VectorXd predicted = Predict(theta);
    for (int round = 0; round < (censored ? kCensoredRounds : 1); ++round) {
      const VectorXd target = (data_.y.array() >= data_.saturation)
                                  .select(data_.y.cwiseMax(predicted), data_.y);
      theta = factor.solve(design_.transpose() *
                           (target - normal_).cwiseProduct(use));
      const VectorXd before = std::exchange(predicted, Predict(theta));
      if ((predicted - before).lpNorm<Eigen::Infinity>() <
          kCensoredTolerance * span) {
        break;
      }
    }
    return theta;
  }

  VectorXd Predict(const VectorXd& theta) const {
    return normal_ + design_ * theta;
  }

 private:
  const RegressionData& data_;
  const MatrixXd& design_;
  const VectorXd& normal_;
};

// Residuals as the engine forms them; NaN where they say nothing.
VectorXd Residuals(const TsModel& limits, const VectorXd& y,
                   const VectorXd& predicted) {
  VectorXd residuals(y.size());
  for (Index k = 0; k < y.size(); ++k) {
    residuals(k) = Residual(
        limits, y(k),
        std::clamp(predicted(k), limits.output_min, limits.output_max));
  }
  return residuals;
}

double MeanSquare(const VectorXd& residuals) {
  double sum = 0.0;
  double count = 0.0;
  for (const double r : residuals) {
    sum += std::isnan(r) ? 0.0 : r * r;
    count += std::isnan(r) ? 0.0 : 1.0;
  }
  return count > 0.0 ? sum / count : 0.0;
}

// Every row predicted by a model of the other folds; those of the penalty
// before, in `thetas`, are where they start.
VectorXd CrossPredict(const Problem& problem, const MatrixXd& design,
                      const std::vector<MatrixXd>& grams,
                      const std::vector<VectorXd>& uses, double penalty,
                      std::vector<VectorXd>& thetas) {
  VectorXd predicted(design.rows());
  for (std::size_t f = 0; f < kFolds; ++f) {
    thetas[f] = problem.Solve(grams[f], uses[f], penalty, thetas[f]);
    const VectorXd all = problem.Predict(thetas[f]);
    predicted = (uses[f].array() > 0.0).select(predicted, all);
  }
  return predicted;
}

void AddTo(TsModel& model, const VectorXd& theta, const Scale& scale) {
  const auto n = static_cast<Index>(model.regressors.size());
  const VectorXd shared = theta.tail(n + 1) / std::sqrt(kSharedPenalty);
  for (std::size_t i = 0; i < model.rules.size(); ++i) {
    const VectorXd own =
        theta.segment(static_cast<Index>(i) * (n + 1), n + 1) + shared;
    TsRule& rule = model.rules[i];
    rule.intercept += own(n);
    for (Index j = 0; j < n; ++j) {
      const double slope = own(j) / scale.half(j);
      rule.slopes[static_cast<std::size_t>(j)] += slope;
      rule.intercept -= slope * scale.middle(j);
    }
  }
}

// The normal model with room for outputs that normal operation never has.
TsModel Widened(const TsModel& normal, const VectorXd& y) {
  TsModel model = normal;
  const double margin = 0.5 * (y.maxCoeff() - y.minCoeff());
  model.output_min = std::min(model.output_min, y.minCoeff() - margin);
  model.output_max = std::max(model.output_max, y.maxCoeff() + margin);
  return model;
}

}  // namespace

AdaptedModel AdaptModel(const TsModel& normal, const Condition& condition) {
  Require(!RunsOnItself(normal), "only a model of measured past is adapted");
  const Rows rows = CollectRows(normal, condition);
  const VectorXd& y = rows.data.y;
  if (y.size() < kFewest) {
    throw DataError(FaultName(condition.fault) + " at strength " +
                    std::to_string(condition.strength) + ": " +
                    std::to_string(y.size()) + " samples, at least " +
                    std::to_string(kFewest) + " are needed");
  }
  const Scale scale = ScaleOf(normal);
  MatrixXd design = Design(normal, rows.data.x, scale);
  design.array().colwise() *=
      Eigen::Map<const Eigen::ArrayXd>(rows.shares.data(), y.size());
  const VectorXd base = Predict(normal.rules, rows.data.x);
  const Problem problem(rows.data, design, base);
  const MatrixXd whole = design.transpose() * design;
  std::vector<VectorXd> uses;
  std::vector<MatrixXd> grams;
  for (int f = 0; f < kFolds; ++f) {
    VectorXd use(y.size());
    for (Index k = 0; k < y.size(); ++k) {
      use(k) = rows.fold[static_cast<std::size_t>(k)] == f ? 0.0 : 1.0;
    }
    grams.push_back(design.transpose() * (use.asDiagonal() * design));
    uses.push_back(std::move(use));
  }
  AdaptedModel adapted;
  adapted.model = Widened(normal, y);
  VectorXd best = Residuals(adapted.model, y, base);
  double error = kWorthAdapting * MeanSquare(best);
  std::optional<double> chosen;
  std::vector<VectorXd> thetas(kFolds, VectorXd::Zero(design.cols()));
  for (const double penalty : kPenalties) {
    const VectorXd residuals =
        Residuals(adapted.model, y,
                  CrossPredict(problem, design, grams, uses, penalty, thetas));
    if (MeanSquare(residuals) < error) {
      error = MeanSquare(residuals);
      best = residuals;
      chosen = penalty;
    }
  }
  if (chosen) {
    AddTo(
        adapted.model,
        problem.Solve(whole, VectorXd::Ones(y.size()), *chosen, thetas.front()),
        scale);
  } else {
    adapted.model = normal;
  }
  for (Index k = 0; k < y.size(); ++k) {
    if (!std::isnan(best(k))) {
      adapted.residuals.push_back(best(k));
      adapted.outputs.push_back(y(k));
    }
  }
  return adapted;
}

}  // namespace fdi::trainer
