#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "monitor/planner/work_list.h"
#include "storage/cli/fault_texts.h"
#include "storage/history_reader.h"

namespace fdi::planner {

/// Settings of ReadWorkList().
struct WorkQuery {
  std::string valve_glob{"*"};
  std::int64_t since_ns{0};  ///< Episodes from then on, and open ones.
  std::vector<monitor::HealthLimit> limits;
  std::string discipline;  ///< Only reasons of it; empty: any.
  std::size_t top{0};      ///< 0: all.
  WorkOptions options;     ///< now_ns is needed.
};

/// -10 % and +10 % of the flow that is expected.
std::vector<monitor::HealthLimit> DefaultLimits();

/// "operator", ... @throws ConfigError naming the accepted ones.
void RequireDiscipline(const std::string& discipline);

/// What history.db knows of the plant, ranked; see RankWork(). Trends are those
/// of the hours of health from since_ns on.
std::vector<WorkRow> ReadWorkList(storage::HistoryReader& history,
                                  const cli::FaultTexts& texts,
                                  const WorkQuery& query);

}  // namespace fdi::planner
