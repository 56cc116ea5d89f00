#include "programs/monitor/top_board.h"

#include <algorithm>
#include <array>
#include <sstream>
#include <tuple>
#include <vector>

#include "base/printable.h"
#include "base/text.h"
#include "base/time_text.h"
#include "base/time_units.h"
#include "diagnosis/model/fault_catalogue.h"
#include "monitor/console/model_facts.h"

namespace fdi::monitor {
namespace {

using report::Json;
using report::Tone;

constexpr std::chrono::seconds kMonitorSilence{5};
constexpr std::size_t kShownFactors = 3;

bool Contains(const Json& row, const std::string& filter) {
  return std::ranges::any_of(
      std::array{"valve_id", "fault", "state", "quality", "model_set"},
      [&](const char* key) {
        return row[key].is_string() &&
               Lower(row[key].get<std::string>()).find(filter) !=
                   std::string::npos;
      });
}

bool Abnormal(const Json& row) {
  return row["state"] == "DETECTED" || row["state"] == "ISOLATED";
}

// Smaller is worse: isolated, detected, not or partly diagnosed, normal.
int Rank(const Json& row) {
  return row["state"] == "ISOLATED"  ? 0
         : Abnormal(row)             ? 1
         : row["silent"].get<bool>() ? 2
         : row["state"] != "NORMAL"  ? 3
                                     : 4;
}

Tone ToneOf(const Json& row) {
  return Abnormal(row)                                           ? Tone::kAlarm
         : row["silent"].get<bool>() || row["state"] != "NORMAL" ? Tone::kQuiet
                                                                 : Tone::kPlain;
}

// "f7 0.95  f19 0.80"
std::string NumbersText(const Json& numbers) {
  std::string text;
  for (const auto& [name, value] : numbers.items()) {
    text += (text.empty() ? "" : "  ") + name + " " +
            report::FormatNumber(value.get<double>(), 2);
  }
  return text.empty() ? "-" : text;
}

Json LargestOf(const Json& factors) {
  std::vector<std::pair<std::string, double>> sorted;
  for (const auto& [name, factor] : factors.items()) {
    if (factor > 0.0) {
      sorted.emplace_back(name, factor);
    }
  }
  std::ranges::stable_sort(
      sorted, [](const auto& a, const auto& b) { return a.second > b.second; });
  Json largest = Json::object();
  for (std::size_t i = 0; i < std::min(sorted.size(), kShownFactors); ++i) {
    largest[sorted[i].first] = sorted[i].second;
  }
  return largest;
}

// Lines other than rows: title, blank, heading, "too narrow", "more below",
// and the one that the last newline leads to.
constexpr std::size_t kOtherLines = 6;

std::string Title(const TopBoard& board, const TopView& view,
                  const Json& document, std::int64_t now_ns) {
  const Json& rows = document["valves"];
  std::string title =
      "fdi-monitor top  " +
      FormatTime(now_ns / kNsPerSecond * kNsPerSecond, view.utc) + "  " +
      std::to_string(board.valves()) + " valves, " +
      std::to_string(std::ranges::count_if(rows, Abnormal)) + " abnormal";
  if (!view.filter.empty()) {
    title += ", " + std::to_string(rows.size()) + " with '" + view.filter + "'";
  }
  return title + (document["monitor"].is_null()
                      ? "  NO MONITOR IS HEARD"
                      : "  monitor " + document["monitor"].get<std::string>());
}

}  // namespace

void TopBoard::Add(const idl::ModelSetInfoMessage& info,
                   Clock::time_point /*now*/) {
  names_.Add(info);
}

void TopBoard::Add(const idl::DecisionMessage& message, Clock::time_point now,
                   const idl::Reception& from) {
  decisions_[message.valve_id] = {message, now, from.participant_id,
                                  from.received_ns - from.sent_ns};
}

void TopBoard::Hear(const idl::Reception& reception) {
  const std::int64_t delay_ns = reception.received_ns - reception.sent_ns;
  std::int64_t& least =
      least_delay_ns_.try_emplace(reception.participant_id, delay_ns)
          .first->second;
  least = std::min(least, delay_ns);
}

// DDS hands the last vector of a valve to late joiners, so its arrival says
// little. The smallest delay of a participant is the difference of both clocks
// and the quickest way; what a vector took beyond that, it has waited.
bool TopBoard::IsSilent(const LatestVector& latest,
                        Clock::time_point now) const {
  const auto least = least_delay_ns_.find(latest.participant_id);
  const std::chrono::nanoseconds late(
      least == least_delay_ns_.end() ? 0 : latest.delay_ns - least->second);
  return now - latest.at + late > silence_;
}

void TopBoard::Add(const FaultEvent& message, Clock::time_point /*now*/) {
  const Transition& transition = message.transition;
  if (transition.kind != TransitionKind::kClosed) {
    open_[message.valve_id] = {transition.detection_stamp_ns,
                               message.episode_id, CertaintyOf(message)};
    return;
  }
  const auto found = open_.find(message.valve_id);
  if (found != open_.end() && found->second.id == message.episode_id) {
    open_.erase(found);
  }
}

void TopBoard::Add(const idl::MonitorStatusMessage& message,
                   Clock::time_point now) {
  monitors_[message.monitor] = {message, now};
}

void TopBoard::Remove(const std::string& valve_id) {
  decisions_.erase(valve_id);
  open_.erase(valve_id);
}

std::string TopBoard::Health(Clock::time_point now) const {
  std::string text;
  for (const auto& [monitor, heard] : monitors_) {
    const auto& [status, at] = heard;
    if (now - at <= kMonitorSilence) {
      text += (text.empty() ? "" : ", ") +
              std::string(idl::HealthName(status.health)) +
              (status.text.empty() ? "" : ": " + status.text);
    }
  }
  return text;
}

// The state is that of the vector. Since when it lasts, and that no known fault
// fits, only the events of the episode say.
Json TopBoard::RowOf(const LatestVector& latest, Clock::time_point now) const {
  const idl::DecisionMessage& message = latest.message;
  const Verdict& verdict = message.verdict;
  const idl::ModelSetInfoMessage* info = names_.Find(message.model_hash);
  const Json factors = names_.Factors(message);
  std::string faults;
  double largest = 0.0;
  double strength = 0.0;
  std::size_t f = 0;
  for (const auto& [name, value] : factors.items()) {
    const double factor = value.get<double>();
    const bool isolated = (verdict.isolated >> f & 1U) != 0;
    if (isolated) {
      faults += (faults.empty() ? "" : "|") + name;
      strength = factor >= largest ? verdict.strengths[f] : strength;
    }
    if (isolated || verdict.isolated == 0) {
      largest = std::max(largest, factor);
    }
    ++f;
  }
  const auto open = open_.find(message.valve_id);
  const bool abnormal = verdict.state != State::kNormal;
  const bool since = open != open_.end() && abnormal;
  const bool silent = IsSilent(latest, now);
  const std::vector<std::string> look_alikes = LookAlikesBeside(
      faults, Layer::kObservers, strength, names_.KnownTo(message.model_hash));
  Certainty certainty = WithLookAlikes(
      CertaintyOf(faults, Layer::kObservers, largest), look_alikes);
  if (since && faults.empty() && open->second.unnamed == Certainty::kNotKnown) {
    certainty = Certainty::kNotKnown;
    faults = "unknown";
  }
  return {{"valve_id", message.valve_id},
          {"state",
           silent && !abnormal ? "NOT_JUDGED" : console::ShownState(verdict)},
          {"quality", QualityName(verdict.quality)},
          {"silent", silent},
          {"fault", faults.empty() ? Json() : Json(faults)},
          {"name",
           faults.empty() ? Json() : Json(texts_.Words(faults, strength).name)},
          {"certainty", abnormal ? Json(CertaintyName(certainty)) : Json()},
          {"look_alikes", look_alikes},
          {"factor", largest},
          {"strength", verdict.isolated == 0 ? Json() : Json(strength)},
          {"normal_factor", verdict.normal_factor},
          {"factors", LargestOf(factors)},
          {"residuals", names_.Residuals(message)},
          {"since_utc",
           since ? Json(FormatTime(open->second.detection_stamp_ns, true))
                 : Json()},
          {"abnormal_s",
           since ? Json((verdict.stamp_ns - open->second.detection_stamp_ns) /
                        kNsPerSecond)
                 : Json()},
          {"stamp_utc", FormatTime(verdict.stamp_ns, true)},
          {"model_set", info == nullptr ? Json()
                                        : Json(info->model_set + "@" +
                                               std::to_string(info->version))}};
}

report::Report TopBoard::Valves(TopSort sort, const std::string& filter,
                                Clock::time_point now) const {
  const std::string lower = Lower(filter);
  // Sort keys in order of precedence; those that `sort` ignores are equal.
  using Order = std::tuple<int, std::int64_t, double, std::string>;
  std::vector<std::pair<Order, Json>> rows;
  for (const auto& [valve_id, latest] : decisions_) {
    Json row = RowOf(latest, now);
    if (!lower.empty() && !Contains(row, lower)) {
      continue;
    }
    const bool by_time =
        sort == TopSort::kSince && row["since_utc"].is_string();
    const bool by_factor = sort == TopSort::kWorst || sort == TopSort::kFactor;
    rows.emplace_back(
        Order{sort == TopSort::kWorst ? Rank(row) : 0,
              by_time ? -open_.at(valve_id).detection_stamp_ns : 0,
              by_factor ? -row["factor"].get<double>() : 0.0, valve_id},
        std::move(row));
  }
  std::ranges::sort(rows, {}, [](const auto& row) { return row.first; });
  const std::string health = Health(now);
  report::Report report;
  report.document = {{"monitor", health.empty() ? Json() : Json(health)},
                     {"valves", Json::array()}};
  for (auto& [order, row] : rows) {
    report.document["valves"].push_back(std::move(row));
  }
  using Format = report::Format;
  const auto quality = [](const Json& row) {
    return row["silent"].get<bool>() ? "SILENT"
                                     : row["quality"].get<std::string>();
  };
  report.Table(
      "valves",
      {{.heading = "valve", .key = "valve_id", .tone = ToneOf},
       {.heading = "state", .key = "state", .tone = ToneOf},
       {.heading = "quality", .text = quality, .tone = ToneOf},
       {.heading = "fault", .key = "fault", .spare = 4, .tone = ToneOf},
       {.heading = "how sure", .key = "certainty", .tone = ToneOf},
       {.heading = "meaning", .key = "name", .least_width = 15},
       {"strength", "strength", Format::kPercent, 0, 2},
       {"since", "abnormal_s", Format::kDuration, 0, 3},
       {.heading = "residuals",
        .spare = 6,
        .text = [](const Json& row) { return NumbersText(row["residuals"]); }},
       {.heading = "model set", .key = "model_set", .spare = 7}});
  return report;
}

std::string TopScreen(const TopBoard& board, const TopView& view,
                      const report::TextStyle& style, std::size_t height,
                      std::int64_t now_ns, TopBoard::Clock::time_point now) {
  report::Report report = board.Valves(view.sort, view.filter, now);
  std::ostringstream screen;
  screen << Printable(Title(board, view, report.document, now_ns)) << "\n\n";
  auto& rows = report.document["valves"].get_ref<Json::array_t&>();
  const std::size_t all = rows.size();
  rows.resize(std::min(
      all, std::max<std::size_t>(height, kOtherLines + 1) - kOtherLines));
  report.PrintText(screen, {style, view.utc});
  if (all > rows.size()) {
    screen << all - rows.size() << " more below\n";
  }
  return screen.str();
}

}  // namespace fdi::monitor
