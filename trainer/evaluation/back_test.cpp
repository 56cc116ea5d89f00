#include "trainer/evaluation/back_test.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <regex>
#include <tuple>

#include "base/error.h"
#include "base/time_text.h"
#include "diagnosis/fault_catalogue.h"
#include "diagnosis/valve_engine.h"
#include "report/text_table.h"
#include "simulator/valve_equations.h"
#include "trainer/campaign/file_runs.h"
#include "trainer/evaluation/csv_rows.h"
#include "trainer/evaluation/evaluation_report.h"
#include "trainer/statistics.h"

namespace fdi::trainer {
namespace {

using report::Json;
using std::filesystem::path;

// Work orders.

enum OrderColumn : std::size_t { kOrderValve, kOrderTime, kOrderFound };

std::int64_t TimeOf(const CsvRows& rows, std::size_t row) {
  const std::string& cell = rows.Cell(row, kOrderTime);
  //     time = seconds on the axis of the records / RFC 3339
  if (cell.find_first_not_of("0123456789.") == std::string::npos) {
    constexpr double kMost = 9e9;  // s; the stamps of samples end there.
    const double seconds = rows.Number(row, kOrderTime);
    if (seconds > kMost) {
      rows.Refuse(row, "time " + cell +
                           " is not in 0..9e9 s; expected seconds, or a date "
                           "such as 2026-03-01T14:00:00Z");
    }
    return std::llround(seconds * 1e9);
  }
  try {
    return ParseTime(cell, true);
  } catch (const ConfigError& error) {
    rows.Refuse(row, error.what());
  }
}

int FoundOf(const CsvRows& rows, std::size_t row) {
  const std::string& cell = rows.Cell(row, kOrderFound);
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

// Files.

bool IsCsv(const path& file) {
  return file.extension() == ".csv";
}

std::vector<path> FilesOf(const std::string& pattern) {
  if (!std::filesystem::is_directory(pattern)) {
    std::vector<path> files =
        MatchingFiles(pattern, std::filesystem::current_path());
    std::erase_if(files, [](const path& file) { return !exists(file); });
    return files;
  }
  std::vector<path> files;
  for (const auto& entry :
       std::filesystem::recursive_directory_iterator(pattern)) {
    if (entry.is_regular_file() && IsCsv(entry.path())) {
      files.push_back(entry.path());
    }
  }
  return files;
}

// date = YYYY "-" MM "-" DD ["T" HH [":"] MM [[":"] SS] ["Z"]], anywhere in the
// name of the file; UTC. A colon cannot be part of a file name everywhere.
std::optional<std::int64_t> StartInName(const path& file) {
  static const std::regex kDate(
      R"((\d{4}-\d{2}-\d{2})(?:T(\d{2}):?(\d{2})(?::?(\d{2}))?Z?)?)");
  const std::string name = file.stem().string();
  std::smatch match;
  if (!std::regex_search(name, match, kDate)) {
    return std::nullopt;
  }
  std::string time = match[1].str() + "T00:00:00Z";
  if (match[2].matched) {
    time = match[1].str() + "T" + match[2].str() + ":" + match[3].str() + ":" +
           (match[4].matched ? match[4].str() : "00") + "Z";
  }
  try {
    return ParseTime(time, true);
  } catch (const ConfigError&) {
    throw DataError(file.string() + ": the date in its name, " +
                    match[0].str() + ", does not exist");
  }
}

// Episodes.

// Feeds the samples of one valve to one engine. Stamps decide over gaps; the
// sequence numbers are made up, because files have none.
class Follower {
 public:
  explicit Follower(const std::shared_ptr<const ModelSet>& models,
                    PastRecord& record)
      : models_(*models), engine_(models), record_(record) {}

  void Take(Sample sample) {
    // One source throughout: the engine restarts its observers for a new one,
    // and its state shall pass from file to file.
    sample.source_id = 1;
    sample.seq = seq_++;
    const Verdict& verdict = engine_.Step(sample);
    const double hours = models_.sample_period_s / 3600.0;
    record_.first_ns = seq_ == 1 ? sample.stamp_ns : record_.first_ns;
    record_.last_ns = sample.stamp_ns;
    record_.hours += hours;
    record_.live_hours += verdict.quality == Quality::kLive ? hours : 0.0;
    record_.rejected += verdict.intake != Intake::kAccepted;
    for (const Transition& transition : verdict.Transitions()) {
      Take(transition);
    }
    // An episode that never ends lasts to the last sample.
    if (verdict.detected) {
      record_.episodes.back().ended_ns = sample.stamp_ns;
    }
  }

  bool has_samples() const { return seq_ > 0; }

 private:
  // Every other transition belongs to the episode opened last: a valve has one
  // at a time, and the engine begins without any.
  void Take(const Transition& transition) {
    if (transition.kind == TransitionKind::kDetected) {
      record_.episodes.push_back(
          {record_.valve, transition.stamp_ns, transition.stamp_ns, {}});
      return;
    }
    PastEpisode& episode = record_.episodes.back();
    episode.ended_ns = transition.stamp_ns;
    // A transition without faults does not take back what was said.
    if (transition.faults != 0) {
      episode.said = FaultsIn(models_, transition.faults);
    }
  }

  const ModelSet& models_;
  ValveEngine engine_;
  PastRecord& record_;
  std::uint64_t seq_{0};
};

// Judgement.

// By OrderOutcome.
constexpr std::array<std::string_view, 8> kOutcomeNames{
    "exact",  "contained", "wrong", "unknown",
    "missed", "silent",    "false", "no data"};

constexpr std::int64_t kNever = std::numeric_limits<std::int64_t>::min();

double Seconds(std::int64_t ns) {
  return static_cast<double>(ns) / 1e9;
}

OrderOutcome OutcomeOf(int found, const std::vector<int>& said) {
  if (found == 0) {
    return OrderOutcome::kFalse;
  }
  if (said.empty()) {
    return OrderOutcome::kUnknown;
  }
  if (std::find(said.begin(), said.end(), found) == said.end()) {
    return OrderOutcome::kWrong;
  }
  return said.size() == 1 ? OrderOutcome::kExact : OrderOutcome::kContained;
}

// From the best to the worst answer to a fault that was found.
int RankOf(OrderOutcome outcome) {
  switch (outcome) {
    case OrderOutcome::kExact:
      return 0;
    case OrderOutcome::kContained:
      return 1;
    case OrderOutcome::kUnknown:
      return 2;
    default:
      return 3;
  }
}

// Whether `order` may be the answer to `episode`: it was open at some time
// within the horizon before the order, and began after `begin_ns`.
//
//     begin < detected ≤ order,   order − min(ended, order) ≤ horizon
//
// An episode still open at the order has distance 0.
bool Precedes(const PastEpisode& episode, const WorkOrder& order,
              std::int64_t begin_ns, std::int64_t horizon_ns) {
  return episode.detected_ns > begin_ns &&
         episode.detected_ns <= order.time_ns &&
         order.time_ns - std::min(episode.ended_ns, order.time_ns) <=
             horizon_ns;
}

JudgedOrder Judge(const WorkOrder& order, const PastRecord* record,
                  std::int64_t previous_ns, std::int64_t horizon_ns) {
  JudgedOrder judged{order, OrderOutcome::kNoData, {}, -1, 0.0, 0.0};
  // Silence counts only if the record reaches into the time before this order
  // that the horizon and the order before leave.
  const std::int64_t begin_ns =
      std::max(previous_ns, order.time_ns - horizon_ns);
  if (record == nullptr || record->first_ns > order.time_ns ||
      record->last_ns < begin_ns) {
    return judged;
  }
  judged.outcome =
      order.found == 0 ? OrderOutcome::kSilent : OrderOutcome::kMissed;
  for (const PastEpisode& episode : record->episodes) {
    if (!Precedes(episode, order, previous_ns, horizon_ns)) {
      continue;
    }
    const OrderOutcome outcome = OutcomeOf(order.found, episode.said);
    // Episodes are in order of detection, so the first match gives the lead.
    if (judged.first_ns < 0) {
      judged.first_ns = episode.detected_ns;
      judged.lead_s = Seconds(order.time_ns - episode.detected_ns);
    }
    judged.duration_s += Seconds(std::min(episode.ended_ns, order.time_ns) -
                                 episode.detected_ns);
    const bool first = judged.outcome == OrderOutcome::kMissed ||
                       judged.outcome == OrderOutcome::kSilent;
    // Of equally good answers the last one is reported, nearest to the order.
    if (first || RankOf(outcome) <= RankOf(judged.outcome)) {
      judged.outcome = outcome;
      judged.said = episode.said;
    }
  }
  return judged;
}

// Sorts an episode into those that a repair proved, false ones and undecided.
void SortEpisode(const PastEpisode& episode, const PastRecord& record,
                 const std::vector<WorkOrder>& orders, std::int64_t horizon_ns,
                 BackTest& result) {
  // Until when an order would be known: the records end there, and an order
  // after them shows that the list goes on.
  std::int64_t known_until_ns = record.last_ns;
  bool followed = false;
  for (const WorkOrder& order : orders) {
    if (order.valve != episode.valve) {
      continue;
    }
    known_until_ns = std::max(known_until_ns, order.time_ns);
    // What an order did not find, a later one within the horizon may have.
    if (Precedes(episode, order, kNever, horizon_ns)) {
      followed = true;
      if (order.found != 0) {
        return;
      }
    }
  }
  // Of an episode that no order followed, nobody knows before the horizon is
  // over whether an order would have come.
  const bool decided =
      followed || known_until_ns - episode.ended_ns >= horizon_ns;
  (decided ? result.false_episodes : result.undecided).push_back(episode);
}

// Reports.

std::string FoundText(int found) {
  return found == 0 ? "nothing" : FaultName(found);
}

Json EpisodesJson(const std::vector<PastEpisode>& episodes) {
  Json list = Json::array();
  for (const PastEpisode& episode : episodes) {
    list.push_back({{"valve_id", episode.valve},
                    {"detected_s", Seconds(episode.detected_ns)},
                    {"ended_s", Seconds(episode.ended_ns)},
                    {"said", SetText(episode.said)}});
  }
  return list;
}

Json OrderJson(const JudgedOrder& judged) {
  const bool said = judged.first_ns >= 0;
  return {{"valve_id", judged.order.valve},
          {"time_s", Seconds(judged.order.time_ns)},
          {"found", FoundText(judged.order.found)},
          {"outcome", OutcomeName(judged.outcome)},
          {"said", said ? Json(SetText(judged.said)) : Json()},
          {"first_s", said ? Json(Seconds(judged.first_ns)) : Json()},
          {"ahead_s", judged.lead_s},
          {"duration_s", judged.duration_s}};
}

// "-" where nothing was said at all.
std::string SaidText(const Json& row) {
  const Json& said = row.at("said");
  if (said.is_null()) {
    return "-";
  }
  const auto text = said.get<std::string>();
  return text.empty() ? "unknown" : text;
}

// A date, or seconds if the axis of the records is not UTC.
report::Column TimeColumn(const char* heading, const char* key, bool utc) {
  // An axis of seconds from 0 would have to be three years long to be taken for
  // dates.
  constexpr double kFirstDate = 1e8;  // 1973
  return {.heading = heading,
          .key = key,
          .text = [key, utc](const Json& row) -> std::string {
            if (row.at(key).is_null()) {
              return "-";
            }
            const double seconds = row.at(key);
            return seconds < kFirstDate
                       ? report::FormatNumber(seconds, 0) + " s"
                       : FormatTime(std::llround(seconds * 1e9), utc);
          }};
}

report::Column DurationColumn(
    const char* heading, const char* key,
    const std::function<double(const Json& row)>& seconds) {
  return {.heading = heading, .key = key, .text = [seconds](const Json& row) {
            const double value = seconds(row);
            return value < 0.0 ? "-"
                               : FormatDuration(std::llround(value * 1e9));
          }};
}

void AddEpisodes(const char* heading, const char* key, bool utc,
                 report::Report& report) {
  if (report.document.at(key).empty()) {
    return;
  }
  report.Line("").Table(
      key, {{heading, "valve_id"},
            TimeColumn("detected", "detected_s", utc),
            DurationColumn("for", "ended_s",
                           [](const Json& row) {
                             return row.at("ended_s").get<double>() -
                                    row.at("detected_s").get<double>();
                           }),
            {.heading = "said", .key = "said", .text = SaidText}});
}

int CountOf(const OutcomeCounts& counts, std::size_t outcome) {
  const auto found = counts.find(static_cast<OrderOutcome>(outcome));
  return found == counts.end() ? 0 : found->second;
}

std::string OutcomesTable(const BackTest& test) {
  std::vector<report::TextTable::Column> columns{{"found"}};
  for (const std::string_view name : kOutcomeNames) {
    columns.push_back({std::string(name), report::Align::kRight});
  }
  report::TextTable table(std::move(columns));
  for (const auto& [fault, counts] : test.by_fault) {
    std::vector<std::string> row{FoundText(fault)};
    for (std::size_t o = 0; o < kOutcomeNames.size(); ++o) {
      row.push_back(CountText(CountOf(counts, o)));
    }
    table.AddRow(std::move(row));
  }
  return '\n' + TextOf(table);
}

}  // namespace

std::vector<WorkOrder> ReadWorkOrders(const std::filesystem::path& file) {
  const CsvRows rows(file, {"valve", "time", "found"});
  std::vector<WorkOrder> orders;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (rows.Cell(i, kOrderValve).empty()) {
      rows.Refuse(i, "the valve is missing");
    }
    orders.push_back(
        {rows.Cell(i, kOrderValve), TimeOf(rows, i), FoundOf(rows, i)});
  }
  std::sort(
      orders.begin(), orders.end(), [](const WorkOrder& a, const WorkOrder& b) {
        return std::tie(a.valve, a.time_ns) < std::tie(b.valve, b.time_ns);
      });
  return orders;
}

std::vector<ValveFiles> FindHistory(const std::string& pattern,
                                    const std::string& valve) {
  std::map<std::string, std::vector<path>> by_valve;
  for (const path& file : FilesOf(pattern)) {
    const path folder = std::filesystem::absolute(file).parent_path();
    by_valve[valve.empty() ? folder.filename().string() : valve].push_back(
        file);
  }
  if (by_valve.empty()) {
    throw NotFoundError("no CSV file in " + pattern);
  }
  std::vector<ValveFiles> valves;
  for (auto& [name, files] : by_valve) {
    // By date, then by name. Files without a date come before all others.
    std::sort(files.begin(), files.end(), [](const path& a, const path& b) {
      return std::pair(StartInName(a), a) < std::pair(StartInName(b), b);
    });
    valves.push_back({name, std::move(files)});
  }
  return valves;
}

PastRecord FollowHistory(const ValveFiles& files,
                         const std::shared_ptr<const ModelSet>& models,
                         const importer::CsvOptions& options,
                         const std::function<void(const path&)>& begin_file) {
  PastRecord record;
  record.valve = files.valve;
  Follower follower(models, record);
  for (const path& file : files.files) {
    if (begin_file) {
      begin_file(file);
    }
    importer::CsvOptions csv = options;
    csv.required = RequiredSignals(*models);
    // Without the period of the models, a file of one sample has none.
    csv.split_gaps = true;
    csv.period_s = models->sample_period_s;
    csv.start_ns = StartInName(file).value_or(0);
    const importer::CsvTable table = importer::ReadCsvFile(file, csv);
    simulator::FlowConversion conversion(models->flow_unit);
    const Sample& first = table.runs.front().samples.front().sample;
    if (follower.has_samples() && first.stamp_ns <= record.last_ns) {
      throw DataError(file.string() + ": begins at " +
                      FormatTime(first.stamp_ns, true) +
                      ", not after the end of the file before, " +
                      FormatTime(record.last_ns, true) +
                      "; a date in the names of files (YYYY-MM-DD or "
                      "YYYY-MM-DDTHHMM) tells when t_s = 0 is");
    }
    for (const SampleSeries& run : table.runs) {
      for (LabelledSample labelled : run.samples) {
        conversion.Apply(labelled.sample);
        follower.Take(labelled.sample);
      }
    }
  }
  return record;
}

std::string_view OutcomeName(OrderOutcome outcome) {
  return kOutcomeNames[static_cast<std::size_t>(outcome)];
}

BackTest JudgeHistory(const std::vector<PastRecord>& records,
                      const std::vector<WorkOrder>& orders, double horizon_s) {
  const std::int64_t horizon_ns = std::llround(horizon_s * 1e9);
  BackTest result;
  for (std::size_t i = 0; i < orders.size(); ++i) {
    const WorkOrder& order = orders[i];
    const auto record = std::find_if(
        records.begin(), records.end(),
        [&](const PastRecord& r) { return r.valve == order.valve; });
    // The orders are sorted by valve and time (ReadWorkOrders), so the one
    // before is the neighbour.
    const bool has_previous = i > 0 && orders[i - 1].valve == order.valve;
    result.orders.push_back(
        Judge(order, record == records.end() ? nullptr : &*record,
              has_previous ? orders[i - 1].time_ns : kNever, horizon_ns));
    ++result.by_fault[order.found][result.orders.back().outcome];
  }
  for (const PastRecord& record : records) {
    for (const PastEpisode& episode : record.episodes) {
      SortEpisode(episode, record, orders, horizon_ns, result);
    }
  }
  return result;
}

report::Report BackTestReport(const BackTest& test,
                              const std::vector<PastRecord>& records,
                              bool utc) {
  report::Report report;
  Json& json = report.document;
  json["orders"] = Json::array();
  for (const JudgedOrder& judged : test.orders) {
    json["orders"].push_back(OrderJson(judged));
  }
  json["by_fault"] = Json::object();
  for (const auto& [fault, counts] : test.by_fault) {
    for (std::size_t o = 0; o < kOutcomeNames.size(); ++o) {
      json["by_fault"][FoundText(fault)][std::string(kOutcomeNames[o])] =
          CountOf(counts, o);
    }
  }
  json["false_episodes"] = EpisodesJson(test.false_episodes);
  json["undecided_episodes"] = EpisodesJson(test.undecided);
  double hours = 0.0;
  double live_hours = 0.0;
  std::int64_t rejected = 0;
  for (const PastRecord& record : records) {
    hours += record.hours;
    live_hours += record.live_hours;
    rejected += record.rejected;
  }
  json["hours"] = hours;
  json["live_hours"] = live_hours;
  json["rejected_samples"] = rejected;

  // A lead and a duration mean nothing where nothing was said.
  const auto if_said = [](const char* key) {
    return [key](const Json& row) {
      return row.at("first_s").is_null() ? -1.0 : row.at(key).get<double>();
    };
  };
  report.Table("orders",
               {{"valve", "valve_id"},
                TimeColumn("order", "time_s", utc),
                {"found", "found"},
                {.heading = "said before", .key = "said", .text = SaidText},
                TimeColumn("first", "first_s", utc),
                DurationColumn("ahead", "ahead_s", if_said("ahead_s")),
                DurationColumn("for", "duration_s", if_said("duration_s")),
                {"outcome", "outcome"}});
  report.Line(OutcomesTable(test));
  AddEpisodes("false episode", "false_episodes", utc, report);
  AddEpisodes("undecided episode", "undecided_episodes", utc, report);
  const auto false_episodes = static_cast<int>(test.false_episodes.size());
  std::string line = '\n' + report::FormatNumber(hours, 1) + " h of samples, " +
                     report::FormatNumber(live_hours, 1) + " h diagnosed, " +
                     std::to_string(rejected) + " samples rejected; " +
                     std::to_string(false_episodes) + " false episodes";
  if (live_hours > 0.0) {
    const EventRate rate = RateOf(false_episodes, live_hours);
    line += ", " + report::FormatNumber(rate.per_year, 2) +
            " per valve-year (95 %: below " +
            report::FormatNumber(rate.upper, 2) + ")";
  }
  return report.Line(line);
}

}  // namespace fdi::trainer
