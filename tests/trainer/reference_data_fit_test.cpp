// Fits to recordings of valves, from the folder FDI_REFERENCE_DATA.
#include <cstdio>
#include <vector>

#include <gtest/gtest.h>

#include "tests/trainer/reference_data.h"
#include "trainer/channel_training.h"
#include "trainer/regression.h"
#include "trainer/takagi_sugeno_fit.h"
#include "trainer/training.h"

namespace fdi::trainer {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// F from X, P1, P2 of a run under the benchmark's excitation.
RegressionData Flow(const MatrixXd& rows, Index count) {
  const auto kept = rows.middleRows(60, count);
  RegressionData data{MatrixXd(count, 3), kept.col(6)};
  data.x << kept.col(5), kept.col(2), kept.col(3);
  return data;
}

TEST_F(ReferenceDataFitTest, SixRulesPredictTheFlowOfAnotherRun) {
  const RegressionData data =
      Flow(Read("valve-reference/sine_faultfree_201.csv"), 2000);
  const MatrixXd rows = Read("valve-reference/sine_faultfree_202.csv");
  const RegressionData other = Flow(rows, rows.rows() - 60);
  for (const auto kind :
       {AntecedentKind::kProjected, AntecedentKind::kProductSpace}) {
    TakagiSugenoOptions options;
    options.num_rules = 6;
    options.antecedent_kind = kind;
    const auto rules = FitTakagiSugeno(data, options);
    // Within the range that was trained, as a TsModel predicts.
    const VectorXd predicted = Predict(rules, other.x)
                                   .cwiseMax(data.y.minCoeff())
                                   .cwiseMin(data.y.maxCoeff());
    const double error = MeanSquaredError(other, predicted);

    std::printf(
        "F from X, P1, P2, 6 rules, %s: MSE %.4f\n",
        kind == AntecedentKind::kProjected ? "projected sets" : "product space",
        error);
    EXPECT_LE(error, 0.065);
  }
}

// Seconds [from, to) of the plant record.
Stretch Plant(const MatrixXd& rows, Index from, Index to) {
  Stretch stretch{"plant", {}};
  for (Index k = from; k < to; ++k) {
    Sample sample;
    int column = 1;
    for (const Signal signal : {Signal::kCv, Signal::kP1, Signal::kP2,
                                Signal::kT1, Signal::kX, Signal::kF}) {
      sample.Set(signal, rows(k, column++));
    }
    stretch.samples.push_back(sample);
  }
  return stretch;
}

double VarianceAccountedFor(const TsModel& model, const Stretch& stretch) {
  const auto variance = [](const std::vector<double>& values) {
    const Eigen::Map<const Eigen::ArrayXd> v(values.data(),
                                             static_cast<Index>(values.size()));
    return (v - v.mean()).square().mean();
  };
  return 100.0 * (1.0 - variance(RunResiduals(model, stretch, 30)) /
                            variance(RunOutputs(model, stretch, 30)));
}

// One rule with the regressors of `model`, fitted to the stretch itself.
double LinearAtBest(const TsModel& model, const Stretch& stretch) {
  const auto data =
      BuildRegression({&stretch, 1}, model.regressors, model.output);
  TakagiSugenoOptions options;
  options.num_rules = 1;
  return VarianceAccountedFor(MakeModel(FitTakagiSugeno(data, options), data,
                                        model.regressors, model.output, true),
                              stretch);
}

// The model of a channel of preset extended; the last 30 % of the training
// stretch validate.
TsModel Identify(const ChannelPlan& plan, FitOptions options,
                 const Stretch& stretch) {
  const auto cut = static_cast<std::ptrdiff_t>(
      0.7 * static_cast<double>(stretch.samples.size()));
  const auto middle = stretch.samples.begin() + cut;
  Condition normal;
  normal.training = {{"plant", {stretch.samples.begin(), middle}}};
  normal.validation = {{"plant", {middle, stretch.samples.end()}}};
  const auto regressors = ChooseRegressors(plan, normal, options);
  options.rules.counts = plan.rule_counts;
  options.rules.min_rules = plan.rule_counts.front();
  return FitChannel(plan, regressors, normal, options);
}

TEST_F(ReferenceDataFitTest, ThePlantIsPredictedInParallelRun) {
  const MatrixXd rows =
      Read("plant/lublin_actuator3_2001-10-11_first40min.csv");
  const Stretch first = Plant(rows, 60, 1500);
  const Stretch second = Plant(rows, 1500, 2400);
  const TrainingOptions options = PresetOptions("extended");
  for (ChannelPlan plan : {options.channels[0], options.channels[1]}) {
    for (auto& pool : plan.pools) {
      std::erase(pool, Regressor{Signal::kT1, 0});
    }
    const TsModel model = Identify(plan, options.fit, first);
    const TsModel reversed = Identify(plan, options.fit, second);
    const double vaf = VarianceAccountedFor(model, second);
    std::printf(
        "plant %s: VAF %.1f %% (linear fitted to the test part %.1f %%), "
        "reversed %.1f %% (%.1f %%)\n",
        plan.name.c_str(), vaf, LinearAtBest(model, second),
        VarianceAccountedFor(reversed, first), LinearAtBest(reversed, first));
    EXPECT_GE(vaf, plan.output == Signal::kF ? 84.0 : 78.0);
  }
}

}  // namespace
}  // namespace fdi::trainer
