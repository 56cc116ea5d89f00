#include "storage/app/episode_text.h"

#include <charconv>
#include <cmath>

#include "storage/app/common.h"

namespace fdi::storage {
namespace {

cli::Json OptionalJson(const std::optional<std::string>& text) {
  return text ? cli::Json(*text) : cli::Json();
}

cli::Json TextOrNull(const std::string& text) {
  return text.empty() ? cli::Json() : cli::Json(text);
}

}  // namespace

cli::Json EpisodeJson(const Episode& episode) {
  return {{"episode_id", episode.episode_id},
          {"valve_id", episode.valve_id},
          {"detected_utc", episode.detected_utc},
          {"isolated_utc", OptionalJson(episode.isolated_utc)},
          {"cleared_utc", OptionalJson(episode.cleared_utc)},
          {"fault", OptionalJson(episode.fault)},
          {"peak_factor", episode.peak_factor},
          {"model_set", episode.model_set},
          {"end_reason", OptionalJson(episode.end_reason)},
          {"label", OptionalJson(episode.label)},
          {"acked_by", OptionalJson(episode.acked_by)}};
}

cli::Json EpisodesJson(const std::vector<Episode>& episodes) {
  cli::Json list = cli::Json::array();
  for (const Episode& episode : episodes) {
    list.push_back(EpisodeJson(episode));
  }
  return {{"episodes", list}};
}

void WriteEpisodes(const std::vector<Episode>& episodes, std::ostream& out) {
  out << "episode_id,valve_id,detected_utc,isolated_utc,cleared_utc,fault,"
         "peak_factor,model_set,end_reason,label,acked_by\n";
  for (const Episode& e : episodes) {
    out << e.episode_id << ',' << CsvCell(e.valve_id) << ',' << e.detected_utc
        << ',' << e.isolated_utc.value_or("") << ','
        << e.cleared_utc.value_or("") << ',' << e.fault.value_or("") << ','
        << CsvCell(e.peak_factor) << ',' << CsvCell(e.model_set) << ','
        << e.end_reason.value_or("") << ',' << e.label.value_or("") << ','
        << CsvCell(e.acked_by.value_or("")) << '\n';
  }
}

cli::Json ShelfJson(const Shelf& shelf) {
  return {{"shelf_id", shelf.shelf_id},
          {"valve_id", shelf.valve_id},
          {"fault", OptionalJson(shelf.fault)},
          {"from_utc", TimeJson(shelf.from_ns)},
          {"until_utc", TimeJson(shelf.until_ns)},
          {"who", shelf.who},
          {"comment", TextOrNull(shelf.comment)},
          {"origin", shelf.origin},
          {"ended_utc", TimeJson(shelf.ended_ns)},
          {"ended_by", TextOrNull(shelf.ended_by)},
          {"ended_origin", TextOrNull(shelf.ended_origin)}};
}

AlarmState ShownState(const Alarm& alarm) {
  return alarm.shelf ? AlarmState::kShelved : alarm.state;
}

cli::Tone ToneOf(AlarmState state) {
  switch (state) {
    case AlarmState::kUnacked:
    case AlarmState::kAcked:
      return cli::Tone::kAlarm;
    case AlarmState::kReturnedUnacked:
      return cli::Tone::kWarning;
    case AlarmState::kNormal:
      return cli::Tone::kPlain;
    case AlarmState::kShelved:
      return cli::Tone::kQuiet;
  }
  return cli::Tone::kPlain;
}

std::string CsvCell(const std::string& text) {
  if (text.find_first_of(",\"\n") == std::string::npos) {
    return text;
  }
  std::string cell = "\"";
  for (const char c : text) {
    cell += c == '"' ? "\"\"" : std::string(1, c);
  }
  return cell + '"';
}

std::string CsvCell(double value) {
  if (std::isnan(value)) {
    return "nan";
  }
  char text[64];
  const auto end = std::to_chars(text, text + sizeof text, value);
  return {text, end.ptr};
}

}  // namespace fdi::storage
