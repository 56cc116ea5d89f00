// Tables for import: refused with a reason, or read; what was read and written
// again is the same table.
#include <cstdlib>
#include <sstream>
#include <string>

#include "base/error.h"
#include "import/csv.h"

namespace {

using fdi::SampleSeries;

void ReadAgain(const SampleSeries& run) {
  std::stringstream text;
  fdi::importer::WriteCsv(text, run.samples, run.flow_unit, 0);
  fdi::importer::CsvOptions options;
  options.period_s = run.period_s;
  options.required = 0;
  try {
    const fdi::importer::CsvTable table =
        fdi::importer::ReadCsv(text.str(), options);
    if (table.runs.size() != 1 ||
        table.runs[0].samples.size() != run.samples.size()) {
      std::abort();
    }
  } catch (const fdi::DataError&) {
    // A run without any reading of CV, or of both X and F, is refused.
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const unsigned char* data,
                                      std::size_t size) {
  if (size == 0) {
    return 0;
  }
  fdi::importer::CsvOptions options;
  options.split_gaps = (data[0] & 1) != 0;
  options.period_s = (data[0] & 2) != 0 ? 1.0 : 0.0;
  const std::string bytes(reinterpret_cast<const char*>(data) + 1, size - 1);
  if ((data[0] & 4) != 0) {
    options.map.resampling.emplace();
  }
  try {
    for (const SampleSeries& run :
         fdi::importer::ReadCsv(fdi::ToUtf8(bytes, "input"), options).runs) {
      ReadAgain(run);
    }
  } catch (const fdi::DataError&) {
  } catch (const fdi::ConfigError&) {  // More samples than --resample makes.
  }
  return 0;
}
