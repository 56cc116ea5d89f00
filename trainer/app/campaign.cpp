#include "trainer/app/campaign.h"

#include <array>
#include <charconv>
#include <cmath>
#include <concepts>

#include "diagnosis/error.h"
#include "simulator/app/scenario_fields.h"
#include "trainer/app/campaign_fields.h"

namespace fdi::trainer {
namespace {

using simulator::QuoteToml;

template <typename Number>
std::string Shortest(Number value) {
  std::array<char, 32> text{};
  const auto end = std::to_chars(text.data(), text.data() + text.size(), value);
  return {text.data(), end.ptr};
}

class FieldWriter {
 public:
  explicit FieldWriter(std::string& text) : text_(text) {}

  void operator()(const char* key, const auto& field, auto, auto) {
    Line(key, Shortest(field));
  }
  void operator()(const char* key, bool field) {
    Line(key, field ? "true" : "false");
  }
  void Line(const char* key, const std::string& value) {
    text_ += key;
    text_ += " = " + value + '\n';
  }

 private:
  std::string& text_;
};

void WriteSource(const char* table, const SimulatedRun& run,
                 std::string& text) {
  text += std::string("[") + table + ".simulate]\n" +
          simulator::ScenarioText(run.scenario);
}

void WriteSource(const char*, const ImportedRun& run, std::string& text) {
  text += "import = " + QuoteToml(run.file.string()) +
          "\nvalve = " + QuoteToml(run.valve_id) + '\n';
}

void WriteSource(const char*, const RecordedRun& run, std::string& text) {
  text += "run = " + QuoteToml(run.selector) + '\n';
}

void WriteRun(const char* table, const CampaignRun& run, std::string& text) {
  text += std::string("\n[[") + table + "]]\n";
  FieldWriter writer(text);
  if (run.horizon_s > 0.0) {
    writer.Line("horizon_s", Shortest(run.horizon_s));
  }
  if (std::isfinite(run.stretch.from_s)) {
    writer.Line("from_s", Shortest(run.stretch.from_s));
  }
  if (std::isfinite(run.stretch.to_s)) {
    writer.Line("to_s", Shortest(run.stretch.to_s));
  }
  std::visit([&](const auto& source) { WriteSource(table, source, text); },
             run.source);
}

}  // namespace

std::vector<CampaignRun> ValidationRuns(const std::filesystem::path& path,
                                        std::uint64_t seed_offset) {
  std::vector<CampaignRun> validation = LoadCampaign(path).validation;
  if (validation.empty()) {
    throw ConfigError(path.string() + ": there is no [[validation]]");
  }
  for (CampaignRun& run : validation) {
    if (auto* simulated = std::get_if<SimulatedRun>(&run.source)) {
      simulated->scenario.config.seed += seed_offset;
    }
  }
  return validation;
}

std::string CampaignText(const Campaign& campaign) {
  TrainingOptions training = campaign.training;
  std::string text;
  FieldWriter writer(text);
  writer.Line("name", QuoteToml(training.name));
  writer.Line("preset", QuoteToml(training.preset));
  text += "\n[decision]\n";
  VisitDecision(training.decision, writer);
  text += "\n[training]\n";
  VisitTraining(training, writer);
  for (const CampaignRun& run : campaign.runs) {
    WriteRun("run", run, text);
  }
  for (const CampaignRun& run : campaign.validation) {
    WriteRun("validation", run, text);
  }
  return text;
}

std::string RunLabel(const CampaignRun& run) {
  if (const auto* simulated = std::get_if<SimulatedRun>(&run.source)) {
    const auto& faults = simulated->scenario.config.faults;
    return faults.empty() ? "normal" : simulator::ToText(faults.front());
  }
  if (const auto* imported = std::get_if<ImportedRun>(&run.source)) {
    return imported->file.stem().string();
  }
  return std::get<RecordedRun>(run.source).selector;
}

}  // namespace fdi::trainer
