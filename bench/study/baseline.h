#pragma once

#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "diagnosis/model/sample.h"
#include "diagnosis/model/ts_model.h"
#include "trainer/dataset.h"
#include "trainer/evaluation.h"

/// Detectors that a reader knows, to stand beside ours on the same data with
/// the same indices.
namespace fdi::trainer::study {

/// A linear model of one output,
///
///     ŷ(k) = b + Σ_j a_j x_j(k),   x_j(k) = signal(k − lag),
///
/// run with measured lags, and the distribution of its residual y − ŷ in
/// normal operation.
struct LinearModel {
  std::string name;  ///< "X(CV)", ...
  Signal output{Signal::kX};
  std::vector<Regressor> regressors;
  std::vector<double> slopes;  ///< a_j
  double intercept{0.0};       ///< b [unit of the output].
  double residual_mean{0.0};
  double residual_sd{1.0};  ///< > 0.
};

/// Fits slopes and intercept by least squares, all columns scaled to unit
/// deviation with a ridge of 1e-6, so that a regressor that does not move gets
/// no slope.
///
/// @param stretches of normal operation.
/// @throws DataError if there are not ten times as many rows as regressors.
LinearModel FitLinear(std::string name, Signal output,
                      const std::vector<Regressor>& regressors,
                      std::span<const Stretch> stretches);

/// As FitLinear() with all `inputs` at lags 0..n and the output at 1..n: the
/// order n of 1..6 that errs least on `validation`.
LinearModel FitArx(const std::string& name, Signal output,
                   const std::vector<Signal>& inputs,
                   std::span<const Stretch> training,
                   std::span<const Stretch> validation);

/// Follows a stream with a linear model.
class LinearPredictor {
 public:
  explicit LinearPredictor(const LinearModel& model);

  /// Forgets the past.
  void Reset();

  /// Standardised residual (y − ŷ − mean)/sd of the next sample; nothing until
  /// all lags are known, or where a reading is missing or not finite.
  std::optional<double> Step(const Sample& sample);

 private:
  const LinearModel* model_;
  std::size_t length_;
  std::vector<Sample> past_;  // Newest last; at most length_.
};

/// Standardised residuals of a stretch, run by a LinearPredictor.
std::vector<double> StandardResiduals(const LinearModel& model,
                                      const Stretch& stretch);

/// Two-sided CUSUM test [Page, 1954] on a standardised residual z,
///
///     g⁺ ← max(0, g⁺ + z − ν),   g⁻ ← max(0, g⁻ − z − ν),
///
/// with drift ν = 0.5: it is the best test for a step of one deviation. Sums
/// are held at twice the limit, so that an alarm ends soon after its cause.
///
/// - [Page, 1954] "Continuous inspection schemes", Biometrika 41, pp. 100–115.
class Cusum {
 public:
  static constexpr double kDrift = 0.5;  ///< ν

  /// @param limit h > 0 of both sums.
  explicit Cusum(double limit) : limit_(limit) {}

  void Reset();

  /// Takes the next residual. @returns the sign of the change: +1 or −1 where
  /// g⁺ or g⁻ exceeds the limit (the larger one if both do), else 0.
  int Step(double residual);

 private:
  double limit_;
  double up_{0.0};
  double down_{0.0};
};

/// The limit that max(g⁺, g⁻) exceeds `rate` times per sample, by the tail fit
/// of the thresholds (FitTail()) over series without fault.
///
/// @param series standardised residuals, one series per stretch of time; at
///   least 100 in all.
/// @throws DataError if there are fewer.
double CusumLimit(const std::vector<std::vector<double>>& series, double rate);

/// Settings of the baselines; the same as ours where there is a counterpart.
struct BaselineOptions {
  double false_alarms_per_hour{1e-3};  ///< Over all tests together.
  int settling_samples{30};            ///< After a start or a gap.
  int clearing_samples{60};            ///< t_c
  int isolation_samples{20};           ///< So long a signature must stand.
};

/// Signs of the residuals, one per model: −1, 0, +1.
using Signature = std::vector<int>;

/// Linear models, a CUSUM test on the residual of each and, for isolation, the
/// signatures that each fault was seen with.
struct Baseline {
  std::string name;
  double period_s{1.0};  ///< Period of the samples it was fitted to.
  BaselineOptions options;
  std::vector<LinearModel> models;
  std::vector<double> limits;  ///< Limits of the tests, one per model.
  /// Faults by signature, ascending; empty: the baseline detects only.
  std::map<Signature, std::vector<int>> table;
};

/// "arx-cusum" and "signature-table".
std::vector<std::string> BaselineNames();

/// Fits the baseline called `name`:
/// - arx-cusum: ARX models of X and F with inputs CV, P1, P2 and T1, one step
///   ahead; detects.
/// - signature-table: linear models X(CV), F(X, P1, P2) and F(CV, P1, P2),
///   commands at lags 0 to 5; the signs of their residuals against those of
///   every condition of the training (V-Diag's diagnostic matrix). A condition
///   that moves no residual has no row.
///
/// @param conditions the first is normal operation.
/// @throws ConfigError naming the baselines there are; DataError as FitLinear()
///   and CusumLimit().
Baseline FitBaseline(std::string_view name,
                     const std::vector<Condition>& conditions, double period_s,
                     const BaselineOptions& options);

/// Follows a stream with a baseline.
class BaselineDetector {
 public:
  /// `baseline` must outlive it.
  explicit BaselineDetector(const Baseline& baseline);

  /// Begins anew, e.g. after a gap; an alarm ends.
  void Reset();

  /// Takes the next sample; the truth of the indication stays empty. Detected:
  /// from an alarm of any test until none alarmed for t_c samples. Isolated:
  /// the faults of the signature that last stood for long enough.
  Indication Step(const Sample& sample);

  /// As the last Step() left it.
  const Signature& signature() const { return signature_; }

 private:
  void Isolate();

  const Baseline* baseline_;
  std::vector<LinearPredictor> predictors_;
  std::vector<Cusum> tests_;
  Signature signature_;
  Signature standing_;  // Signature of the last samples.
  int stands_{0};       // Number of these samples.
  int samples_{0};
  int quiet_{0};
  bool detected_{false};
  std::vector<int> isolated_;
};

}  // namespace fdi::trainer::study
