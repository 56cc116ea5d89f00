// Measures a fit on one core: F from X, P1, P2 under the benchmark's
// excitation, 2000 samples, 6 rules; and the evaluation of its rules.
#include <cstdlib>
#include <fstream>
#include <string>

#include <benchmark/benchmark.h>

#include "trainer/takagi_sugeno_fit.h"

namespace fdi::trainer {
namespace {

constexpr int kRows = 2000;
constexpr int kSettling = 60;  // samples

// F from X, P1, P2 of a recording; no rows without FDI_REFERENCE_DATA.
RegressionData Flow() {
  const char* folder = std::getenv("FDI_REFERENCE_DATA");
  std::ifstream file(std::string(folder != nullptr ? folder : ".") +
                     "/valve-reference/sine_faultfree_201.csv");
  std::string line;
  for (int k = 0; k <= kSettling; ++k) {  // and the header
    std::getline(file, line);
  }
  RegressionData data{Eigen::MatrixXd(kRows, 3), Eigen::VectorXd(kRows)};
  for (int k = 0; k < kRows; ++k) {
    double t = 0.0;
    double cv = 0.0;
    double t1 = 0.0;
    char comma = ',';
    file >> t >> comma >> cv >> comma >> data.x(k, 1) >> comma >>
        data.x(k, 2) >> comma >> t1 >> comma >> data.x(k, 0) >> comma >>
        data.y(k);
    std::getline(file, line);
  }
  return file ? data : RegressionData{};
}

bool Skip(const RegressionData& data, benchmark::State& state) {
  if (data.y.size() == 0) {
    state.SkipWithError("FDI_REFERENCE_DATA does not name the recordings");
  }
  return data.y.size() == 0;
}

TakagiSugenoOptions SixRules(int starts, AntecedentKind kind) {
  TakagiSugenoOptions options;
  options.num_rules = 6;
  options.antecedent_kind = kind;
  options.clustering.num_starts = starts;
  return options;
}

// Argument: the number of starts.
template <AntecedentKind kind>
void FitSixRules(benchmark::State& state) {
  const RegressionData data = Flow();
  if (Skip(data, state)) {
    return;
  }
  const auto options = SixRules(static_cast<int>(state.range(0)), kind);
  for ([[maybe_unused]] auto _ : state) {
    benchmark::DoNotOptimize(FitTakagiSugeno(data, options));
  }
}
BENCHMARK(FitSixRules<AntecedentKind::kProjected>)
    ->Arg(1)
    ->Arg(3)
    ->Unit(benchmark::kMillisecond);
BENCHMARK(FitSixRules<AntecedentKind::kProductSpace>)
    ->Arg(1)
    ->Arg(3)
    ->Unit(benchmark::kMillisecond);

template <AntecedentKind kind>
void EvaluateSixRules(benchmark::State& state) {
  const RegressionData data = Flow();
  if (Skip(data, state)) {
    return;
  }
  TsModel model;
  model.output_max = 100.0;
  model.rules = FitTakagiSugeno(data, SixRules(1, kind));
  Eigen::Index k = 0;
  for ([[maybe_unused]] auto _ : state) {
    const Eigen::Vector3d x = data.x.row(k);
    benchmark::DoNotOptimize(Evaluate(model, x.data()));
    k = (k + 1) % kRows;
  }
}
BENCHMARK(EvaluateSixRules<AntecedentKind::kProjected>);
BENCHMARK(EvaluateSixRules<AntecedentKind::kProductSpace>);

}  // namespace
}  // namespace fdi::trainer
