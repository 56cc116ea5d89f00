#include "trainer/app/verdict_file.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "diagnosis/error.h"
#include "diagnosis/fault_catalogue.h"
#include "storage/cli/text_table.h"
#include "trainer/app/csv_rows.h"
#include "trainer/app/rescore.h"
#include "trainer/app/run_input.h"

namespace fdi::trainer {
namespace {

enum Column : std::size_t { kTime, kDetected, kFaults };

// Rows and samples belong together within this share of the period.
constexpr double kTimeTolerance = 0.01;

std::vector<int> FaultsOf(const CsvRows& rows, std::size_t row) {
  std::vector<int> faults;
  std::string rest = rows.Cell(row, kFaults);
  while (!rest.empty()) {
    const std::size_t bar = rest.find('|');
    const std::string name = rest.substr(0, bar);
    const auto fault = ParseFault(name);
    if (!fault) {
      rows.Refuse(
          row, "fault '" + name + "' is none of " + std::string(kFaultNames));
    }
    faults.push_back(*fault);
    rest = bar == std::string::npos ? "" : rest.substr(bar + 1);
  }
  std::sort(faults.begin(), faults.end());
  if (std::adjacent_find(faults.begin(), faults.end()) != faults.end()) {
    rows.Refuse(row, "a fault is there twice: " + rows.Cell(row, kFaults));
  }
  return faults;
}

Indication IndicationOf(const CsvRows& rows, std::size_t row) {
  Indication indication;
  indication.settled = true;
  const double detected = rows.Number(row, kDetected);
  if (detected != 0.0 && detected != 1.0) {
    rows.Refuse(
        row, "detected is " + rows.Cell(row, kDetected) + ", expected 0 or 1");
  }
  indication.detected = detected == 1.0;
  indication.isolated = FaultsOf(rows, row);
  if (!indication.detected && !indication.isolated.empty()) {
    rows.Refuse(row, "faults without detected = 1");
  }
  return indication;
}

double TimeOf(const storage::StoredRun& run, const Sample& sample) {
  return static_cast<double>(sample.stamp_ns - run.info.run.start_ns) * 1e-9;
}

}  // namespace

std::vector<Indication> ReadVerdicts(const std::filesystem::path& file,
                                     const storage::StoredRun& run) {
  const CsvRows rows(file, {"t_s", "detected"}, {"faults"});
  for (std::size_t i = 1; i < rows.size(); ++i) {
    if (!(rows.Number(i, kTime) > rows.Number(i - 1, kTime))) {
      rows.Refuse(i, "t_s does not rise");
    }
  }
  const double tolerance = kTimeTolerance * run.info.run.period_s;
  std::vector<Indication> all;
  std::size_t row = 0;
  double first_s = 0.0;
  for (const storage::StoredSample& stored : run.samples) {
    if (OutOfOrder(stored.intake)) {
      continue;
    }
    const double t_s = TimeOf(run, stored.sample);
    while (row < rows.size() && rows.Number(row, kTime) < t_s - tolerance) {
      ++row;
    }
    if (row == rows.size() || rows.Number(row, kTime) > t_s + tolerance) {
      throw DataError(file.string() + ": no row for t_s = " +
                      cli::FormatNumber(t_s, 3) + " of " + RunName(run));
    }
    first_s = all.empty() ? t_s : first_s;
    Indication indication = IndicationOf(rows, row);
    indication.time_s = t_s - first_s;
    indication.truth = TruthOf(stored);
    all.push_back(std::move(indication));
  }
  return all;
}

}  // namespace fdi::trainer
