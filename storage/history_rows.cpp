#include "storage/history_rows.h"

#include <algorithm>
#include <charconv>

#include "diagnosis/error.h"

namespace fdi::storage {

const char* const kEpisodeColumns =
    "v.episode_id, v.valve_id, v.detected_utc, v.isolated_utc, v.cleared_utc, "
    "v.fault, v.peak_factor, v.model_set, v.end_reason, v.label, v.acked_by, "
    "e.source_id, e.model_hash, e.detected_ns, e.isolated_ns, e.cleared_ns, "
    "e.ended_ns, e.acked_ns, (SELECT max(last_ns) FROM episode_trace t WHERE "
    "t.episode_id "
    "= e.episode_id), e.session_id, e.fault_bits, e.strength, "
    "e.unknown_kind, e.flow_unit, "
    "e.channels, e.faults";

Episode ReadEpisode(const Statement& row) {
  int c = 0;
  Episode episode;
  episode.episode_id = row.Text(c++);
  episode.valve_id = row.Text(c++);
  episode.detected_utc = row.Text(c++);
  episode.isolated_utc = row.OptionalText(c++);
  episode.cleared_utc = row.OptionalText(c++);
  episode.fault = row.OptionalText(c++);
  episode.peak_factor = row.Double(c++);
  episode.model_set = row.Text(c++);
  episode.end_reason = row.OptionalText(c++);
  episode.label = row.OptionalText(c++);
  episode.acked_by = row.OptionalText(c++);
  episode.source_id = row.Uint64(c++);
  episode.model_hash = row.Uint64(c++);
  episode.detected_ns = row.Int64(c++);
  episode.isolated_ns = row.OptionalInt64(c++);
  episode.cleared_ns = row.OptionalInt64(c++);
  episode.ended_ns = row.OptionalInt64(c++);
  episode.acked_ns = row.OptionalInt64(c++);
  episode.trace_end_ns = row.OptionalInt64(c++);
  episode.session_id = row.OptionalInt64(c++);
  episode.fault_bits = row.Uint64(c++);
  episode.strength = row.Double(c++);
  episode.unknown_kind = row.OptionalText(c++);
  episode.flow_unit =
      ParseFlowUnit(row.Text(c++)).value_or(FlowUnit::kM3PerHour);
  episode.channels = SplitNames(row.Text(c++));
  episode.faults = SplitNames(row.Text(c++));
  const std::string& id = episode.episode_id;
  std::from_chars(id.data(), id.data() + id.size(), episode.id, 16);
  return episode;
}

std::vector<std::string> SplitNames(std::string_view joined) {
  std::vector<std::string> names;
  while (!joined.empty()) {
    const std::size_t bar = std::min(joined.find('|'), joined.size());
    names.emplace_back(joined.substr(0, bar));
    joined.remove_prefix(std::min(bar + 1, joined.size()));
  }
  return names;
}

std::string JoinNames(const std::vector<std::string>& names) {
  std::string joined;
  for (const std::string& name : names) {
    joined += (joined.empty() ? "" : "|") + name;
  }
  return joined;
}

std::string NamesOf(FaultSet faults, const std::vector<std::string>& names) {
  std::vector<std::string> members;
  for (std::size_t bit = 0; bit < names.size(); ++bit) {
    if ((faults >> bit & 1U) != 0) {
      members.push_back(names[bit]);
    }
  }
  return JoinNames(members);
}

std::uint64_t ResolveEpisode(Database& database, std::string_view id) {
  std::vector<std::string> found;
  if (id == "last") {
    Statement newest = database.Prepare(
        "SELECT episode_id FROM episode ORDER BY detected_ns DESC, rowid DESC "
        "LIMIT 1");
    while (newest.Step()) {
      found.push_back(newest.Text(0));
    }
    if (found.empty()) {
      throw NotFoundError("no episode is recorded");
    }
  } else {
    std::string prefix(id);
    std::transform(prefix.begin(), prefix.end(), prefix.begin(), [](char c) {
      return static_cast<char>(c >= 'A' && c <= 'F' ? c + ('a' - 'A') : c);
    });
    const bool is_hex =
        !prefix.empty() &&
        prefix.find_first_not_of("0123456789abcdef") == std::string::npos;
    Statement matching = database.Prepare(
        "SELECT episode_id FROM episode WHERE episode_id GLOB ? LIMIT 2");
    matching.Bind(prefix + "*");
    while (is_hex && matching.Step()) {
      found.push_back(matching.Text(0));
    }
  }
  if (found.size() != 1) {
    throw NotFoundError(found.empty()
                            ? "no episode '" + std::string(id) + "'"
                            : "episode '" + std::string(id) +
                                  "' is not unique: more than one begins so");
  }
  std::uint64_t value = 0;
  std::from_chars(found[0].data(), found[0].data() + found[0].size(), value,
                  16);
  return value;
}

}  // namespace fdi::storage
