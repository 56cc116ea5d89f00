#include "monitor/app/top_screen.h"

#include <algorithm>
#include <sstream>

#include "storage/cli/text_table.h"
#include "storage/cli/time_text.h"

namespace fdi::monitor {
namespace {

using cli::Align;
using cli::FormatNumber;
using cli::Tone;

// Lines that are no rows: title, blank, heading, "too narrow", blank, keys.
constexpr std::size_t kOtherLines = 6;

Tone ToneOf(const TopRow& row) {
  return row.state != State::kNormal                   ? Tone::kAlarm
         : row.silent || row.quality != Quality::kLive ? Tone::kQuiet
                                                       : Tone::kPlain;
}

std::string QualityText(const TopRow& row) {
  return row.silent ? "SILENT" : std::string(QualityName(row.quality));
}

std::string FactorsText(const TopRow& row) {
  std::string text;
  for (const auto& [name, factor] : row.factors) {
    text += (text.empty() ? "" : "  ") + name + " " + FormatNumber(factor, 2);
  }
  return text.empty() ? "-" : text;
}

std::string ResidualsText(const TopRow& row) {
  std::string text;
  for (const auto& [name, residual] : row.residuals) {
    text += (text.empty() ? "" : "  ") + name + " " + FormatNumber(residual, 2);
  }
  return text.empty() ? "-" : text;
}

// How long the valve has been abnormal, by the stamps of its samples.
std::string SinceText(const TopRow& row) {
  constexpr std::int64_t kSecondNs = 1'000'000'000;
  return cli::FormatDuration((row.stamp_ns - *row.since_ns) / kSecondNs *
                             kSecondNs);
}

std::string WordsOf(const TopRow& row, const cli::FaultTexts& texts) {
  return row.faults.empty() ? "" : texts.Words(row.faults, row.strength).name;
}

std::size_t CountAlarms(const std::vector<TopRow>& rows) {
  return static_cast<std::size_t>(std::count_if(
      rows.begin(), rows.end(),
      [](const TopRow& row) { return row.state != State::kNormal; }));
}

std::string Title(const TopView& view) {
  std::string title =
      "fdi-monitor top  " +
      cli::FormatTime(view.now_ns / 1'000'000'000 * 1'000'000'000, view.utc) +
      "  " + std::to_string(view.valves) + " valves, " +
      std::to_string(CountAlarms(view.rows)) + " abnormal, " +
      std::string(TopSortName(view.sort));
  if (!view.filter.empty()) {
    title +=
        ", " + std::to_string(view.rows.size()) + " with '" + view.filter + "'";
  }
  return title + (view.health.empty() ? "  NO MONITOR IS HEARD"
                                      : "  monitor " + view.health);
}

std::string Keys(const TopView& view) {
  return view.typing
             ? "filter: " + view.filter + "_   (Enter: keep, Esc: all valves)"
             : "q quit  s sort  / filter  up, down, PgUp, PgDn, Home "
               "scroll";
}

}  // namespace

std::string TopTable(const TopView& view, const cli::FaultTexts& texts,
                     const cli::TextStyle& style) {
  cli::TextTable table({{"valve"},
                        {"state"},
                        {"quality"},
                        {"fault"},
                        {"which is", Align::kLeft, 2},
                        {"strength [-]", Align::kRight, 5},
                        {"since", Align::kRight, 3},
                        {"d_0 [-]", Align::kRight, 4},
                        {"factors d [-]", Align::kLeft, 1},
                        {"residuals", Align::kLeft, 6},
                        {"model set", Align::kLeft, 7}});
  for (const TopRow& row : view.rows) {
    const bool isolated = row.state == State::kIsolated;
    table.AddRow(
        {row.valve_id, std::string(StateName(row.state)), QualityText(row),
         row.faults.empty() ? "-" : row.faults, WordsOf(row, texts),
         isolated ? FormatNumber(row.strength, 2) : "-",
         row.since_ns ? SinceText(row) : "-",
         FormatNumber(row.normal_factor, 2), FactorsText(row),
         ResidualsText(row), row.model_set.empty() ? "-" : row.model_set});
    for (const std::size_t column : {0U, 1U, 2U, 3U}) {
      table.SetTone(column, ToneOf(row));
    }
  }
  std::ostringstream out;
  table.Print(out, style);
  return out.str();
}

std::string TopScreen(const TopView& view, const cli::FaultTexts& texts,
                      const cli::TextStyle& style, std::size_t height) {
  TopView shown = view;
  const std::size_t room =
      std::max<std::size_t>(1, height - std::min(height, kOtherLines));
  const std::size_t first =
      std::min(view.first, view.rows.size() - std::min(view.rows.size(), room));
  const auto begin = view.rows.begin() + static_cast<std::ptrdiff_t>(first);
  shown.rows.assign(begin, begin + static_cast<std::ptrdiff_t>(std::min(
                                       room, view.rows.size() - first)));
  std::istringstream lines(Title(view) + "\n\n" +
                           TopTable(shown, texts, style));
  std::vector<std::string> screen;
  for (std::string line; std::getline(lines, line);) {
    screen.push_back(Clipped(line, style.width));
  }
  screen.resize(std::max<std::size_t>(2, height) - 2);
  const std::size_t below = view.rows.size() - first - shown.rows.size();
  screen.push_back(
      below > 0 ? Clipped(std::to_string(below) + " more below", style.width)
                : "");
  screen.push_back(Clipped(Keys(view), style.width));
  std::string text = screen.front();
  for (std::size_t i = 1; i < screen.size(); ++i) {
    text += "\n" + screen[i];
  }
  return text;
}

cli::Json TopJson(const TopView& view, const cli::FaultTexts& texts) {
  cli::Json valves = cli::Json::array();
  for (const TopRow& row : view.rows) {
    cli::Json factors = cli::Json::object();
    for (const auto& [name, factor] : row.factors) {
      factors[name] = factor;
    }
    cli::Json residuals = cli::Json::object();
    for (const auto& [name, residual] : row.residuals) {
      residuals[name] = residual;
    }
    valves.push_back(
        {{"valve_id", row.valve_id},
         {"state", StateName(row.state)},
         {"quality", QualityName(row.quality)},
         {"silent", row.silent},
         {"fault", row.faults.empty() ? cli::Json() : cli::Json(row.faults)},
         {"name",
          row.faults.empty() ? cli::Json() : cli::Json(WordsOf(row, texts))},
         {"factor", row.factor},
         {"strength", row.strength},
         {"normal_factor", row.normal_factor},
         {"factors", factors},
         {"residuals", residuals},
         {"since_utc", row.since_ns
                           ? cli::Json(cli::FormatTime(*row.since_ns, true))
                           : cli::Json()},
         {"stamp_utc", cli::FormatTime(row.stamp_ns, true)},
         {"model_set", row.model_set}});
  }
  return {
      {"monitor", view.health.empty() ? cli::Json() : cli::Json(view.health)},
      {"valves", valves}};
}

std::string Clipped(const std::string& line, std::size_t width) {
  if (width == 0) {
    return line;
  }
  std::string clipped;
  std::size_t cells = 0;
  bool escape = false;
  bool fits = true;
  for (const char c : line) {
    if (escape || c == '\x1b') {
      clipped += c;
      escape = c != 'm';
      continue;
    }
    if ((c & '\xC0') != '\x80') {  // Not the rest of a letter.
      fits = cells < width;
      cells += fits ? 1 : 0;
    }
    if (fits) {
      clipped += c;
    }
  }
  return clipped;
}

}  // namespace fdi::monitor
