#include "trainer/onboarding/record_verdict.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "trainer/statistics.h"

namespace fdi::trainer {
namespace {

constexpr double kLeastMinutes = 25.0;
constexpr double kLeastSpan = 5.0;  // Of the command [%].

std::string Fixed(double value, int decimals) {
  char text[32];
  std::snprintf(text, sizeof text, "%.*f", decimals, value);
  return text;
}

double CommandSpan(const std::vector<TrainingRun>& runs) {
  std::vector<double> commands;
  for (const TrainingRun& run : runs) {
    for (const LabelledSample& labelled : run.samples) {
      if (labelled.sample.Has(Signal::kCv)) {
        commands.push_back(labelled.sample[Signal::kCv]);
      }
    }
  }
  std::sort(commands.begin(), commands.end());
  return commands.empty()
             ? 0.0
             : SortedQuantile(commands, 0.99) - SortedQuantile(commands, 0.01);
}

}  // namespace

RecordVerdict JudgeRecord(const std::vector<TrainingRun>& runs, double hours) {
  const double minutes = 60.0 * hours;
  const double span = CommandSpan(runs);
  std::string lacks;
  if (minutes < kLeastMinutes) {
    lacks = Fixed(minutes, 0) + " minutes of healthy data, " +
            Fixed(std::ceil(kLeastMinutes - minutes), 0) + " more are needed";
  }
  if (span < kLeastSpan) {
    lacks += (lacks.empty() ? "" : "; ") + std::string("the command stays ") +
             "within " + Fixed(span, 1) +
             " %, one more operating point at least " + Fixed(kLeastSpan, 0) +
             " % away is needed";
  }
  if (!lacks.empty()) {
    return {"thin", "thin: " + lacks +
                        ". Until then expect false alarms where the valve "
                        "works in another way than here"};
  }
  return {"usable", "usable: " + Fixed(hours, 2) + " h of healthy data over " +
                        Fixed(span, 0) + " % of the command"};
}

}  // namespace fdi::trainer
