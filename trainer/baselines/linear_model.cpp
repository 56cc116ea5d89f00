#include "trainer/baselines/linear_model.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Cholesky>

#include "diagnosis/error.h"
#include "trainer/regression.h"

namespace fdi::trainer {
namespace {

constexpr double kRidge = 1e-6;
constexpr int kLongestOrder = 6;
constexpr Eigen::Index kRowsPerRegressor = 10;

std::vector<Regressor> ArxRegressors(Signal output,
                                     const std::vector<Signal>& inputs,
                                     int order) {
  std::vector<Regressor> regressors;
  for (const Signal input : inputs) {
    for (int lag = 0; lag <= order; ++lag) {
      regressors.push_back({input, lag});
    }
  }
  for (int lag = 1; lag <= order; ++lag) {
    regressors.push_back({output, lag});
  }
  return regressors;
}

Eigen::VectorXd Residuals(const LinearModel& model,
                          std::span<const Stretch> stretches) {
  const RegressionData data =
      BuildRegression(stretches, model.regressors, model.output);
  const Eigen::Map<const Eigen::VectorXd> slopes(
      model.slopes.data(), static_cast<Eigen::Index>(model.slopes.size()));
  return (data.y - data.x * slopes).array() - model.intercept;
}

}  // namespace

LinearModel FitLinear(std::string name, Signal output,
                      const std::vector<Regressor>& regressors,
                      std::span<const Stretch> stretches) {
  LinearModel model;
  model.name = std::move(name);
  model.output = output;
  model.regressors = regressors;
  const RegressionData data = BuildRegression(stretches, regressors, output);
  if (data.x.rows() < kRowsPerRegressor * data.x.cols()) {
    throw DataError("baseline " + model.name + ": " +
                    std::to_string(data.x.rows()) +
                    " samples of normal operation do not suffice for " +
                    std::to_string(data.x.cols()) + " regressors");
  }
  const double rows = static_cast<double>(data.x.rows());
  const Eigen::RowVectorXd mean = data.x.colwise().mean();
  Eigen::MatrixXd x = data.x.rowwise() - mean;
  const Eigen::RowVectorXd sd =
      (x.colwise().squaredNorm() / rows).cwiseSqrt().cwiseMax(1e-9);
  x.array().rowwise() /= sd.array();
  const double y_mean = data.y.mean();
  Eigen::MatrixXd normal = x.transpose() * x;
  normal.diagonal().array() += kRidge * rows;
  const Eigen::VectorXd scaled =
      normal.ldlt().solve(x.transpose() * (data.y.array() - y_mean).matrix());
  const Eigen::VectorXd slopes =
      (scaled.array() / sd.transpose().array()).matrix();
  model.slopes.assign(slopes.begin(), slopes.end());
  model.intercept = y_mean - mean.dot(slopes);
  const Eigen::VectorXd residuals = Residuals(model, stretches);
  model.residual_mean = residuals.mean();
  model.residual_sd = std::max(
      1e-9,
      std::sqrt((residuals.array() - model.residual_mean).square().mean()));
  return model;
}

LinearModel FitArx(std::string name, Signal output,
                   const std::vector<Signal>& inputs,
                   std::span<const Stretch> training,
                   std::span<const Stretch> validation) {
  LinearModel best;
  double least = std::numeric_limits<double>::infinity();
  for (int order = 1; order <= kLongestOrder; ++order) {
    LinearModel model =
        FitLinear(name, output, ArxRegressors(output, inputs, order), training);
    const double mse = Residuals(model, validation).array().square().mean();
    if (mse < least) {
      least = mse;
      best = std::move(model);
    }
  }
  if (best.regressors.empty()) {
    throw DataError("baseline " + name +
                    ": no normal operation is left to validate it");
  }
  return best;
}

LinearPredictor::LinearPredictor(const LinearModel& model) : model_(&model) {
  int longest = 0;
  for (const Regressor& regressor : model.regressors) {
    longest = std::max(longest, regressor.lag);
  }
  length_ = static_cast<std::size_t>(longest) + 1;
}

void LinearPredictor::Reset() {
  past_.clear();
}

std::optional<double> LinearPredictor::Step(const Sample& sample) {
  past_.push_back(sample);
  if (past_.size() > length_) {
    past_.erase(past_.begin());
  }
  if (past_.size() < length_ || !sample.Has(model_->output)) {
    return std::nullopt;
  }
  double prediction = model_->intercept;
  for (std::size_t j = 0; j < model_->regressors.size(); ++j) {
    const Regressor& regressor = model_->regressors[j];
    const Sample& at =
        past_[length_ - 1 - static_cast<std::size_t>(regressor.lag)];
    if (!at.Has(regressor.signal)) {
      return std::nullopt;
    }
    prediction += model_->slopes[j] * at[regressor.signal];
  }
  const double residual =
      (sample[model_->output] - prediction - model_->residual_mean) /
      model_->residual_sd;
  return std::isfinite(residual) ? std::optional(residual) : std::nullopt;
}

std::vector<double> StandardResiduals(const LinearModel& model,
                                      const Stretch& stretch) {
  LinearPredictor predictor(model);
  std::vector<double> residuals;
  for (const Sample& sample : stretch.samples) {
    if (const auto residual = predictor.Step(sample)) {
      residuals.push_back(*residual);
    }
  }
  return residuals;
}

}  // namespace fdi::trainer
