#include "planner/loop_coverage.h"

#include <algorithm>
#include <array>
#include <string_view>

#include "base/time_units.h"
#include "storage/models/models.h"
#include "storage/models/plant_loops.h"

namespace fdi::planner {
namespace {

using report::Json;

// A loop that was judged for a smaller share of the time is listed as unjudged.
constexpr double kMostlyJudged = 0.5;

// Why a valve was not judged, by QualityName().
std::string QualityText(const std::string& quality) {
  constexpr std::array<std::pair<std::string_view, const char*>, 7> kTexts{{
      {"STALE", "no data came"},
      {"BAD_INPUT",
       "readings were missing, bad, implausible or in another "
       "unit"},
      {"SETTLING", "its observers were settling"},
      {"INHIBITED", "its loop was not in automatic"},
      {"UNCOVERED", "it worked where its model set was not trained"},
      {"MODEL_UNSUITED", "its model set no longer fits it"},
      {"UNASSIGNED",
       "it has no model set, and no window of its loop was judged"},
  }};
  for (const auto& [name, text] : kTexts) {
    if (quality == name) {
      return text;
    }
  }
  return quality;
}

// "stiction, likely, band 2.00 % of OP: X sticks", as onboarding stores it.
LoopAudits::Window VerdictOf(const storage::PlantLoop& row) {
  const std::string& text = row.finding;
  LoopAudits::Window window;
  window.loop = row.name;
  window.verdict = text.substr(0, text.find_first_of(",:"));
  window.sure = text.starts_with(window.verdict + ", sure");
  const std::size_t colon = text.find(": ");
  window.reason = colon == std::string::npos ? text : text.substr(colon + 2);
  window.reason += "; so says its record, as onboarded";
  // Whole seconds, as repairs have.
  window.start_ns = window.end_ns =
      row.checked_ns / kNsPerSecond * kNsPerSecond;
  return window;
}

}  // namespace

LoopCoverage::LoopCoverage(storage::History* history, const WorkQuery& query,
                           std::int64_t since_ns)
    : query_(query) {
  for (const PlannedLoop& loop : query.loops) {
    loops_[loop.valve_id] = loop;
  }
  for (const std::string& valve : query.judged_now) {
    KnowNamed(valve);
  }
  for (const LoopAudits::Window& audit : query.audits.windows) {
    Know(audit.loop);
  }
  for (const auto& [loop, reason] : query.audits.skipped) {
    Know(loop);
  }
  if (history == nullptr) {
    return;
  }
  storage::EpisodeFilter filter;
  filter.since_ns = since_ns;
  for (const storage::CoverageTime& time : history->Coverage(filter)) {
    Know(time.valve_id);
    Judged& judged = times_[time.valve_id];
    judged.hours += time.hours;
    if (time.quality == QualityName(Quality::kLive)) {
      judged.live_hours += time.hours;
      named_.insert(time.valve_id);
    } else if (time.hours > judged.worst_hours) {
      judged.worst_hours = time.hours;
      judged.worst = time.quality;
    }
  }
}

void LoopCoverage::KnowNamed(const std::string& valve) {
  Know(valve);
  named_.insert(valve);
}

bool LoopCoverage::IsAudited(const std::string& valve) const {
  return std::ranges::find(query_.audits.windows, valve,
                           &LoopAudits::Window::loop) !=
         query_.audits.windows.end();
}

// The quality that lasted longest, or else what the plant's table says about
// the record; and, with either, why the audit could not judge the loop.
std::string LoopCoverage::WhyNotJudged(const std::string& valve) const {
  const auto time = times_.find(valve);
  std::string why;
  if (time != times_.end() && !time->second.worst.empty()) {
    why = QualityText(time->second.worst);
  } else {
    const std::string& finding = loops_.at(valve).finding;
    why = finding.empty() ? "no data came" : finding;
  }
  for (const auto& [loop, reason] : query_.audits.skipped) {
    if (loop == valve) {
      return why + "; audit: " + reason;
    }
  }
  return why;
}

Json LoopCoverage::CountsJson() const {
  std::size_t names = 0;
  std::size_t audit = 0;
  for (const auto& [valve, loop] : loops_) {
    const bool named = named_.contains(valve);
    names += named ? 1 : 0;
    audit += !named && IsAudited(valve) ? 1 : 0;
  }
  return {{"loops", loops_.size()},
          {"named_faults", names},
          {"audit", audit},
          {"nothing", loops_.size() - names - audit}};
}

// A loop that is only audited has no share of the time: the audit judges
// windows, not hours.
Json LoopCoverage::UnjudgedJson() const {
  Json list = Json::array();
  for (const auto& [valve, loop] : loops_) {
    const auto time = times_.find(valve);
    const double share = time == times_.end() || time->second.hours <= 0.0
                             ? 0.0
                             : time->second.live_hours / time->second.hours;
    const bool named = named_.contains(valve);
    const bool partly = time != times_.end() && named && share < kMostlyJudged;
    if ((!named && !IsAudited(valve)) || partly) {
      list.push_back({{"valve_id", valve},
                      {"judged_share", SixDigits(share)},
                      {"reason", WhyNotJudged(valve)}});
    }
  }
  return list;
}

std::vector<PlannedLoop> LoopsOf(const std::filesystem::path& models) {
  std::vector<PlannedLoop> loops;
  if (!std::filesystem::exists(models)) {
    return loops;
  }
  storage::ModelStore store(models);
  for (const storage::PlantLoop& row : store.Loops()) {
    PlannedLoop& loop = loops.emplace_back();
    loop.valve_id = row.name;
    loop.about = static_cast<const ValveIdentity&>(row);
    // The finding of other rows is a verdict, or how the set was made.
    if (row.state == storage::LoopState::kRefused ||
        row.finding.starts_with("not judged")) {
      loop.finding = row.finding;
    } else if (row.state == storage::LoopState::kDataOnly) {
      loop.verdict = VerdictOf(row);
    }
  }
  for (const storage::ValveEntry& entry : store.Valves()) {
    const bool known = std::ranges::find(loops, entry.pattern,
                                         &PlannedLoop::valve_id) != loops.end();
    if (!known && entry.pattern.find_first_of("*?[") == std::string::npos) {
      loops.push_back({entry.pattern});
    }
  }
  return loops;
}

std::vector<Repair> RepairsOf(const std::filesystem::path& models) {
  std::vector<Repair> repairs;
  if (std::filesystem::exists(models)) {
    for (const auto& [valves, event] : storage::ModelStore(models).Repairs()) {
      repairs.push_back({valves, event.at_ns, event.who,
                         std::string(ValveEventKindName(event.kind)),
                         event.kind == storage::ValveEventKind::kOrdered,
                         event.order, event.expected_ns});
    }
  }
  return repairs;
}

}  // namespace fdi::planner
