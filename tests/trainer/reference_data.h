#pragma once

#include <cstdlib>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <gtest/gtest.h>

#include "trainer/takagi_sugeno_fit.h"

namespace fdi::trainer {

/// All rows of a numeric CSV with a header line; an empty matrix if absent.
inline Eigen::MatrixXd ReadCsv(const std::string& path) {
  std::ifstream file(path);
  std::vector<double> values;
  Eigen::Index rows = 0;
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
  return Eigen::Map<const Eigen::MatrixXd>(
             values.data(), static_cast<Eigen::Index>(values.size()) / rows,
             rows)
      .transpose();
}

/// Skips without FDI_REFERENCE_DATA, the folder of the recordings.
class ReferenceDataFitTest : public testing::Test {
 protected:
  void SetUp() override {
    const char* folder = std::getenv("FDI_REFERENCE_DATA");
    if (folder == nullptr) {
      GTEST_SKIP() << "FDI_REFERENCE_DATA is not set";
    }
    folder_ = folder;
  }
  Eigen::MatrixXd Read(const std::string& name) const {
    Eigen::MatrixXd rows = ReadCsv(folder_ + "/" + name);
    EXPECT_GT(rows.rows(), 0) << name;
    return rows;
  }

 private:
  std::string folder_;
};

inline double MeanSquaredError(const RegressionData& data,
                               const Eigen::VectorXd& predicted) {
  return (data.y - predicted).squaredNorm() /
         static_cast<double>(data.y.size());
}

}  // namespace fdi::trainer
