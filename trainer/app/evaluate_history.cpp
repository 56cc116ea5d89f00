#include <array>
#include <iostream>

#include "diagnosis/error.h"
#include "diagnosis/fault_catalogue.h"
#include "storage/cli/logging.h"
#include "storage/cli/tag_map.h"
#include "storage/cli/text_table.h"
#include "storage/cli/time_text.h"
#include "storage/data_directory.h"
#include "storage/models.h"
#include "trainer/app/evaluate_options.h"
#include "trainer/app/history_records.h"
#include "trainer/event_rate.h"

namespace fdi::trainer {
namespace {

using cli::Align;
using cli::FormatNumber;

constexpr double kDayS = 86400.0;
constexpr std::array kOutcomes{OrderOutcome::kExact,  OrderOutcome::kContained,
                               OrderOutcome::kWrong,  OrderOutcome::kUnknown,
                               OrderOutcome::kMissed, OrderOutcome::kSilent,
                               OrderOutcome::kFalse,  OrderOutcome::kNoData};

// The set asked for, or the one that is assigned to the valve.
std::shared_ptr<const ModelSet> ModelsFor(const EvaluateOptions& options,
                                          const std::string& valve,
                                          const cli::Context& context) {
  EvaluateOptions one = options;
  one.valve = options.model_set.empty() ? valve : std::string();
  return LoadModels(one, context);
}

std::vector<PastRecord> FollowAll(const EvaluateOptions& options,
                                  const cli::Context& context) {
  std::optional<storage::ColumnMap> map;
  if (!options.selection.map.empty()) {
    map = cli::ReadTagMap(options.selection.map);
  }
  std::vector<PastRecord> records;
  for (const ValveFiles& files : FindHistory(options.history, options.valve)) {
    records.push_back(FollowHistory(
        files, ModelsFor(options, files.valve, context), map,
        [&](const std::filesystem::path& file) {
          context.log(
              LogLevel::kInfo,
              cli::EventLine("history_file", {{"valve", files.valve},
                                              {"file", file.string()}}));
        }));
  }
  return records;
}

// A date, or seconds where the records do not tell it.
std::string TimeText(std::int64_t ns, const cli::Context& context) {
  constexpr std::int64_t kFirstDate = 100'000'000'000'000'000;  // 1973
  return ns < kFirstDate ? FormatNumber(static_cast<double>(ns) / 1e9, 0) + " s"
                         : cli::FormatTime(ns, context.options.utc);
}

std::string FoundText(int found) {
  return found == 0 ? "nothing" : FaultName(found);
}

std::string SaidText(bool said_something, const std::vector<int>& said) {
  return !said_something ? "-" : said.empty() ? "unknown" : SetText(said);
}

std::string LastingText(double seconds) {
  return cli::FormatDuration(static_cast<std::int64_t>(seconds * 1e9));
}

void PrintOrders(std::ostream& out, const BackTest& test,
                 const cli::Context& context) {
  cli::TextTable table({{"valve"},
                        {"order"},
                        {"found"},
                        {"said before"},
                        {"first"},
                        {"ahead"},
                        {"for"},
                        {"outcome"}});
  for (const JudgedOrder& judged : test.orders) {
    const bool said = judged.first_ns >= 0;
    table.AddRow({judged.order.valve, TimeText(judged.order.time_ns, context),
                  FoundText(judged.order.found), SaidText(said, judged.said),
                  said ? TimeText(judged.first_ns, context) : "-",
                  said ? LastingText(judged.lead_s) : "-",
                  said ? LastingText(judged.duration_s) : "-",
                  std::string(OutcomeName(judged.outcome))});
  }
  table.Print(out);
}

void PrintEpisodes(std::ostream& out, const char* heading,
                   const std::vector<PastEpisode>& episodes,
                   const cli::Context& context) {
  if (episodes.empty()) {
    return;
  }
  cli::TextTable table({{heading}, {"detected"}, {"for"}, {"said"}});
  for (const PastEpisode& episode : episodes) {
    table.AddRow({episode.valve, TimeText(episode.detected_ns, context),
                  cli::FormatDuration(episode.ended_ns - episode.detected_ns),
                  SaidText(true, episode.said)});
  }
  out << '\n';
  table.Print(out);
}

int CountOf(const OutcomeCounts& counts, OrderOutcome outcome) {
  const auto found = counts.find(outcome);
  return found == counts.end() ? 0 : found->second;
}

void PrintFaults(std::ostream& out, const BackTest& test) {
  std::vector<cli::TextTable::Column> columns{{"found"}};
  for (const OrderOutcome outcome : kOutcomes) {
    columns.push_back({std::string(OutcomeName(outcome)), Align::kRight});
  }
  cli::TextTable table(std::move(columns));
  for (const auto& [fault, counts] : test.by_fault) {
    std::vector<std::string> row{FoundText(fault)};
    for (const OrderOutcome outcome : kOutcomes) {
      row.push_back(CountText(CountOf(counts, outcome)));
    }
    table.AddRow(std::move(row));
  }
  out << '\n';
  table.Print(out);
}

struct Hours {
  double heard{0.0};
  double live{0.0};
  std::int64_t rejected{0};
};

Hours HoursOf(const std::vector<PastRecord>& records) {
  Hours hours;
  for (const PastRecord& record : records) {
    hours.heard += record.hours;
    hours.live += record.live_hours;
    hours.rejected += record.rejected;
  }
  return hours;
}

void Print(std::ostream& out, const BackTest& test, const Hours& hours,
           const cli::Context& context) {
  PrintOrders(out, test, context);
  PrintFaults(out, test);
  PrintEpisodes(out, "false episode", test.false_episodes, context);
  PrintEpisodes(out, "undecided episode", test.undecided, context);
  out << '\n'
      << FormatNumber(hours.heard, 1) << " h of samples, "
      << FormatNumber(hours.live, 1) << " h diagnosed, " << hours.rejected
      << " samples rejected; " << test.false_episodes.size()
      << " false episodes";
  if (hours.live > 0.0) {
    const EventRate rate =
        RateOf(static_cast<int>(test.false_episodes.size()), hours.live);
    out << ", " << FormatNumber(rate.per_year, 2)
        << " per valve-year (95 %: below " << FormatNumber(rate.upper, 2)
        << ')';
  }
  out << '\n';
}

cli::Json TimeJson(std::int64_t ns) {
  return static_cast<double>(ns) / 1e9;
}

cli::Json EpisodesJson(const std::vector<PastEpisode>& episodes) {
  cli::Json list = cli::Json::array();
  for (const PastEpisode& episode : episodes) {
    list.push_back({{"valve", episode.valve},
                    {"detected_s", TimeJson(episode.detected_ns)},
                    {"ended_s", TimeJson(episode.ended_ns)},
                    {"said", SetText(episode.said)}});
  }
  return list;
}

cli::Json JsonOf(const BackTest& test, const Hours& hours) {
  cli::Json json;
  json["orders"] = cli::Json::array();
  for (const JudgedOrder& judged : test.orders) {
    const bool said = judged.first_ns >= 0;
    json["orders"].push_back(
        {{"valve", judged.order.valve},
         {"time_s", TimeJson(judged.order.time_ns)},
         {"found", FoundText(judged.order.found)},
         {"outcome", OutcomeName(judged.outcome)},
         {"said", said ? cli::Json(SetText(judged.said)) : cli::Json()},
         {"first_s", said ? TimeJson(judged.first_ns) : cli::Json()},
         {"ahead_s", judged.lead_s},
         {"duration_s", judged.duration_s}});
  }
  json["by_fault"] = cli::Json::object();
  for (const auto& [fault, counts] : test.by_fault) {
    for (const OrderOutcome outcome : kOutcomes) {
      json["by_fault"][FoundText(fault)][std::string(OutcomeName(outcome))] =
          CountOf(counts, outcome);
    }
  }
  json["false_episodes"] = EpisodesJson(test.false_episodes);
  json["undecided_episodes"] = EpisodesJson(test.undecided);
  json["hours"] = hours.heard;
  json["live_hours"] = hours.live;
  json["rejected_samples"] = hours.rejected;
  return json;
}

}  // namespace

int EvaluateHistory(const EvaluateOptions& options,
                    const cli::Context& context) {
  const std::vector<WorkOrder> orders = ReadWorkOrders(options.work_orders);
  const std::vector<PastRecord> records = FollowAll(options, context);
  const BackTest test =
      JudgeHistory(records, orders, options.horizon_days * kDayS);
  const Hours hours = HoursOf(records);
  if (context.options.json) {
    cli::PrintJson(std::cout, JsonOf(test, hours));
  } else {
    Print(std::cout, test, hours, context);
  }
  return cli::kExitOk;
}

}  // namespace fdi::trainer
