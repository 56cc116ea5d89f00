#include "diagnosis/model/ts_model.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <string>
#include <utility>

#include "base/error.h"
#include "diagnosis/model/exponential.h"

namespace fdi {
namespace {

// A rule below 4e-18 of the strongest does not change a double sum.
constexpr double kFiringExponent = -40.0;

// log μ(x) of one set; an infinite width gives 0 on its side.
double LogMembership(const FuzzySet& set, double x) {
  double z = 0.0;
  if (x < set.left_center) {
    z = (set.left_center - x) / set.left_width;
  } else if (x > set.right_center) {
    z = (x - set.right_center) / set.right_width;
  }
  return -0.5 * z * z;
}

// −½ ‖L (x − v)‖²; 0 for a rule without a center. Row i of L stores only its
// i + 1 entries up to the diagonal.
double LogNearness(const TsRule& rule, const double* x) {
  const double* entry = rule.metric.data();
  double squares = 0.0;
  for (std::size_t row = 0; row < rule.center.size(); ++row) {
    double z = 0.0;
    for (std::size_t j = 0; j <= row; ++j) {
      z += *entry++ * (x[j] - rule.center[j]);
    }
    squares += z * z;
  }
  return -0.5 * squares;
}

double Exponent(const TsRule& rule, const double* x) {
  double exponent = LogNearness(rule, x);
  for (std::size_t j = 0; j < rule.antecedents.size(); ++j) {
    exponent += LogMembership(rule.antecedents[j], x[j]);
  }
  // In this order infinite and NaN distances also count as the farthest.
  return std::max(kFarthestExponent, exponent);
}

double Output(const TsRule& rule, const double* x) {
  double output = rule.intercept;
  for (std::size_t j = 0; j < rule.slopes.size(); ++j) {
    output += rule.slopes[j] * x[j];
  }
  return output;
}

bool SameSet(const FuzzySet& a, const FuzzySet& b) {
  return a.left_center == b.left_center && a.right_center == b.right_center &&
         a.left_width == b.left_width && a.right_width == b.right_width;
}

bool SamePremise(const TsRule& a, const TsRule& b) {
  return std::equal(a.antecedents.begin(), a.antecedents.end(),
                    b.antecedents.begin(), b.antecedents.end(), SameSet) &&
         a.center == b.center && a.metric == b.metric;
}

// Throws the DataErrors of Validate(), prefixed with the place.
class Checker {
 public:
  explicit Checker(std::string where) : where_(std::move(where)) {}

  // Conditions are written so that NaN fails them.
  void Check(bool condition, const std::string& message) const {
    if (!condition) {
      throw DataError(where_ + ": " + message);
    }
  }
  void Finite(double value, const std::string& what) const {
    Check(std::isfinite(value), what + " is not a finite number");
  }
  void Size(std::size_t found, std::size_t expected,
            const std::string& what) const {
    Check(found == expected, what + " has " + std::to_string(found) +
                                 " entries, expected " +
                                 std::to_string(expected));
  }
  Checker At(const std::string& place) const {
    return Checker(where_ + ", " + place);
  }

 private:
  std::string where_;
};

void ValidateRegressors(const TsModel& model, const Checker& checker) {
  const std::size_t n = model.regressors.size();
  checker.Check(n >= 1 && n <= kMaxRegressors,
                std::to_string(n) + " regressors, accepted are 1 to " +
                    std::to_string(kMaxRegressors));
  checker.Size(model.regressor_min.size(), n, "regressor_min");
  checker.Size(model.regressor_max.size(), n, "regressor_max");
  for (std::size_t j = 0; j < n; ++j) {
    const Checker at = checker.At("regressor " + std::to_string(j + 1));
    const Regressor& regressor = model.regressors[j];
    at.Check(Index(regressor.signal) < kModelSignalCount,
             "signal number " + std::to_string(Index(regressor.signal)) +
                 " is unknown");
    at.Check(regressor.lag >= 0 && regressor.lag <= kMaxLag,
             "lag " + std::to_string(regressor.lag) + ", accepted are 0 to " +
                 std::to_string(kMaxLag));
    at.Check(regressor.signal != model.output || regressor.lag > 0,
             "lag 0 on the output itself");
    at.Finite(model.regressor_min[j], "minimum");
    at.Finite(model.regressor_max[j], "maximum");
    at.Check(model.regressor_min[j] <= model.regressor_max[j],
             "minimum above maximum");
  }
}

void ValidateSet(const FuzzySet& set, const Checker& checker) {
  checker.Finite(set.left_center, "left center");
  checker.Finite(set.right_center, "right center");
  checker.Check(set.left_center <= set.right_center,
                "left center above right center");
  checker.Check(set.left_width > 0.0, "left width is not above 0");
  checker.Check(set.right_width > 0.0, "right width is not above 0");
}

void ValidateNearness(const TsRule& rule, std::size_t n,
                      const Checker& checker) {
  const std::size_t rows = rule.center.size();
  checker.Check(rows <= n, "center has " + std::to_string(rows) +
                               " entries, accepted are 0 to " +
                               std::to_string(n));
  checker.Size(rule.metric.size(), rows * (rows + 1) / 2, "metric");
  for (const auto* entries : {&rule.center, &rule.metric}) {
    for (const double entry : *entries) {
      checker.Finite(entry, "an entry of center or metric");
    }
  }
}

void ValidateRule(const TsRule& rule, std::size_t n, const Checker& checker) {
  checker.Size(rule.antecedents.size(), n, "antecedents");
  checker.Size(rule.slopes.size(), n, "slopes");
  for (std::size_t j = 0; j < n; ++j) {
    const std::string name = std::to_string(j + 1);
    ValidateSet(rule.antecedents[j], checker.At("set " + name));
    checker.Finite(rule.slopes[j], "slope " + name);
  }
  ValidateNearness(rule, n, checker);
  checker.Finite(rule.intercept, "intercept");
  checker.Check(rule.data_share >= 0.0 && rule.data_share <= 1.0,
                "data share outside 0 to 1");
}

}  // namespace

// With the exponents E_i and the largest of them, E,
//
//     β_i / Σ β_j = exp(E_i − E) / Σ exp(E_j − E),
//
// whose denominator is at least 1 even where all β_i underflow.
//
// prediction_kernel.h computes the same in the same order, bit for bit: change
// both together.
void ComputeFiring(const TsModel& model, const double* x, FiringRules& firing) {
  std::array<double, kMaxRules> exponents;
  const std::size_t count =
      std::min<std::size_t>(model.rules.size(), kMaxRules);
  double largest = -std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < count; ++i) {
    exponents[i] = Exponent(model.rules[i], x);
    largest = std::max(largest, exponents[i]);
  }
  std::size_t fired = 0;
  double sum = 0.0;
  for (std::size_t i = 0; i < count; ++i) {
    if (exponents[i] - largest > kFiringExponent) {
      firing.rules[fired] = static_cast<int>(i);
      firing.weights[fired] = Exp(exponents[i] - largest);
      sum += firing.weights[fired++];
    }
  }
  for (std::size_t i = 0; i < fired; ++i) {
    firing.weights[i] /= sum;
  }
  firing.count = static_cast<int>(fired);
}

