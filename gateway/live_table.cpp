#include "gateway/live_table.h"

#include <cmath>
#include <map>
#include <set>
#include <utility>

#include "base/csv_cells.h"
#include "base/error.h"
#include "import/plant_table.h"
#include "import/tag_map.h"

namespace fdi::gateway {
namespace {

using importer::LoopTag;
using importer::PlantRow;
using importer::TagMatch;

// A reading that is three periods late is one that a device did not send.
constexpr int kMaxAgePeriods = 3;

// A file has its columns, and a pattern finds one of them. The tags of a plant
// are not known before it sends them, so here a tag is its own pattern.
TagMatch Match(const PlantRow& row) {
  std::set<std::string> tags;
  for (const importer::TagCell& tag : row.tags) {
    if (tag.pattern.find('*') != std::string::npos) {
      throw ConfigError("the tag " + Quoted(tag.pattern) +
                        " has a *; state the tag itself");
    }
    if (!tag.pattern.empty()) {
      tags.insert(tag.pattern);
    }
  }
  TagMatch match = MatchTags(
      row, importer::TagNames({tags.begin(), tags.end()}), "the table");
  if (!match.error.empty()) {
    throw ConfigError(match.error);
  }
  return match;
}

importer::ColumnMap ColumnsOf(const PlantRow& given, const TagMatch& match) {
  PlantRow row = given;
  const auto flow = row.FlowTag();
  if (flow && row[*flow].unit.empty() && row.type.empty()) {
    row.service.clear();  // Without a model the audit reads the PV.
    row.tags[static_cast<std::size_t>(LoopTag::kF)].pattern.clear();
  }
  importer::ColumnMap map = ValveColumns(row, match, {});
  const bool pv_is_flow = row.FlowTag() == LoopTag::kPv;
  const bool has_sp = !match[LoopTag::kSp].empty();
  if (!match[LoopTag::kPv].empty() && (!pv_is_flow || has_sp)) {
    map.columns.push_back(OwnUnitColumn(row, match, LoopTag::kPv, Signal::kPv));
    if (has_sp) {
      map.columns.push_back(
          OwnUnitColumn(row, match, LoopTag::kSp, Signal::kSp));
    }
  }
  return map;
}

// {signal} and {tag} of a topic or a key.
std::string Filled(std::string text, std::string_view signal,
                   const std::string& tag) {
  for (const auto& [name, value] :
       {std::pair<std::string_view, std::string_view>("{signal}", signal),
        std::pair<std::string_view, std::string_view>("{tag}", tag)}) {
    for (std::size_t at = text.find(name); at != std::string::npos;
         at = text.find(name, at + value.size())) {
      text.replace(at, name.size(), value);
    }
  }
  return text;
}

std::vector<LiveTopic> TopicsOf(const PlantRow& row, const TagMatch& match) {
  std::vector<LiveTopic> topics;
  std::map<std::pair<std::string, std::string>, std::string> taken;
  for (std::size_t i = 0; i < importer::kLoopTagCount; ++i) {
    const std::string& tag = match.columns[i];
    if (tag.empty()) {
      continue;
    }
    const std::string_view signal = LoopTagName(static_cast<LoopTag>(i));
    LiveTopic topic{Filled(row.topic, signal, tag), tag,
                    Filled(row.value_key, signal, tag),
                    Filled(row.time_key, signal, tag)};
    if (topic.topic.find_first_of("+#") != std::string::npos) {
      throw ConfigError("the topic " + Quoted(topic.topic) +
                        " has + or #; state one topic for each signal");
    }
    const auto [first, added] =
        taken.try_emplace({topic.topic, topic.value_key}, tag);
    if (!added && first->second != tag) {
      throw ConfigError("the topic " + Quoted(topic.topic) + " is that of " +
                        first->second + " and " + tag +
                        "; add {signal} or {tag} to topic or to value");
    }
    if (added) {
      topics.push_back(std::move(topic));
    }
  }
  return topics;
}

}  // namespace

LiveTable ReadLiveTable(const std::filesystem::path& path, bool by_topics) {
  const importer::PlantTable plant = importer::ReadPlantTable(path);
  LiveTable table;
  if (!plant.resample.empty()) {
    const double period_s = importer::ParseResampling(plant.resample).period_s;
    table.period_ns = std::llround(period_s * 1e9);
  }
  std::map<std::string, std::string> positions;  // Row by its tag.
  for (const PlantRow& row : plant.rows) {
    try {
      if (!row.error.empty()) {
        throw ConfigError(row.error);
      }
      const TagMatch match = Match(row);
      importer::LiveValve valve;
      valve.id = row.name;
      valve.group = row.group;
      valve.map = ColumnsOf(row, match);
      const bool periodic =
          row.report == "periodic" || (by_topics && row.report.empty());
      valve.report = periodic ? importer::Reporting::kPeriodic
                              : importer::Reporting::kException;
      valve.max_age_ns = row.max_age_s > 0.0 ? std::llround(row.max_age_s * 1e9)
                                             : kMaxAgePeriods * table.period_ns;
      std::vector<LiveTopic> topics;
      if (by_topics) {
        if (row.topic.empty()) {
          throw ConfigError(
              "topic is missing; type topic = \"plant/{loop}/{signal}\"");
        }
        topics = TopicsOf(row, match);
      }
      // A command may drive two valves and a header feed them; a rod is that
      // of one.
      if (const std::string& x = match[LoopTag::kX]; !x.empty()) {
        const auto [first, added] = positions.try_emplace(x, row.name);
        if (!added) {
          throw ConfigError("x = " + x + " is that of " + first->second +
                            ", too; correct one of the two");
        }
      }
      table.valves.push_back(std::move(valve));
      table.topics.insert(table.topics.end(), topics.begin(), topics.end());
    } catch (const ConfigError& error) {
      table.refused.push_back({row.name, row.place, error.what()});
    }
  }
  return table;
}

std::set<std::string, std::less<>> TagsOf(const LiveTable& table) {
  std::set<std::string, std::less<>> tags;
  for (const importer::LiveValve& valve : table.valves) {
    for (const importer::ColumnMapping& column : valve.map.columns) {
      tags.insert(column.column);
    }
    if (!valve.map.mode_column.empty()) {
      tags.insert(valve.map.mode_column);
    }
  }
  return tags;
}

}  // namespace fdi::gateway
