#pragma once

#include <cmath>
#include <random>

#include "trainer/takagi_sugeno_fit.h"

namespace fdi::trainer {

/// Two inputs of different size, uniformly spread, and a target f(x₁, x₂).
template <typename Function>
RegressionData Sampled(Eigen::Index rows, Function f) {
  std::mt19937 generator(21);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  RegressionData data{Eigen::MatrixXd(rows, 2), Eigen::VectorXd(rows)};
  for (Eigen::Index k = 0; k < rows; ++k) {
    data.x(k, 0) = uniform(generator);
    data.x(k, 1) = 3000.0 + 100.0 * uniform(generator);
    data.y(k) = f(data.x(k, 0), data.x(k, 1));
  }
  return data;
}

inline double Hills(double a, double b) {
  return std::sin(3.0 * a) + std::cos(b / 50.0);
}

}  // namespace fdi::trainer
