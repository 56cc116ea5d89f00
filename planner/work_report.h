#pragma once

#include <cstddef>

#include "report/json_output.h"
#include "report/report.h"

namespace fdi::planner {

/// The title of the page.
inline constexpr const char* kListTitle = "What is wrong";

/// The document of WorkList() for people: when it was made, what watches the
/// plant, and the first `top` rows (0: all). CSV and JSON have all rows.
report::Report WorkListReport(report::Json document, std::size_t top = 0);

/// The same document as a page to print: all rows, what they share, changes,
/// what could not be judged, what is shelved, and figures of the alarms.
report::Report WorkListPage(report::Json document);

}  // namespace fdi::planner