double Blend(const TsModel& model, const double* x, const FiringRules& firing) {
  double value = 0.0;
  for (std::size_t i = 0; i < static_cast<std::size_t>(firing.count); ++i) {
    const auto rule = static_cast<std::size_t>(firing.rules[i]);
    value += firing.weights[i] * Output(model.rules[rule], x);
  }
  // A parallel model feeds this back and could diverge without bounds.
  return std::clamp(value, model.output_min, model.output_max);
}

double Evaluate(const TsModel& model, const double* x) {
  FiringRules firing;
  ComputeFiring(model, x, firing);
  return Blend(model, x, firing);
}

// Exact comparison suffices: a model that is adapted from the normal one keeps
// its antecedents to the bit (docs/method.md).
bool SharesAntecedents(const TsModel& a, const TsModel& b) {
  return a.regressors == b.regressors && a.parallel == b.parallel &&
         a.output == b.output && a.regressor_min == b.regressor_min &&
         a.regressor_max == b.regressor_max &&
         std::equal(a.rules.begin(), a.rules.end(), b.rules.begin(),
                    b.rules.end(), SamePremise);
}

// A reading below the limit contradicts a prediction beyond it by the distance
// to the limit at least, which is what counts.
double Residual(double saturation, double reading, double prediction) {
  return reading >= saturation && prediction >= saturation
             ? std::numeric_limits<double>::quiet_NaN()
             : reading - std::min(prediction, saturation);
}

double Residual(const TsModel& model, double reading, double prediction) {
  return Residual(model.saturation, reading, prediction);
}

bool IsFreeRunning(const TsModel& model) {
  return model.parallel &&
         std::any_of(
             model.regressors.begin(), model.regressors.end(),
             [&](const Regressor& r) { return r.signal == model.output; });
}

int MaxLag(const TsModel& model) {
  int longest = 0;
  for (const Regressor& regressor : model.regressors) {
    longest = std::max(longest, regressor.lag);
  }
  return longest;
}

SignalMask RequiredSignals(const TsModel& model) {
  SignalMask mask = 0;
  for (const Regressor& regressor : model.regressors) {
    if (!model.parallel || regressor.signal != model.output) {
      mask = static_cast<SignalMask>(mask | MaskOf(regressor.signal));
    }
  }
  return mask;
}

void Validate(const TsModel& model, const char* where) {
  const Checker checker{where};
  checker.Check(Index(model.output) < kModelSignalCount,
                "output signal number " + std::to_string(Index(model.output)) +
                    " is unknown");
  ValidateRegressors(model, checker);
  checker.Finite(model.output_min, "output_min");
  checker.Finite(model.output_max, "output_max");
  checker.Check(model.output_min <= model.output_max,
                "output_min above output_max");
  checker.Check(model.saturation > model.output_min,
                "saturation is not above output_min");
  const std::size_t count = model.rules.size();
  checker.Check(count >= 1 && count <= kMaxRules,
                std::to_string(count) + " rules, accepted are 1 to " +
                    std::to_string(kMaxRules));
  for (std::size_t i = 0; i < count; ++i) {
    ValidateRule(model.rules[i], model.regressors.size(),
                 checker.At("rule " + std::to_string(i + 1)));
  }
}

}  // namespace fdi
