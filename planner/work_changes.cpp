#include "planner/work_changes.h"

#include <map>
#include <set>
#include <vector>

#include "base/error.h"

namespace fdi::planner {
namespace {

using report::Json;

// One valve in one list.
struct Said {
  std::string name;  // Empty: nothing is wrong with it.
  std::string severity;
  double points{0.0};
  bool unjudged{false};

  Json Text() const {
    return name.empty() ? Json() : Json(name + ", " + severity);
  }
};

std::map<std::string, Said> SaidIn(const Json& document) {
  std::map<std::string, Said> said;
  for (const Json& row : document.at("rows")) {
    Said& of = said[row.at("valve_id").get<std::string>()];
    if (of.name.empty() && row.at("open").get<bool>()) {
      of.name = row.at("name");
      of.severity = row.at("severity");
      of.points = row.at("severity_points");
    }
  }
  for (const Json& loop : document.at("unjudged")) {
    said[loop.at("valve_id").get<std::string>()].unjudged = true;
  }
  return said;
}

std::vector<const char*> ChangesOf(const Said& before, const Said& now) {
  std::vector<const char*> changes;
  if (before.name.empty() != now.name.empty()) {
    changes.push_back(before.name.empty() ? "new" : "gone");
  } else if (before.points != now.points) {
    changes.push_back(before.points < now.points ? "worse" : "better");
  } else if (before.name != now.name) {
    changes.push_back("other finding");
  }
  if (before.unjudged != now.unjudged) {
    changes.push_back(now.unjudged ? "no longer judged" : "judged again");
  }
  return changes;
}

}  // namespace

Json ChangesJson(const std::optional<Json>& last, const std::string& file,
                 const Json& now) {
  if (!last) {
    return {};
  }
  try {
    std::map<std::string, Said> before = SaidIn(*last);
    std::map<std::string, Said> after = SaidIn(now);
    std::set<std::string> valves;
    for (const auto* said : {&before, &after}) {
      for (const auto& [valve, of] : *said) {
        valves.insert(valve);
      }
    }
    Json list = Json::array();
    for (const std::string& valve : valves) {
      for (const char* change : ChangesOf(before[valve], after[valve])) {
        list.push_back({{"valve_id", valve},
                        {"change", change},
                        {"before", before[valve].Text()},
                        {"now", after[valve].Text()}});
      }
    }
    Json coverage;
    for (const char* key : {"loops", "named_faults", "audit", "nothing"}) {
      coverage[key] = last->at("coverage").at(key).get<std::size_t>();
    }
    return {{"last_utc", last->at("as_of_utc").get<std::string>()},
            {"file", file},
            {"valves", std::move(list)},
            {"coverage", std::move(coverage)}};
  } catch (const Json::exception& error) {
    throw DataError(file + " is no work list of this program (" + error.what() +
                    "); move it away, or name another file");
  }
}

}  // namespace fdi::planner
