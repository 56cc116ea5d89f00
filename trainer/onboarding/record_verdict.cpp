#include "trainer/onboarding/record_verdict.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iterator>

#include "base/text.h"
#include "trainer/statistics.h"

namespace fdi::trainer {
namespace {

constexpr double kLeastMinutes = 25.0;
constexpr double kLeastSpan = 5.0;    // Of the command [%].
constexpr double kLeastJudged = 0.5;  // Of a part of the record.

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

// What the record lacks as far as it shows in parts that were left out.
std::vector<std::string> LacksOf(const CoverageTable& coverage, double hours) {
  std::vector<std::string> lacks;
  if (coverage.judged < kLeastJudged) {
    lacks.push_back("models of the rest of the record know only " +
                    Fixed(100.0 * coverage.judged, 0) +
                    " % of a part of it: every operating point is needed at "
                    "least twice");
  }
  if (coverage.alarmed > 0) {
    lacks.push_back("in " + std::to_string(coverage.alarmed) + " of " +
                    std::to_string(coverage.parts) +
                    " parts of the record, models of the rest alarm although "
                    "the valve is healthy: another " +
                    Fixed(hours, 2) + " h of record is needed");
  }
  return lacks;
}

std::string DetectedOf(const CoverageTable& coverage) {
  const auto detected = std::ranges::count_if(
      coverage.faults,
      [](const FaultCoverage& fault) { return fault.detectable.has_value(); });
  return std::to_string(detected) + " of " +
         std::to_string(coverage.faults.size()) +
         " faults are detected in data that the models did not see";
}

}  // namespace

RecordVerdict JudgeRecord(const std::vector<TrainingRun>& runs, double hours,
                          const CoverageTable* coverage) {
  const double minutes = 60.0 * hours;
  const double span = CommandSpan(runs);
  std::vector<std::string> lacks;
  if (minutes < kLeastMinutes) {
    lacks.push_back(Fixed(minutes, 0) + " minutes of healthy data, " +
                    Fixed(std::ceil(kLeastMinutes - minutes), 0) +
                    " more are needed");
  }
  if (span < kLeastSpan) {
    lacks.push_back("the command stays within " + Fixed(span, 1) +
                    " %, one more operating point at least " +
                    Fixed(kLeastSpan, 0) + " % away is needed");
  }
  std::string detected;
  if (coverage != nullptr) {
    std::ranges::move(LacksOf(*coverage, hours), std::back_inserter(lacks));
    detected = "; " + DetectedOf(*coverage);
  }
  if (!lacks.empty()) {
    return {"thin", "thin: " + JoinText(lacks, "; ") +
                        ". Until then expect false alarms where the valve "
                        "works in another way than here" +
                        detected};
  }
  return {"usable", "usable: " + Fixed(hours, 2) + " h of healthy data over " +
                        Fixed(span, 0) + " % of the command" + detected};
}

}  // namespace fdi::trainer
