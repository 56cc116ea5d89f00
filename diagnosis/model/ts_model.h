#pragma once

#include <array>
#include <limits>
#include <vector>

#include "diagnosis/model/sample.h"

namespace fdi {

/// Keeps differences of exponents finite however far x is.
inline constexpr double kFarthestExponent = -1e300;

inline constexpr int kMaxLag = 16;
inline constexpr int kMaxRegressors = 16;
inline constexpr int kMaxRules = 32;

/// One antecedent set: a two-sided Gaussian with a core,
///
///     log μ(x) = −½ ((c₁ − x)/w₁)²  for x < c₁,
///                0                  on [c₁, c₂],
///                −½ ((x − c₂)/w₂)²  for x > c₂.
///
/// An infinite width is a shoulder. All in the unit of the regressor.
struct FuzzySet {
  double left_center{0.0};   ///< c₁
  double right_center{0.0};  ///< c₂ ≥ c₁
  double left_width{1.0};    ///< w₁ > 0
  double right_width{1.0};   ///< w₂ > 0
};

/// x_j = signal(k − lag). Lag 0 is the present sample.
struct Regressor {
  Signal signal{Signal::kCv};
  int lag{0};

  bool operator==(const Regressor&) const = default;
};

/// R_i: if x_1 is A_i1 and ... and x is near v_i then y_i = a_iᵀx + b_i.
///
/// The sets are the projections of a cluster on each regressor. For oblique
/// clusters, the distance in the product space distinguishes the rules instead:
/// a rule with a center has sets that are 1 everywhere; other rules have no
/// center.
struct TsRule {
  std::vector<FuzzySet> antecedents;  ///< One per regressor.
  std::vector<double> slopes;         ///< a_i, one per regressor.
  double intercept{0.0};              ///< b_i [unit of the output].
  double data_share{0.0};        ///< Share of the training data, sums to 1.
  std::vector<double> center{};  ///< v_i, for the first regressors; or empty.
  /// L_i, lower triangular, row by row [1/unit of the regressor]; one row per
  /// entry of the center. L_iᵀL_i is the inverse covariance of the cluster.
  std::vector<double> metric{};
};

/// A multiple-input single-output Takagi-Sugeno model,
///
///     ŷ = Σ β_i y_i / Σ β_i,
///     β_i = Π_j μ_Aij(x_j) · exp(−½ ‖L_i (x − v_i)‖²).
///
/// In a parallel model a regressor on the output itself (lag ≥ 1) reads the
/// model's own past predictions instead of the measured past.
struct TsModel {
  Signal output{Signal::kX};
  bool parallel{true};
  std::vector<Regressor> regressors;
  std::vector<double> regressor_min;  ///< Range of the training data, one
  std::vector<double> regressor_max;  ///< per regressor.
  double output_min{0.0};             ///< Predictions are clamped to
  double output_max{0.0};             ///< [output_min, output_max].
  /// Readings from here on are at the upper limit of the transmitter, and the
  /// true value may be any beyond; infinite if none occurred.
  double saturation{std::numeric_limits<double>::infinity()};
  std::vector<TsRule> rules;
};

/// ŷ for the regressor values `x` (model.regressors.size() of them). The
/// exponents of a rule are summed first, for one exp per rule; the largest is
/// factored out, so that far from all rules the nearest one determines ŷ. Does
/// not allocate.
double Evaluate(const TsModel& model, const double* x);

/// The weights β_i / Σ β_i of the rules that fire at one x.
struct FiringRules {
  int count{0};
  std::array<int, kMaxRules> rules;       ///< Their indices; `count` are set.
  std::array<double, kMaxRules> weights;  ///< Sum to 1.
};

/// Finds the rules with a weight of at least 4e-18 of the strongest.
void ComputeFiring(const TsModel& model, const double* x, FiringRules& firing);

/// ŷ of `model` from the weights of a model with the same antecedents.
double Blend(const TsModel& model, const double* x, const FiringRules& firing);

/// True if the models have the same regressors, ranges and antecedents, so that
/// one ComputeFiring() serves both.
bool SharesAntecedents(const TsModel& a, const TsModel& b);

/// r = y − min(ŷ, saturation); NaN if reading and prediction are both at the
/// transmitter's limit, where they cannot be compared.
double Residual(double saturation, double reading, double prediction);
double Residual(const TsModel& model, double reading, double prediction);

/// True if the model is parallel and has its own output among its regressors.
bool IsFreeRunning(const TsModel& model);

/// The largest lag of the regressors.
int MaxLag(const TsModel& model);

/// The signals that the model reads from the transmitters.
SignalMask RequiredSignals(const TsModel& model);

/// @throws DataError naming `where` and the first thing that makes the model
///   unusable: sizes that differ, a number that is not finite, no rule, a lag
///   beyond kMaxLag, a lag of 0 on the output itself.
void Validate(const TsModel& model, const char* where);

}  // namespace fdi
