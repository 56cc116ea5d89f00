#include "planner/live/cause_groups.h"

#include <set>

#include "base/error.h"
#include "base/time_text.h"
#include "base/toml_reader.h"
#include "diagnosis/model/fault_catalogue.h"

// groups.toml, and a common cause as `--on-event` delivers it (docs/planner.md,
// "One cause for many"). An unknown key is an error, because a mistyped
// `within_s` would leave the default in force without anybody noticing.
namespace fdi::planner {
namespace {

constexpr double kMaxWindowS = 86'400.0;

storage::CauseGroup ReadGroup(TomlReader& table) {
  storage::CauseGroup group;
  group.name = table.Text("name").value_or("");
  if (group.name.empty()) {
    table.Refuse("name", "is missing");
  }
  group.valve_globs = table.Texts("valves");
  if (group.valve_globs.empty()) {
    table.Refuse("valves", "is missing: ids or globs of two valves or more");
  }
  if (const auto faults = table.Texts("faults"); !faults.empty()) {
    group.faults.clear();
    for (const std::string& name : faults) {
      const auto fault = ParseFinding(name);
      if (!fault) {
        table.Refuse("faults", "unknown fault '" + name + "'; there are " +
                                   std::string(kFaultNames));
      }
      group.faults.push_back(FaultName(*fault));
    }
  }
  const auto valves = table.Integer("min_valves").value_or(group.min_valves);
  if (valves < 2 || valves > 100'000) {
    table.Refuse("min_valves", "is not in 2..100000");
  }
  group.min_valves = static_cast<int>(valves);
  if (const auto seconds = table.Number("within_s", 1.0, kMaxWindowS)) {
    group.within_ns = static_cast<std::int64_t>(*seconds * 1e9);
  }
  return group;
}

}  // namespace

std::vector<storage::CauseGroup> ReadCauseGroups(
    const std::filesystem::path& path) {
  TomlReader file(path);
  std::vector<storage::CauseGroup> groups;
  std::set<std::string> names;
  for (TomlReader& table : file.Tables("group")) {
    groups.push_back(ReadGroup(table));
    if (!names.insert(groups.back().name).second) {
      table.Refuse("name",
                   "two groups are called '" + groups.back().name + "'");
    }
  }
  file.Finish();
  return groups;
}

// The stamp is that of the end, and while the cause is open that of its
// opening, also when a further valve joins it.
report::Json CauseJson(const storage::CauseChange& change) {
  const storage::CommonCause& cause = change.cause;
  report::Json members = report::Json::array();
  std::set<std::string> valves;
  for (const storage::CauseMember& member : cause.members) {
    valves.insert(member.valve_id);
    members.push_back({{"valve_id", member.valve_id},
                       {"episode_id", member.episode_id},
                       {"fault", member.fault}});
  }
  return {
      {"kind", "COMMON_CAUSE_" + std::string(CauseChangeName(change.kind))},
      {"cause_id", cause.cause_id},
      {"group", cause.group},
      {"stamp_utc", FormatTime(cause.ended_ns.value_or(cause.opened_ns), true)},
      {"valves", valves.size()},
      {"members", members}};
}

}  // namespace fdi::planner
