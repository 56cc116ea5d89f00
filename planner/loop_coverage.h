#pragma once

#include <map>
#include <set>
#include <string>

#include "planner/work_list.h"
#include "report/json_output.h"
#include "storage/history/history.h"

namespace fdi::planner {

/// The loops and how each of them is watched: all that are planned,
/// and whatever was heard, recorded or found in the period, for a loop that
/// nobody has listed must not be missing.
class LoopCoverage {
 public:
  /// @param history null: nothing was judged yet.
  /// @param since_ns begin of the time of which it says what was judged.
  LoopCoverage(storage::History* history, const WorkQuery& query,
               std::int64_t since_ns);

  /// A loop that has a finding.
  void Know(const std::string& valve) {
    loops_.try_emplace(valve, PlannedLoop{valve});
  }
  /// A loop with a fault that a model set has found.
  void KnowNamed(const std::string& valve);

  /// {"loops", "named_faults", "audit", "nothing"}. Each loop counts once; one
  /// that is both judged and audited counts among the named faults.
  report::Json CountsJson() const;
  /// Loops that nothing watched, and loops with named faults that were judged
  /// for less than half of the time in which they were heard.
  report::Json UnjudgedJson() const;

 private:
  // Time by quality of one valve.
  struct Judged {
    double hours{0.0};
    double live_hours{0.0};
    std::string worst;  // The quality other than LIVE that lasted longest.
    double worst_hours{0.0};
  };

  bool IsAudited(const std::string& valve) const;
  std::string WhyNotJudged(const std::string& valve) const;

  const WorkQuery& query_;
  std::map<std::string, PlannedLoop> loops_;
  std::map<std::string, Judged> times_;
  std::set<std::string> named_;  // Judged by a model set.
};

}  // namespace fdi::planner
