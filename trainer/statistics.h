#pragma once

#include <span>
#include <vector>

namespace fdi::trainer {

/// 0 of no values.
double Mean(std::span<const double> values);
/// About the mean, over N; 0 of no values.
double Variance(std::span<const double> values);
/// Of the values that are numbers; 0 if none is.
double MeanSquare(std::span<const double> values);
/// Linear between the values; `sorted` must not be empty, q in [0, 1].
double SortedQuantile(const std::vector<double>& sorted, double q);

}  // namespace fdi::trainer
