#pragma once

namespace fdi {

/// Quantile of Student's t, 0 < p < 1 and freedom ≥ 1.
double StudentQuantile(double p, double freedom);

}  // namespace fdi
