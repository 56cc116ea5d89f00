#include "trainer/observer_adaptation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>

#include <Eigen/Cholesky>

#include "base/error.h"
#include "diagnosis/model/fault_catalogue.h"
#include "trainer/regression.h"
#include "trainer/statistics.h"

namespace fdi::trainer {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::RowVectorXd;
using Eigen::VectorXd;

constexpr std::size_t kPenaltyFolds = 4;
constexpr int kMinFitRows = 20;
// λ in rows: with |z| ≤ 1 it pulls a coefficient to 0 as strongly as λ rows
// with full weight at the end of the range pull it to their targets.
constexpr std::array<double, 5> kPenalties{0.03, 0.3, 3.0, 30.0, 300.0};
constexpr double kSharedPenalty = 0.01;  // of what all rules have in common
constexpr double kWorthAdapting = 0.98;  // of the normal model's error
constexpr int kAdaptationRounds = 40;
constexpr double kCensoredTolerance = 1e-3;  // of the span of the output

// The rows of all stretches of a condition in order of time.
struct Rows {
  RegressionData data;
  std::vector<int> fold;
  std::vector<double> shares;  // strength over that of the condition
};

// Folds are blocks of consecutive rows of each stretch. Neighbouring rows are
// correlated, and folds at random would test a model on copies of its own data.
Rows CollectRows(const TsModel& normal, const Condition& condition) {
  Rows rows;
  std::vector<RegressionData> parts;
  Index count = 0;
  for (std::size_t i = 0; i < condition.training.size(); ++i) {
    const Stretch whole = WholeStretch(condition, i);
    parts.push_back(
        BuildRegression({&whole, 1}, normal.regressors, normal.output));
    const Index n = parts.back().y.size();
    const std::size_t lag = whole.samples.size() - static_cast<std::size_t>(n);
    for (Index k = 0; k < n; ++k) {
      rows.fold.push_back(
          static_cast<int>(k * static_cast<Index>(kPenaltyFolds) / n));
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

// Columns [w_1 z, w_1, w_2 z, ..., z, 1]. The last ones, of δ_0, are divided by
// √0.01, so that with θ_0 = √0.01 δ_0 one ridge serves both penalties,
//
//     λ Σ_i |δ_i|² + 0.01 λ |δ_0|² = λ |θ|²;
//
// AddTo() undoes that.
MatrixXd Design(const MatrixXd& weights, const MatrixXd& x,
                const Scale& scale) {
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

// The part of the least-squares systems of a condition, by penalty and fold,
// that does not depend on the targets.
struct Systems {
  std::vector<VectorXd> uses;                 // per fold: 1 where a row counts
  std::vector<std::vector<Index>> members;    // per fold: where it is 0
  std::vector<MatrixXd> parts;                // the design of these rows
  std::vector<Eigen::LLT<MatrixXd>> factors;  // per penalty: per fold
  MatrixXd all;                               // DᵀD, lower triangle

  // For all rows: needed for a single penalty only.
  Eigen::LLT<MatrixXd> Whole(double penalty) const {
    return Penalized(all, penalty);
  }

  // Eigen's LLT reads only the lower triangle.
  static Eigen::LLT<MatrixXd> Penalized(MatrixXd gram, double penalty) {
    gram.diagonal().array() += penalty;
    return Eigen::LLT<MatrixXd>(gram);
  }
};

// Forming DᵀD costs N p² for N rows and p columns. It is done once for the rows
// of each fold; sums of these serve the folds and the whole, and λ is added
// only to the diagonal, so that all factors share the work.
Systems Factorize(const MatrixXd& design, const std::vector<int>& folds) {
  Systems systems;
  // Lower triangles; of the rows of each fold, then of those that it uses.
  const MatrixXd zero = MatrixXd::Zero(design.cols(), design.cols());
  std::vector<MatrixXd> own(kPenaltyFolds, zero);
  std::vector<MatrixXd> grams(kPenaltyFolds + 1, zero);
  for (std::size_t f = 0; f < kPenaltyFolds; ++f) {
    std::vector<Index> members;
    VectorXd use = VectorXd::Ones(design.rows());
    for (Index k = 0; k < design.rows(); ++k) {
      if (folds[static_cast<std::size_t>(k)] == static_cast<int>(f)) {
        members.push_back(k);
        use(k) = 0.0;
      }
    }
    systems.parts.emplace_back(design(members, Eigen::all));
    own[f].selfadjointView<Eigen::Lower>().rankUpdate(
        systems.parts.back().transpose());
    systems.members.push_back(std::move(members));
    systems.uses.push_back(std::move(use));
  }
  systems.uses.push_back(VectorXd::Ones(design.rows()));
  for (std::size_t f = 0; f <= kPenaltyFolds; ++f) {
    for (std::size_t other = 0; other < kPenaltyFolds; ++other) {
      if (other != f) {
        grams[f] += own[other];
      }
    }
  }
  for (const double penalty : kPenalties) {
    for (std::size_t f = 0; f < kPenaltyFolds; ++f) {
      systems.factors.push_back(Systems::Penalized(grams[f], penalty));
    }
  }
  systems.all = std::move(grams.back());
  return systems;
}

// The targets that a model is fitted to.
struct Target {
  VectorXd y;
  bool censored{false};          // Some y are at the limit.
  std::vector<VectorXd> scores;  // per fold, then all: Dᵀ(y − base); else empty
};

// Residuals as the engine forms them; NaN where they say nothing.
std::vector<double> Residuals(const TsModel& limits, const VectorXd& y,
                              const VectorXd& predicted) {
  std::vector<double> residuals;
  for (Index k = 0; k < y.size(); ++k) {
    residuals.push_back(Residual(
        limits, y(k),
        std::clamp(predicted(k), limits.output_min, limits.output_max)));
  }
  return residuals;
}

// θ back in the units of the regressors: with z_j = (x_j − m_j)/h_j,
//
//     δᵀ[z 1] = Σ_j (δ_j/h_j) x_j + δ_const − Σ_j (δ_j/h_j) m_j.
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

void RequireEnough(const Condition& condition, const Rows& rows) {
  if (rows.data.y.size() < kMinFitRows) {
    throw DataError(FaultName(condition.fault) + " at strength " +
                    std::to_string(condition.strength) + ": " +
                    std::to_string(rows.data.y.size()) + " samples, at least " +
                    std::to_string(kMinFitRows) + " are needed");
  }
}

}  // namespace

AdaptedModel AdaptModel(const TsModel& normal, const Condition& condition) {
  return Adaptation(normal, condition).Fit(condition);
}

struct Adaptation::Impl {
  Impl(const TsModel& model, const Condition& condition)
      : normal(model), scale(ScaleOf(model)) {
    const Rows rows = CollectRows(normal, condition);
    RequireEnough(condition, rows);
    x = rows.data.x;
    shares = rows.shares;
    const MatrixXd weights = DegreesOfFulfilment(normal.rules, x);
    design = Design(weights, x, scale);
    design.array().colwise() *=
        Eigen::Map<const Eigen::ArrayXd>(shares.data(), x.rows());
    base = Predict(normal.rules, x, weights);
    systems = Factorize(design, rows.fold);
  }

  VectorXd Predicted(const VectorXd& theta) const {
    return base + design * theta;
  }
  Target TargetOf(const VectorXd& y) const;
  VectorXd Solve(const Target& target, const Eigen::LLT<MatrixXd>& factor,
                 std::size_t fold, VectorXd theta) const;
  VectorXd CrossPredict(const Target& target, std::size_t penalty,
                        std::vector<VectorXd>& thetas) const;

  TsModel normal;
  Scale scale;
  MatrixXd x;
  std::vector<double> shares;
  MatrixXd design;
  VectorXd base;  // the normal model's
  Systems systems;
};

Target Adaptation::Impl::TargetOf(const VectorXd& y) const {
  // Censored targets change with every round of Solve(), so that no scores can
  // be prepared for them.
  Target target{y, y.maxCoeff() >= normal.saturation, {}};
  if (target.censored) {
    return target;
  }
  const VectorXd off = y - base;
  std::vector<VectorXd> own;
  VectorXd all = VectorXd::Zero(design.cols());
  for (std::size_t f = 0; f < kPenaltyFolds; ++f) {
    own.push_back(systems.parts[f].transpose() * off(systems.members[f]));
    all += own.back();
  }
  for (const VectorXd& left_out : own) {
    target.scores.push_back(all - left_out);
  }
  target.scores.push_back(std::move(all));
  return target;
}

// θ for the rows that `fold` uses (kPenaltyFolds: all), starting from `theta`.
VectorXd Adaptation::Impl::Solve(const Target& target,
                                 const Eigen::LLT<MatrixXd>& factor,
                                 std::size_t fold, VectorXd theta) const {
  if (!target.censored) {
    return factor.solve(target.scores[fold]);
  }
  // Readings at the limit hide the true value. The error there is one-sided and
  // is minimized by alternating between
  //
  //     t_k = max(y_k, ŷ_k)   where y_k is at the limit, else y_k,
  //     θ = argmin Σ_k (t_k − ŷ_k(θ))² + λ |θ|².
  //
  // Neither step raises the one-sided error with its ridge. The matrix stays
  // the same, so that a round costs one solution of a factored system.
  const VectorXd& y = target.y;
  const double span = y.maxCoeff() - y.minCoeff();
  VectorXd predicted = Predicted(theta);
  for (int round = 0; round < kAdaptationRounds; ++round) {
    const VectorXd reached =
        (y.array() >= normal.saturation).select(y.cwiseMax(predicted), y);
    theta = factor.solve(design.transpose() *
                         (reached - base).cwiseProduct(systems.uses[fold]));
    const VectorXd before = std::exchange(predicted, Predicted(theta));
    if ((predicted - before).lpNorm<Eigen::Infinity>() <
        kCensoredTolerance * span) {
      break;
    }
  }
  return theta;
}

// Every row predicted by a model of the other folds; those of the penalty
// before, in `thetas`, are where they start.
VectorXd Adaptation::Impl::CrossPredict(const Target& target,
                                        std::size_t penalty,
                                        std::vector<VectorXd>& thetas) const {
  VectorXd predicted = base;
  for (std::size_t f = 0; f < kPenaltyFolds; ++f) {
    thetas[f] = Solve(target, systems.factors[penalty * kPenaltyFolds + f], f,
                      std::move(thetas[f]));
    predicted(systems.members[f]) += systems.parts[f] * thetas[f];
  }
  return predicted;
}

Adaptation::Adaptation(const TsModel& normal, const Condition& condition) {
  Require(!IsFreeRunning(normal), "only a model of measured past is adapted");
  impl_ = std::make_unique<Impl>(normal, condition);
}
Adaptation::~Adaptation() = default;
Adaptation::Adaptation(Adaptation&&) noexcept = default;
Adaptation& Adaptation::operator=(Adaptation&&) noexcept = default;

bool Adaptation::Serves(const Condition& condition) const {
  const Rows rows = CollectRows(impl_->normal, condition);
  // Exact equality is meant: a fault that leaves the regressors alone keeps
  // their bits, any other one has a system of its own.
  return rows.data.x == impl_->x && rows.shares == impl_->shares;
}

AdaptedModel Adaptation::Fit(const Condition& condition) const {
  const VectorXd y = CollectRows(impl_->normal, condition).data.y;
  Require(y.size() == impl_->base.size(), "other rows than those prepared");
  AdaptedModel adapted;
  adapted.model = Widened(impl_->normal, y);
  std::vector<double> best = Residuals(adapted.model, y, impl_->base);
  double error = kWorthAdapting * MeanSquare(best);
  std::optional<std::size_t> chosen;
  const Target target = impl_->TargetOf(y);
  std::vector<VectorXd> thetas(kPenaltyFolds,
                               VectorXd::Zero(impl_->design.cols()));
  for (std::size_t p = 0; p < kPenalties.size(); ++p) {
    std::vector<double> residuals =
        Residuals(adapted.model, y, impl_->CrossPredict(target, p, thetas));
    const double square = MeanSquare(residuals);
    if (square < error) {
      error = square;
      best = std::move(residuals);
      chosen = p;
    }
  }
  if (chosen) {
    AddTo(adapted.model,
          impl_->Solve(target, impl_->systems.Whole(kPenalties[*chosen]),
                       kPenaltyFolds, thetas.front()),
          impl_->scale);
  } else {
    // Not the widened copy: nothing speaks for outputs beyond the usual ones.
    adapted.model = impl_->normal;
  }
  for (Index k = 0; k < y.size(); ++k) {
    const double residual = best[static_cast<std::size_t>(k)];
    if (!std::isnan(residual)) {
      adapted.residuals.push_back(residual);
      adapted.outputs.push_back(y(k));
    }
  }
  return adapted;
}

}  // namespace fdi::trainer
