// Fits to published and reference data. FDI_REFERENCE_DATA names their folder.
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "trainer/takagi_sugeno_fit.h"

namespace fdi::trainer {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// All rows of a numeric CSV with a header line; an empty matrix if absent.
MatrixXd ReadCsv(const std::string& path) {
  std::ifstream file(path);
  std::vector<double> values;
  Index rows = 0;
  std::string line;
  std::getline(file, line);
  while (std::getline(file, line) && !line.empty()) {
    std::istringstream fields(line);
    std::string field;
    while (std::getline(fields, field, ',')) {
      values.push_back(std::stod(field));
    }
    ++rows;
  }
  if (rows == 0) {
    return {};
  }
  return Eigen::Map<const MatrixXd>(
             values.data(), static_cast<Index>(values.size()) / rows, rows)
      .transpose();
}

class ReferenceDataFitTest : public testing::Test {
 protected:
  void SetUp() override {
    const char* folder = std::getenv("FDI_REFERENCE_DATA");
    if (folder == nullptr) {
      GTEST_SKIP() << "FDI_REFERENCE_DATA is not set";
    }
    folder_ = folder;
  }
  MatrixXd Read(const std::string& name) const {
    MatrixXd rows = ReadCsv(folder_ + "/" + name);
    EXPECT_GT(rows.rows(), 0) << name;
    return rows;
  }

 private:
  std::string folder_;
};

// Box and Jenkins' gas furnace, y(k−1..3) and u(k−1..3).
RegressionData GasFurnace(const MatrixXd& rows) {
  const Index n = rows.rows() - 3;
  RegressionData data{MatrixXd(n, 6), rows.col(1).tail(n)};
  for (Index lag = 1; lag <= 3; ++lag) {
    data.x.col(lag - 1) = rows.col(1).segment(3 - lag, n);
    data.x.col(lag + 2) = rows.col(0).segment(3 - lag, n);
  }
  return data;
}

double MeanSquaredError(const RegressionData& data, const VectorXd& predicted) {
  return (data.y - predicted).squaredNorm() /
         static_cast<double>(data.y.size());
}

// The one-rule model is the linear ARX: 0.0616 to 0.0622 in the literature.
TEST_F(ReferenceDataFitTest, GasFurnaceIsFittedNoWorseThanByALinearArx) {
  const RegressionData data =
      GasFurnace(Read("identification/gas_furnace.csv"));
  TakagiSugenoOptions options;
  options.num_rules = 1;
  const double linear =
      MeanSquaredError(data, Predict(FitTakagiSugeno(data, options), data.x));
  ASSERT_GE(linear, 0.0616);
  ASSERT_LE(linear, 0.0622);

  for (const auto method :
       {ConsequentMethod::kLocal, ConsequentMethod::kGlobal}) {
    options.consequents.method = method;
    for (int c = 2; c <= 3; ++c) {
      options.num_rules = c;
      const double error = MeanSquaredError(
          data, Predict(FitTakagiSugeno(data, options), data.x));
      const std::string name =
          (method == ConsequentMethod::kLocal ? "local_" : "global_") +
          std::to_string(c);
      RecordProperty(name, std::to_string(error));
      EXPECT_LE(error, linear) << name;
    }
  }
}

// F from X, P1, P2 of a run under the benchmark's excitation.
RegressionData Flow(const MatrixXd& rows) {
  const Index n = rows.rows() - 60;
  RegressionData data{MatrixXd(n, 3), rows.col(6).tail(n)};
  data.x << rows.col(5).tail(n), rows.col(2).tail(n), rows.col(3).tail(n);
  return data;
}

TEST_F(ReferenceDataFitTest, SixRulesPredictTheFlowOfAnotherRun) {
  const RegressionData data =
      Flow(Read("valve-reference/sine_faultfree_201.csv"));
  const RegressionData other =
      Flow(Read("valve-reference/sine_faultfree_202.csv"));
  TakagiSugenoOptions options;
  options.num_rules = 6;
  const auto rules = FitTakagiSugeno(data, options);
  // Within the range that was trained, as a TsModel predicts.
  const VectorXd predicted = Predict(rules, other.x)
                                 .cwiseMax(data.y.minCoeff())
                                 .cwiseMin(data.y.maxCoeff());
  const double error = MeanSquaredError(other, predicted);

  RecordProperty("mse", std::to_string(error));
  EXPECT_LE(error, 0.065);
}

}  // namespace
}  // namespace fdi::trainer
