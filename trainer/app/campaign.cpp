#include "trainer/app/campaign.h"

#include <array>
#include <charconv>
#include <cmath>
#include <concepts>

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

void WriteSource(const SimulatedRun& run, std::string& text) {
  text += "[run.simulate]\n" + simulator::ScenarioText(run.scenario);
}

void WriteSource(const ImportedRun& run, std::string& text) {
  text += "import = " + QuoteToml(run.file.string()) +
          "\nvalve = " + QuoteToml(run.valve_id) + '\n';
}

void WriteSource(const RecordedRun& run, std::string& text) {
  text += "run = " + QuoteToml(run.selector) + '\n';
}

void WriteRun(const CampaignRun& run, std::string& text) {
  text += "\n[[run]]\n";
  FieldWriter writer(text);
  if (std::isfinite(run.stretch.from_s)) {
    writer.Line("from_s", Shortest(run.stretch.from_s));
  }
  if (std::isfinite(run.stretch.to_s)) {
    writer.Line("to_s", Shortest(run.stretch.to_s));
  }
  std::visit([&text](const auto& source) { WriteSource(source, text); },
             run.source);
}

}  // namespace

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
    WriteRun(run, text);
  }
  return text;
}

}  // namespace fdi::trainer
