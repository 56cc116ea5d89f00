#include "storage/csv.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstring>
#include <fstream>
#include <istream>
#include <limits>
#include <ostream>
#include <utility>

#include "diagnosis/error.h"
#include "diagnosis/fault_catalogue.h"
#include "storage/csv_columns.h"

namespace fdi::storage {
namespace {

/// Appends the shortest text that reads back as the same double.
void AppendNumber(std::string& text, double value) {
  std::array<char, 32> digits;
  const auto end =
      std::to_chars(digits.data(), digits.data() + digits.size(), value).ptr;
  text.append(digits.data(), end);
}

/// All lines of a stream; keeps them, as the period is known at the end only.
std::vector<std::string> Lines(std::istream& input, const std::string& source) {
  std::vector<std::string> lines;
  std::string line;
  while (std::getline(input, line)) {
    lines.push_back(std::move(line));
    line.clear();
  }
  if (input.bad()) {
    throw DataError(source + ": cannot be read: " + std::strerror(errno));
  }
  return lines;
}

/// The most usual step in time; 0 if there is none. Steps within 1 % of the
/// median count as one.
double UsualStep(const std::vector<std::string>& lines, CsvOptions options) {
  // A first pass with every step allowed. What is wrong with a row is left to
  // the second one, which knows more.
  options.split_gaps = true;
  options.period_s = std::numeric_limits<double>::min();
  CsvReader reader(options);
  std::vector<double> steps;
  std::optional<double> last_t_s;
  try {
    for (const std::string& line : lines) {
      if (const auto row = reader.TakeLine(line)) {
        if (last_t_s) {
          steps.push_back(row->t_s - *last_t_s);
        }
        last_t_s = row->t_s;
      }
    }
  } catch (const DataError&) {
  }
  if (steps.empty()) {
    return 0.0;
  }
  const auto middle =
      steps.begin() + static_cast<std::ptrdiff_t>((steps.size() - 1) / 2);
  std::nth_element(steps.begin(), middle, steps.end());
  return *middle;
}

CsvRun EmptyRun(const CsvHeader& header, double period_s) {
  CsvRun run;
  run.flow_unit = header.flow_unit;
  run.period_s = period_s;
  run.has_truth = header.has_truth;
  run.signals = header.signals;
  return run;
}

/// What a table has.
struct Columns {
  std::vector<SignalColumn> signals;
  bool mode{false};
  bool truth{false};
};

Columns ColumnsOf(std::span<const LabelledSample> samples, FlowUnit flow_unit) {
  Columns columns;
  SignalMask occurring = 0;
  for (const LabelledSample& labelled : samples) {
    occurring = static_cast<SignalMask>(occurring | labelled.sample.present);
    columns.truth = columns.truth || labelled.truth;
    columns.mode = columns.mode || labelled.sample.mode != ValveMode::kAuto;
  }
  for (const SignalColumn& column : kSignalColumns) {
    const bool wrong_unit =
        column.signal == Signal::kF && column.flow_unit != flow_unit;
    if ((occurring & MaskOf(column.signal)) != 0 && !wrong_unit) {
      columns.signals.push_back(column);
    }
  }
  return columns;
}

void AppendHeader(std::string& text, const Columns& columns) {
  text += kTimeColumn;
  for (const SignalColumn& column : columns.signals) {
    text += ',';
    text += column.name;
  }
  if (columns.mode) {
    text += ',';
    text += kModeColumn;
  }
  if (columns.truth) {
    text += ',';
    text += kFaultColumn;
    text += ',';
    text += kStrengthColumn;
  }
  text += '\n';
}

void AppendRow(std::string& text, const LabelledSample& labelled,
               const Columns& columns, std::int64_t start_ns) {
  const Sample& sample = labelled.sample;
  AppendNumber(text, static_cast<double>(sample.stamp_ns - start_ns) / 1e9);
  for (const SignalColumn& column : columns.signals) {
    text += ',';
    const bool there =
        sample.Has(column.signal) &&
        (column.signal != Signal::kF || column.flow_unit == sample.flow_unit);
    AppendNumber(text, there ? sample[column.signal]
                             : std::numeric_limits<double>::quiet_NaN());
  }
  if (columns.mode) {
    text += ',';
    text += ValveModeName(sample.mode);
  }
  if (columns.truth) {
    const FaultTruth truth = labelled.truth.value_or(FaultTruth{});
    text += ',';
    text += FaultName(truth.fault);
    text += ',';
    AppendNumber(text, truth.strength);
  }
  text += '\n';
}

}  // namespace

CsvTable ReadCsv(std::istream& input, const CsvOptions& options) {
  const std::vector<std::string> lines = Lines(input, options.source);
  CsvOptions settled = options;
  if (settled.period_s == 0.0) {
    settled.period_s = UsualStep(lines, options);
  }
  CsvReader reader(settled);
  CsvTable table;
  for (const std::string& line : lines) {
    std::optional<CsvRow> row = reader.TakeLine(line);
    if (!row) {
      continue;
    }
    if (table.runs.empty() || row->after_gap) {
      table.runs.push_back(EmptyRun(reader.header(), settled.period_s));
    }
    table.runs.back().samples.push_back(row->labelled);
  }
  reader.Finish();
  if (settled.period_s == 0.0) {
    throw DataError(options.source +
                    ": one row does not tell the sample period");
  }
  table.header = reader.header();
  return table;
}

CsvTable ReadCsvFile(const std::filesystem::path& path, CsvOptions options) {
  options.source = path.string();
  std::error_code error;
  if (std::filesystem::is_directory(path, error)) {
    throw DataError(options.source + ": is a directory, not a file");
  }
  std::ifstream input(path);
  if (!input) {
    throw DataError(options.source +
                    ": cannot be opened: " + std::strerror(errno));
  }
  return ReadCsv(input, options);
}

void WriteCsv(std::ostream& output, std::span<const LabelledSample> samples,
              FlowUnit flow_unit, std::int64_t start_ns) {
  const Columns columns = ColumnsOf(samples, flow_unit);
  std::string text;
  AppendHeader(text, columns);
  for (const LabelledSample& labelled : samples) {
    AppendRow(text, labelled, columns, start_ns);
    output << text;
    text.clear();
  }
  if (!output.flush()) {
    throw DataError(std::string("CSV cannot be written: ") +
                    std::strerror(errno));
  }
}

}  // namespace fdi::storage
