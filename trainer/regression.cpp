#include "trainer/regression.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/error.h"

namespace fdi::trainer {
namespace {

int MaxLagOf(const std::vector<Regressor>& regressors) {
  int longest = 0;
  for (const Regressor& regressor : regressors) {
    longest = std::max(longest, regressor.lag);
  }
  return longest;
}

bool IsFilled(const Sample& sample, Signal signal) {
  return sample.quality[Index(signal)] == SignalQuality::kUncertain;
}

// Tells the rows that were measured from those that were filled in when their
// table was resampled: the output must have been measured, and the regressors
// too unless that left less than half of the rows, as with slow data.
class MeasuredRows {
 public:
  MeasuredRows(std::span<const Stretch> stretches,
               const std::vector<Regressor>& regressors, Signal output)
      : regressors_(regressors), output_(output) {
    const auto lag = static_cast<std::size_t>(MaxLagOf(regressors));
    std::size_t measured = 0;
    std::size_t wholly = 0;
    for (const Stretch& stretch : stretches) {
      for (std::size_t k = lag; k < stretch.samples.size(); ++k) {
        measured += !IsFilled(stretch.samples[k], output) ? 1U : 0U;
        wholly += Contains(stretch, k) ? 1U : 0U;
      }
    }
    regressors_too_ = 2 * wholly >= measured;
  }
  bool Contains(const Stretch& stretch, std::size_t k) const {
    return !IsFilled(stretch.samples[k], output_) &&
           (!regressors_too_ ||
            std::ranges::none_of(regressors_, [&](const Regressor& r) {
              const auto lag = static_cast<std::size_t>(r.lag);
              return k >= lag && IsFilled(stretch.samples[k - lag], r.signal);
            }));
  }

 private:
  const std::vector<Regressor>& regressors_;
  Signal output_;
  bool regressors_too_{true};
};

}  // namespace

RegressionData BuildRegression(std::span<const Stretch> stretches,
                               const std::vector<Regressor>& regressors,
                               Signal output, bool measured_only) {
  Require(!regressors.empty(), "a model needs at least one regressor");
  const int lag = MaxLagOf(regressors);
  Eigen::Index rows = 0;
  for (const Stretch& stretch : stretches) {
    rows += std::max<Eigen::Index>(
        0, static_cast<Eigen::Index>(stretch.samples.size()) - lag);
  }
  const MeasuredRows measured(stretches, regressors, output);
  RegressionData data;
  data.x.resize(rows, static_cast<Eigen::Index>(regressors.size()));
  data.y.resize(rows);
  Eigen::Index row = 0;
  for (const Stretch& stretch : stretches) {
    const int count = static_cast<int>(stretch.samples.size());
    for (int k = lag; k < count; ++k) {
      if (measured_only &&
          !measured.Contains(stretch, static_cast<std::size_t>(k))) {
        continue;
      }
      for (std::size_t j = 0; j < regressors.size(); ++j) {
        const auto at = static_cast<std::size_t>(k - regressors[j].lag);
        data.x(row, static_cast<Eigen::Index>(j)) =
            stretch.samples[at][regressors[j].signal];
      }
      data.y(row++) = stretch.samples[static_cast<std::size_t>(k)][output];
    }
  }
  data.x.conservativeResize(row, Eigen::NoChange);
  data.y.conservativeResize(row);
  return data;
}

std::vector<double> RunPredictions(const TsModel& model, const Stretch& stretch,
                                   std::optional<double> past_output) {
  std::vector<double> predictions(stretch.samples.size());
  std::array<double, kMaxRegressors> x{};
  for (std::size_t k = 0; k < stretch.samples.size(); ++k) {
    for (std::size_t j = 0; j < model.regressors.size(); ++j) {
      const Regressor& regressor = model.regressors[j];
      const auto lag = static_cast<std::size_t>(regressor.lag);
      const bool own = model.parallel && regressor.signal == model.output;
      if (k < lag) {
        const double measured = stretch.samples.front()[regressor.signal];
        x[j] = own ? past_output.value_or(measured) : measured;
      } else {
        x[j] = own ? predictions[k - lag]
                   : stretch.samples[k - lag][regressor.signal];
      }
    }
    predictions[k] = std::clamp(Evaluate(model, x.data()), model.output_min,
                                model.output_max);
  }
  return predictions;
}

namespace {

// Calls take(residual, sample) for every sample that counts.
template <typename Take>
void Run(const TsModel& model, const Stretch& stretch, int settling,
         std::optional<double> past_output, Take take) {
  const std::vector<double> predictions =
      RunPredictions(model, stretch, past_output);
  const MeasuredRows measured({&stretch, 1}, model.regressors, model.output);
  const auto left_out =
      static_cast<std::size_t>(IsFreeRunning(model) ? settling : MaxLag(model));
  for (std::size_t k = left_out; k < stretch.samples.size(); ++k) {
    const Sample& sample = stretch.samples[k];
    const double residual =
        Residual(model, sample[model.output], predictions[k]);
    if (!std::isnan(residual) && measured.Contains(stretch, k)) {
      take(residual, sample);
    }
  }
}

// Values of `signal` in the samples that the residuals belong to.
std::vector<double> RunSignal(const TsModel& model, const Stretch& stretch,
                              int settling, Signal signal) {
  std::vector<double> values;
  Run(model, stretch, settling, {},
      [&](double, const Sample& sample) { values.push_back(sample[signal]); });
  return values;
}

}  // namespace

std::vector<double> RunResiduals(const TsModel& model, const Stretch& stretch,
                                 int settling,
                                 std::optional<double> past_output) {
  std::vector<double> residuals;
  Run(model, stretch, settling, past_output,
      [&](double residual, const Sample&) { residuals.push_back(residual); });
  return residuals;
}

std::vector<double> RunOutputs(const TsModel& model, const Stretch& stretch,
                               int settling) {
  return RunSignal(model, stretch, settling, model.output);
}

std::vector<double> RunCommands(const TsModel& model, const Stretch& stretch,
                                int settling) {
  return RunSignal(model, stretch, settling, Signal::kCv);
}

std::vector<double> RunResiduals(const TsModel& model,
                                 std::span<const Stretch> stretches,
                                 int settling,
                                 std::optional<double> past_output) {
  std::vector<double> all;
  for (const Stretch& stretch : stretches) {
    const std::vector<double> one =
        RunResiduals(model, stretch, settling, past_output);
    all.insert(all.end(), one.begin(), one.end());
  }
  return all;
}

TsModel MakeModel(std::vector<TsRule> rules, const RegressionData& data,
                  const std::vector<Regressor>& regressors, Signal output,
                  bool parallel) {
  TsModel model;
  model.output = output;
  model.parallel = parallel;
  model.regressors = regressors;
  for (Eigen::Index j = 0; j < data.x.cols(); ++j) {
    model.regressor_min.push_back(data.x.col(j).minCoeff());
    model.regressor_max.push_back(data.x.col(j).maxCoeff());
  }
  const double low = data.y.minCoeff();
  const double high = data.y.maxCoeff();
  // The limits keep a model that runs on its own predictions from running away.
  // A value hidden by a transmitter at its limit may be far beyond.
  const double reach = high >= data.saturation ? 2.0 : 0.5;
  const double margin = reach * (high - low) + 1e-9;
  model.output_min = low - margin;
  model.output_max = high + margin;
  model.saturation = data.saturation;
  model.rules = std::move(rules);
  return model;
}

}  // namespace fdi::trainer
