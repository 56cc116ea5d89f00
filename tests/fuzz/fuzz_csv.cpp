// Tables for import: refused with a reason, or read; what was read and written
// again is the same table.
#include <cstdlib>
#include <sstream>
#include <string>

#include "diagnosis/error.h"
#include "storage/csv.h"

namespace {

using fdi::storage::CsvRun;

void ReadAgain(const CsvRun& run) {
  std::stringstream text;
  fdi::storage::WriteCsv(text, run.samples, run.flow_unit, 0);
  fdi::storage::CsvOptions options;
  options.period_s = run.period_s;
  options.required = 0;
  try {
    const fdi::storage::CsvTable table = fdi::storage::ReadCsv(text, options);
    if (table.runs.size() != 1 ||
        table.runs[0].samples.size() != run.samples.size()) {
      std::abort();
    }
  } catch (const fdi::DataError&) {
    // Signals that a row lacked are written as nan, which is refused.
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const unsigned char* data,
                                      std::size_t size) {
  if (size == 0) {
    return 0;
  }
  fdi::storage::CsvOptions options;
  options.split_gaps = (data[0] & 1) != 0;
  options.period_s = (data[0] & 2) != 0 ? 1.0 : 0.0;
  std::istringstream input(
      std::string(reinterpret_cast<const char*>(data) + 1, size - 1));
  try {
    for (const CsvRun& run : fdi::storage::ReadCsv(input, options).runs) {
      ReadAgain(run);
    }
  } catch (const fdi::DataError&) {
  }
  return 0;
}
