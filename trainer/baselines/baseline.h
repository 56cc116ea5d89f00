#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "trainer/baselines/cusum.h"
#include "trainer/baselines/linear_model.h"
#include "trainer/evaluation.h"

/// Detectors that a reader knows, to stand beside ours on the same data with
/// the same indices.
namespace fdi::trainer {

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
  BaselineOptions options;
  std::vector<LinearModel> models;
  std::vector<double> limits;  ///< Of the tests, one per model.
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
  Signature standing_;  // Of the last samples.
  int stands_{0};       // For so many samples.
  int samples_{0};
  int quiet_{0};
  bool detected_{false};
  std::vector<int> isolated_;
};

}  // namespace fdi::trainer
