#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "storage/database/data_directory.h"

namespace fdi::storage {

/// What the audit says about the loops that have stored runs.
struct LoopAudits {
  struct Window {
    std::string loop;
    std::string verdict;  ///< loop::VerdictName()
    bool sure{false};
    std::string reason;
    std::optional<double> band_pct;  ///< Of stiction [% of OP].
    std::int64_t start_ns{0};
  };
  struct Period {
    double period_s{0.0};
    std::vector<std::string> loops;
  };
  std::vector<Window> windows;
  std::vector<Period> periods;  ///< Of several loops each.
  /// Loops without a window that could be judged, and why.
  std::vector<std::pair<std::string, std::string>> skipped;
};

/// Audits of each loop at most `windows` windows of two hours, spread over its
/// newest run since `since_ns`. Simulated runs are of no loop of the plant.
/// Empty without runs.
LoopAudits AuditStoredRuns(const DataDirectory& data, std::int64_t since_ns,
                           int windows);

}  // namespace fdi::storage
