#include "trainer/app/training_settings.h"

#include <nlohmann/json.hpp>

#include "diagnosis/error.h"
#include "trainer/app/campaign_fields.h"

namespace fdi::trainer {
namespace {

using Json = nlohmann::ordered_json;

struct FieldWriter {
  Json& json;

  void operator()(const char* key, const auto& field, auto, auto) const {
    json[key] = field;
  }
  void operator()(const char* key, bool field) const { json[key] = field; }
};

// Sets each field that is there.
struct FieldReader {
  const Json& json;

  void operator()(const char* key, auto& field, auto, auto) const {
    field = json.value(key, field);
  }
  void operator()(const char* key, bool& field) const {
    field = json.value(key, field);
  }
};

}  // namespace

std::string SettingsText(const TrainingOptions& options) {
  TrainingOptions copy = options;
  Json json = Json::object();
  VisitTraining(copy, FieldWriter{json});
  return json.dump();
}

TrainingOptions OptionsOf(const ModelSet& models,
                          const storage::Lineage& lineage) {
  const std::string set = models.name + "@" + std::to_string(models.version);
  TrainingOptions options;
  try {
    options = PresetOptions(models.preset);
  } catch (const ConfigError&) {
    throw DataError("model set " + set + " is of preset '" + models.preset +
                    "': only sets of fdi-trainer train (paper, extended) can "
                    "be trained on; onboard the valve anew instead");
  }
  options.decision = models.decision;
  options.false_alarms_per_hour = models.false_alarms_per_hour;
  if (!lineage.settings.empty()) {
    try {
      VisitTraining(options, FieldReader{Json::parse(lineage.settings)});
    } catch (const Json::exception& error) {
      throw DataError("model set " + set +
                      ": its settings are damaged: " + error.what());
    }
  }
  return options;
}

}  // namespace fdi::trainer
