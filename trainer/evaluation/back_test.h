#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "diagnosis/model_set.h"
#include "import/csv.h"
#include "report/report.h"

/// Back-tests: what would have been said about months of recorded files, and
/// what people found when they looked at the valves.
namespace fdi::trainer {

/// What was found when a valve was looked at.
struct WorkOrder {
  std::string valve;
  std::int64_t time_ns{0};  ///< UTC, or on the time axis of the records.
  int found{0};             ///< Fault; 0: nothing.
};

/// Reads work orders from a CSV file with the columns valve, time (RFC 3339,
/// UTC where no offset is given, or seconds) and found (a fault or `nothing`).
/// @returns them by valve and time.
/// @throws NotFoundError if there is no such file; DataError naming file, line
///   and reason.
std::vector<WorkOrder> ReadWorkOrders(const std::filesystem::path& file);

/// The files of one valve in order of time.
struct ValveFiles {
  std::string valve;
  std::vector<std::filesystem::path> files;
};

/// The CSV files of `pattern` by valve: those in a folder and in its folders,
/// or a path with * in the file's name. A file belongs to `valve`; if that is
/// empty, to the valve that its folder is named after.
/// @throws NotFoundError if there is none; ConfigError as MatchingFiles().
std::vector<ValveFiles> FindHistory(const std::string& pattern,
                                    const std::string& valve);

/// An episode that the engine would have opened.
struct PastEpisode {
  std::string valve;
  std::int64_t detected_ns{0};
  std::int64_t ended_ns{0};  ///< Of one that never ended: the last sample.
  std::vector<int> said;     ///< Last set isolated; empty: unknown.
};

/// The record of a valve: its extent, and what would have been said.
struct PastRecord {
  std::string valve;
  std::int64_t first_ns{0};
  std::int64_t last_ns{0};
  double hours{0.0};         ///< Of samples.
  double live_hours{0.0};    ///< Of these, diagnosed.
  std::int64_t rejected{0};  ///< Samples that no observer saw.
  std::vector<PastEpisode> episodes;
};

/// Feeds the files of a valve to one engine, sample by sample, and collects the
/// episodes. Where the stamps of a file continue one period after those of the
/// file before, so does the engine; elsewhere it meets a gap. A date in the
/// name of a file, YYYY-MM-DD, alone or followed by THHMM, THHMMSS or THH:MM:SS
/// (UTC), says when t_s = 0 is; without one t_s is the time axis.
///
/// @param begin_file Called with the name of a file before it is read.
/// @throws DataError naming the file if it lacks a signal of the model set or
///   begins before the end of the file before.
PastRecord FollowHistory(
    const ValveFiles& files, const std::shared_ptr<const ModelSet>& models,
    const importer::CsvOptions& csv,
    const std::function<void(const std::filesystem::path&)>& begin_file = {});

enum class OrderOutcome {
  kExact,      ///< The fault found was named alone,
  kContained,  ///< or in a set with others.
  kWrong,      ///< Other faults were named.
  kUnknown,    ///< Something was said to be wrong, not what.
  kMissed,     ///< A fault was found and nothing said.
  kSilent,     ///< Nothing was found, nothing said.
  kFalse,      ///< Nothing was found, something said.
  kNoData,     ///< The valve was not heard before the order.
};
std::string_view OutcomeName(OrderOutcome outcome);  ///< "exact", ...

/// A work order and what was said before it.
struct JudgedOrder {
  WorkOrder order;
  OrderOutcome outcome{OrderOutcome::kNoData};
  std::vector<int> said;      ///< The best answer of these episodes, or {}.
  std::int64_t first_ns{-1};  ///< First detection; −1: none.
  double lead_s{0.0};         ///< From then to the order.
  double duration_s{0.0};     ///< Episodes were open so long before it.
};

/// Orders of one fault by outcome.
using OutcomeCounts = std::map<OrderOutcome, int>;

struct BackTest {
  std::vector<JudgedOrder> orders;
  std::vector<PastEpisode> false_episodes;  ///< No fault was found after them.
  std::vector<PastEpisode> undecided;  ///< The records end within the horizon.
  std::map<int, OutcomeCounts> by_fault;  ///< 0: nothing was found.
};

/// Lays work orders over the records. Before an order count the episodes of its
/// valve that were open within the horizon and begun after the order before. Of
/// several, the best answer counts. An episode is false if no fault was found
/// within the horizon after it; undecided if the records and orders of its
/// valve end before that and no order followed it.
BackTest JudgeHistory(const std::vector<PastRecord>& records,
                      const std::vector<WorkOrder>& orders, double horizon_s);

/// Orders with what was said before them, outcomes by fault, episodes that were
/// false or are undecided, hours. @param utc Times for people in UTC.
report::Report BackTestReport(const BackTest& test,
                              const std::vector<PastRecord>& records, bool utc);

}  // namespace fdi::trainer
