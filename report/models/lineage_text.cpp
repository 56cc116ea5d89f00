#include "report/models/lineage_text.h"

#include "base/text.h"
#include "base/time_text.h"
#include "diagnosis/model/fault_catalogue.h"
#include "report/text_table.h"
#include "storage/models/model_codec.h"

namespace fdi::report {

Json LineageJson(const storage::Lineage& lineage) {
  Json json;
  json["parent"] = Json();
  if (lineage.parent) {
    json["parent"] = {{"model_set", lineage.parent->name},
                      {"version", lineage.parent->version},
                      {"content_hash", Hex16(lineage.parent->content_hash)}};
  }
  const Json settings = Json::parse(lineage.settings, nullptr, false);
  json["settings"] = settings.is_discarded() ? Json() : settings;
  json["episodes"] = Json::array();
  for (const storage::TrainingEpisode& e : lineage.episodes) {
    json["episodes"].push_back(
        {{"episode_id", e.episode_id},
         {"valve_id", e.valve_id},
         {"label", e.label},
         {"labelled_by", e.labelled_by},
         {"labelled_utc", FormatTime(e.labelled_ns, true)},
         {"fault", FaultName(e.fault)},
         {"strength", e.strength},
         {"run", e.run},
         {"samples", e.samples}});
  }
  return json;
}

std::string ParentText(const storage::Lineage& lineage) {
  if (!lineage.parent) {
    return "none";
  }
  std::string text = lineage.parent->name + "@" +
                     std::to_string(lineage.parent->version) + ", hash " +
                     Hex16(lineage.parent->content_hash);
  const Json settings = Json::parse(lineage.settings, nullptr, false);
  if (settings.contains("limits")) {
    text += ", with limits from " +
            FormatNumber(settings["limits"].value("hours", 0.0), 2) + " h";
  }
  return text;
}

}  // namespace fdi::report
