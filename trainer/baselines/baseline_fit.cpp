#include <algorithm>

#include "diagnosis/error.h"
#include "trainer/baselines/baseline.h"

namespace fdi::trainer {
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
    if (std::find(faults.begin(), faults.end(), condition.fault) ==
        faults.end()) {
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

}  // namespace fdi::trainer
