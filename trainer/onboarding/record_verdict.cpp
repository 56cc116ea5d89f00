#include "trainer/onboarding/record_verdict.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iterator>

#include "base/text.h"
#include "trainer/calibration.h"
#include "trainer/statistics.h"

namespace fdi::trainer {
namespace {

constexpr double kLeastSpan = 5.0;    // Span of the command [%].
constexpr double kLeastJudged = 0.5;  // Share of a part of the record.
constexpr double kMostlyRead = 0.9;   // Below it, the readings are told.

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

// The hours that rest on readings; what else a record has is held or filled in.
struct ReadHours {
  double command{0.0};
  double answer{0.0};  // X or F, whatever has more.
  std::string text;  // "X 0.08 h, F 2.50 h"; empty: hardly anything is filled.
};

ReadHours ReadHoursOf(const std::vector<TrainingRun>& runs) {
  ReadHours read;
  bool filled = false;
  for (const Signal signal : {Signal::kCv, Signal::kX, Signal::kF}) {
    double all = 0.0;
    double hours = 0.0;
    for (const TrainingRun& run : runs) {
      for (const LabelledSample& labelled : run.samples) {
        const Sample& sample = labelled.sample;
        const bool there = sample.Has(signal);
        all += there ? run.period_s / 3600.0 : 0.0;
        hours += there && sample.quality[Index(signal)] == SignalQuality::kGood
                     ? run.period_s / 3600.0
                     : 0.0;
      }
    }
    const bool is_filled = hours < kMostlyRead * all;
    if (signal == Signal::kCv) {
      read.command = hours;
    } else {
      read.answer = std::max(read.answer, hours);
    }
    if (all > 0.0 && (is_filled || signal != Signal::kCv)) {
      filled = filled || is_filled;
      read.text += (read.text.empty() ? "" : ", ") +
                   std::string(SignalName(signal)) + ' ' + Fixed(hours, 2) +
                   " h";
    }
  }
  if (!filled) {
    read.text.clear();
  }
  return read;
}

// Shortcomings of the record that show in the parts that were left out.
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
  const ReadHours read = ReadHoursOf(runs);
  std::vector<std::string> lacks;
  if (!read.text.empty() &&
      60.0 * std::min(read.command, read.answer) < kLeastMinutes) {
    lacks.push_back(Fixed(hours, 2) + " h, of which only " + read.text +
                    " rest on readings and the others are held or filled in: " +
                    Fixed(kLeastMinutes / 60.0, 2) +
                    " h of readings are needed");
  }
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
  const std::string rests =
      read.text.empty() ? std::string()
                        : ", of which " + read.text + " rest on readings,";
  return {"usable", "usable: " + Fixed(hours, 2) + " h of healthy data" +
                        rests + " over " + Fixed(span, 0) +
                        " % of the command" + detected};
}

}  // namespace fdi::trainer
