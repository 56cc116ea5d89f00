#include "trainer/baselines/cusum.h"

#include <algorithm>
#include <string>

#include "diagnosis/error.h"
#include "trainer/tail_fit.h"

namespace fdi::trainer {
namespace {

constexpr int kClusterSeparation = 100;  // samples
constexpr std::size_t kFewest = 100;

}  // namespace

void Cusum::Reset() {
  up_ = 0.0;
  down_ = 0.0;
}

int Cusum::Step(double residual) {
  const double most = 2.0 * limit_;
  up_ = std::clamp(up_ + residual - kDrift, 0.0, most);
  down_ = std::clamp(down_ - residual - kDrift, 0.0, most);
  if (std::max(up_, down_) <= limit_) {
    return 0;
  }
  return up_ >= down_ ? 1 : -1;
}

double CusumLimit(const std::vector<std::vector<double>>& series, double rate) {
  std::vector<double> sums;
  for (const std::vector<double>& residuals : series) {
    double up = 0.0;
    double down = 0.0;
    for (const double z : residuals) {
      up = std::max(0.0, up + z - Cusum::kDrift);
      down = std::max(0.0, down - z - Cusum::kDrift);
      sums.push_back(std::max(up, down));
    }
  }
  if (sums.size() < kFewest) {
    throw DataError("limits of a CUSUM need at least " +
                    std::to_string(kFewest) +
                    " samples of normal operation, there are " +
                    std::to_string(sums.size()));
  }
  return FitTail(sums, rate, kClusterSeparation).level;
}

}  // namespace fdi::trainer
