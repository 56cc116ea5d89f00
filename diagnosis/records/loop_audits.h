#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace fdi {

/// The audit of the loops that have stored runs.
struct LoopAudits {
  struct Window {
    std::string loop;
    std::string verdict;  ///< loop::VerdictName()
    bool sure{false};
    std::string reason;
    std::optional<double> band_pct{};  ///< Stiction band [% of OP].
    std::int64_t start_ns{0};
    std::int64_t end_ns{0};
  };
  struct Period {
    double period_s{0.0};
    std::vector<std::string> loops;
  };
  std::vector<Window> windows{};
  std::vector<Period> periods{};  ///< Each is that of several loops.
  /// Loops without a window that could be judged, and why.
  std::vector<std::pair<std::string, std::string>> skipped{};
};

}  // namespace fdi
