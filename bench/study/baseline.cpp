#include "bench/study/baseline.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include <Eigen/Cholesky>

#include "base/error.h"
#include "diagnosis/model/fault_catalogue.h"
#include "trainer/calibration.h"
#include "trainer/regression.h"

namespace fdi::trainer::study {
namespace {

constexpr double kRidge = 1e-6;
constexpr int kMaxOrder = 6;
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
  // With columns scaled to mean 0 and deviation 1, the fit is
  //
  //     a' = (XᵀX/N + 1e-6 I)⁻¹ Xᵀy/N,   a_j = a'_j/σ_j,   b = ȳ − aᵀx̄.
  //
  // The trace of XᵀX/N is at most n, the number of regressors, so that the
  // ridge bounds the condition to about n 1e6 and normal equations are safe. A
  // column that does not move is 0 and gets no slope.
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

LinearModel FitArx(const std::string& name, Signal output,
                   const std::vector<Signal>& inputs,
                   std::span<const Stretch> training,
                   std::span<const Stretch> validation) {
  LinearModel best;
  double least = std::numeric_limits<double>::infinity();
  for (int order = 1; order <= kMaxOrder; ++order) {
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

namespace {

constexpr int kClusterSeparation = 100;  // samples
constexpr std::size_t kMinSums = 100;

}  // namespace

void Cusum::Reset() {
  up_ = 0.0;
  down_ = 0.0;
}

int Cusum::Step(double residual) {
  const double most = 2.0 * limit_;
  up_ = std::clamp(up_ + residual - kDrift, 0.0, most);
  down_ = std::clamp(down_ - residual - kDrift, 0.0, most);
  if (std::max(up_, down_) <= limit_) {
    return 0;
  }
  return up_ >= down_ ? 1 : -1;
}

// Without the upper bound of Cusum::Step(), which needs the limit that is
// sought.
double CusumLimit(const std::vector<std::vector<double>>& series, double rate) {
  std::vector<double> sums;
  for (const std::vector<double>& residuals : series) {
    double up = 0.0;
    double down = 0.0;
    for (const double z : residuals) {
      up = std::max(0.0, up + z - Cusum::kDrift);
      down = std::max(0.0, down - z - Cusum::kDrift);
      sums.push_back(std::max(up, down));
    }
  }
  if (sums.size() < kMinSums) {
    throw DataError("limits of a CUSUM need at least " +
                    std::to_string(kMinSums) +
                    " samples of normal operation, there are " +
                    std::to_string(sums.size()));
  }
  return FitTail(sums, rate, kClusterSeparation).level;
}

BaselineDetector::BaselineDetector(const Baseline& baseline)
    : baseline_(&baseline),
      signature_(baseline.models.size(), 0),
      standing_(signature_) {
  for (std::size_t i = 0; i < baseline.models.size(); ++i) {
    predictors_.emplace_back(baseline.models[i]);
    tests_.emplace_back(baseline.limits[i]);
  }
}

void BaselineDetector::Reset() {
  for (LinearPredictor& predictor : predictors_) {
    predictor.Reset();
  }
  for (Cusum& test : tests_) {
    test.Reset();
  }
  std::fill(signature_.begin(), signature_.end(), 0);
  stands_ = 0;
  samples_ = 0;
  detected_ = false;
  isolated_.clear();
}

Indication BaselineDetector::Step(const Sample& sample) {
  Indication indication;
  indication.settled = ++samples_ > baseline_->options.settling_samples;
  for (std::size_t i = 0; i < tests_.size(); ++i) {
    const std::optional<double> residual = predictors_[i].Step(sample);
    // Without a residual, the test keeps its sums and the sign that it showed.
    if (residual && indication.settled) {
      signature_[i] = tests_[i].Step(*residual);
    }
  }
  const bool alarm = std::any_of(signature_.begin(), signature_.end(),
                                 [](int sign) { return sign != 0; });
  quiet_ = alarm ? 0 : quiet_ + 1;
  if (alarm) {
    detected_ = true;
    Isolate();
  } else if (quiet_ >= baseline_->options.clearing_samples) {
    detected_ = false;
    isolated_.clear();
  }
  indication.detected = detected_;
  indication.isolated = isolated_;
  return indication;
}

void BaselineDetector::Isolate() {
  stands_ = signature_ == standing_ ? stands_ + 1 : 1;
  standing_ = signature_;
  if (stands_ < baseline_->options.isolation_samples) {
    return;
  }
  const auto row = baseline_->table.find(signature_);
  isolated_ = row == baseline_->table.end() ? std::vector<int>() : row->second;
}

namespace {

using enum Signal;

constexpr int kCommandLag = 5;

std::vector<Regressor> WithCommand(std::vector<Regressor> regressors) {
  for (int lag = 0; lag <= kCommandLag; ++lag) {
    regressors.push_back({kCv, lag});
  }
  return regressors;
}

std::vector<LinearModel> FitModels(bool arx, const Condition& normal) {
  if (arx) {
    const std::vector<Signal> inputs{kCv, kP1, kP2, kT1};
    return {FitArx("X", kX, inputs, normal.training, normal.validation),
            FitArx("F", kF, inputs, normal.training, normal.validation)};
  }
  return {FitLinear("X(CV)", kX, WithCommand({}), normal.training),
          FitLinear("F(X,P1,P2)", kF, {{kX, 0}, {kP1, 0}, {kP2, 0}},
                    normal.training),
          FitLinear("F(CV,P1,P2)", kF, WithCommand({{kP1, 0}, {kP2, 0}}),
                    normal.training)};
}

// All of normal operation has its say, as in our own thresholds.
std::vector<double> FitLimits(const std::vector<LinearModel>& models,
                              const Condition& normal, double rate_per_sample) {
  std::vector<double> limits;
  for (const LinearModel& model : models) {
    std::vector<std::vector<double>> series;
    for (const auto* part : {&normal.training, &normal.validation}) {
      for (const Stretch& stretch : *part) {
        series.push_back(StandardResiduals(model, stretch));
      }
    }
    // The tests share the rate: the rates of their false alarms add up at most.
    limits.push_back(CusumLimit(
        series, rate_per_sample / static_cast<double>(models.size())));
  }
  return limits;
}

// The sign that most samples of the second halves of the stretches show; in the
// first halves the sums still grow.
Signature SignatureOf(const Baseline& baseline, const Condition& condition) {
  std::vector<int> sums(baseline.models.size(), 0);
  int samples = 0;
  for (const auto* part : {&condition.training, &condition.validation}) {
    for (const Stretch& stretch : *part) {
      BaselineDetector detector(baseline);
      for (std::size_t k = 0; k < stretch.samples.size(); ++k) {
        detector.Step(stretch.samples[k]);
        if (2 * k < stretch.samples.size()) {
          continue;
        }
        ++samples;
        for (std::size_t i = 0; i < sums.size(); ++i) {
          sums[i] += detector.signature()[i];
        }
      }
    }
  }
  Signature signature;
  for (const int sum : sums) {
    signature.push_back(2 * sum > samples ? 1 : 2 * sum < -samples ? -1 : 0);
  }
  return signature;
}

void FillTable(const std::vector<Condition>& conditions, Baseline& baseline) {
  for (const Condition& condition : conditions) {
    const Signature signature = SignatureOf(baseline, condition);
    const bool moves = std::any_of(signature.begin(), signature.end(),
                                   [](int sign) { return sign != 0; });
    if (condition.fault == 0 || !moves) {
      continue;
    }
    std::vector<int>& faults = baseline.table[signature];
    if (!Contains(faults, condition.fault)) {
      faults.push_back(condition.fault);
      std::sort(faults.begin(), faults.end());
    }
  }
}

}  // namespace

std::vector<std::string> BaselineNames() {
  return {"arx-cusum", "signature-table"};
}

Baseline FitBaseline(std::string_view name,
                     const std::vector<Condition>& conditions, double period_s,
                     const BaselineOptions& options) {
  const bool arx = name == "arx-cusum";
  if (!arx && name != "signature-table") {
    throw ConfigError("unknown baseline '" + std::string(name) +
                      "': expected arx-cusum or signature-table");
  }
  Require(!conditions.empty() && conditions.front().fault == 0,
          "the first condition must be normal operation");
  Baseline baseline;
  baseline.name = name;
  baseline.period_s = period_s;
  baseline.options = options;
  baseline.models = FitModels(arx, conditions.front());
  baseline.limits =
      FitLimits(baseline.models, conditions.front(),
                options.false_alarms_per_hour * period_s / 3600.0);
  if (!arx) {
    FillTable(conditions, baseline);
  }
  return baseline;
}

}  // namespace fdi::trainer::study
