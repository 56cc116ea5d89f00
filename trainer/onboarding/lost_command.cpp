#include "trainer/onboarding/lost_command.h"

#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>

#include "trainer/onboarding/record_checks.h"
#include "trainer/statistics.h"

namespace fdi::trainer {
namespace {

constexpr double kErrors = 3.0;  // standard errors
constexpr std::size_t kParts = 20;
// Number of the delays that identification tries: -1, 0, 1 and 2.
constexpr std::size_t kDelays = 4;

// All samples that have them: commands[d] is that of d - 1 samples before.
struct Record {
  std::array<std::vector<double>, kDelays> commands;
  std::vector<double> x;
  std::vector<double> f;
};

Record Collect(const std::vector<TrainingRun>& runs) {
  constexpr SignalMask kNeeded = static_cast<SignalMask>(
      MaskOf(Signal::kCv) | MaskOf(Signal::kX) | MaskOf(Signal::kF));
  Record record;
  for (const TrainingRun& run : runs) {
    for (const Stretch& stretch : SplitAtGaps(run)) {
      const std::vector<Sample>& s = stretch.samples;
      for (std::size_t k = 2; k + 1 < s.size(); ++k) {
        bool complete = true;
        for (std::size_t d = 0; d < kDelays; ++d) {
          complete = complete && (s[k + 1 - d].present & kNeeded) == kNeeded;
        }
        for (std::size_t d = 0; complete && d < kDelays; ++d) {
          record.commands[d].push_back(s[k + 1 - d][Signal::kCv]);
        }
        if (complete) {
          record.x.push_back(s[k][Signal::kX]);
          record.f.push_back(s[k][Signal::kF]);
        }
      }
    }
  }
  return record;
}

void TakeOffMean(std::vector<double>& values) {
  const double mean = Mean(values);
  for (double& value : values) {
    value -= mean;
  }
}

// a - b x
std::vector<double> Less(const std::vector<double>& a, double b,
                         const std::vector<double>& x) {
  std::vector<double> difference(a.size());
  for (std::size_t k = 0; k < a.size(); ++k) {
    difference[k] = a[k] - b * x[k];
  }
  return difference;
}

double Product(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0.0;
  for (std::size_t k = 0; k < a.size(); ++k) {
    sum += a[k] * b[k];
  }
  return sum;
}

// True if the squares of `errors` are larger than those of `others`, for
// certain. Samples in a row are alike, and parts of the record hardly.
bool Larger(const std::vector<double>& errors,
            const std::vector<double>& others) {
  const std::size_t length = errors.size() / kParts;
  std::array<double, kParts> means{};
  for (std::size_t p = 0; p < kParts; ++p) {
    for (std::size_t k = p * length; k < (p + 1) * length; ++k) {
      means[p] += (errors[k] * errors[k] - others[k] * others[k]) /
                  static_cast<double>(length);
    }
  }
  return Mean(means) > kErrors * std::sqrt(Variance(means) / kParts);
}

}  // namespace

bool CommandIsLost(const std::vector<TrainingRun>& runs) {
  if (runs.empty() || runs.front().period_s < kSlowS) {
    return false;
  }
  Record record = Collect(runs);
  auto& [commands, x, f] = record;
  TakeOffMean(x);
  TakeOffMean(f);
  for (std::vector<double>& command : commands) {
    TakeOffMean(command);
  }
  if (!Larger(Less(commands[1], 1.0, commands[2]), commands[1])) {
    return false;
  }
  for (const std::vector<double>& command : commands) {
    if (!Larger(Less(x, 1.0, command), x)) {
      return false;
    }
  }
  const double slope = Product(f, x) / Product(x, x);
  std::vector<double> rest = Less(f, slope, x);
  for (double& value : rest) {
    value *= std::numbers::sqrt2;
  }
  return slope < 0.0 && Larger(f, rest);
}

}  // namespace fdi::trainer
