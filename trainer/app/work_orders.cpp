#include "trainer/app/work_orders.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "diagnosis/error.h"
#include "diagnosis/fault_catalogue.h"
#include "storage/cli/time_text.h"
#include "trainer/app/csv_rows.h"

namespace fdi::trainer {
namespace {

enum Column : std::size_t { kValve, kTime, kFound };

std::int64_t TimeOf(const CsvRows& rows, std::size_t row) {
  const std::string& cell = rows.Cell(row, kTime);
  if (cell.find_first_not_of("0123456789.") == std::string::npos) {
    return std::llround(rows.Number(row, kTime) * 1e9);
  }
  try {
    return cli::ParseTime(cell, true);
  } catch (const ConfigError& error) {
    rows.Refuse(row, error.what());
  }
}

int FoundOf(const CsvRows& rows, std::size_t row) {
  const std::string& cell = rows.Cell(row, kFound);
  if (cell == "nothing") {
    return 0;
  }
  const auto fault = ParseFault(cell);
  if (!fault) {
    rows.Refuse(row, "found '" + cell + "' is neither nothing nor one of " +
                         std::string(kFaultNames));
  }
  return *fault;
}

}  // namespace

std::vector<WorkOrder> ReadWorkOrders(const std::filesystem::path& file) {
  const CsvRows rows(file, {"valve", "time", "found"});
  std::vector<WorkOrder> orders;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (rows.Cell(i, kValve).empty()) {
      rows.Refuse(i, "the valve is missing");
    }
    orders.push_back({rows.Cell(i, kValve), TimeOf(rows, i), FoundOf(rows, i)});
  }
  std::sort(
      orders.begin(), orders.end(), [](const WorkOrder& a, const WorkOrder& b) {
        return std::tie(a.valve, a.time_ns) < std::tie(b.valve, b.time_ns);
      });
  return orders;
}

}  // namespace fdi::trainer
