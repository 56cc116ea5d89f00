// Writes a few inputs for each fuzz target, made by our own writers.
//     fdi_fuzz_seeds DIR
#include <filesystem>
#include <fstream>
#include <iostream>
#include <span>
#include <sstream>
#include <string>
#include <vector>

#include "import/csv.h"
#include "simulator/scenario/scenario_toml.h"
#include "storage/models/model_codec.h"
#include "storage/runs/sample_codec.h"
#include "tests/idl/payload.h"
#include "tests/idl/rtps_messages.h"
#include "tests/monitor/linear_models.h"
#include "tests/storage/model_set_fixture.h"

namespace {

using fdi::monitor::PlantSample;

std::filesystem::path folder;

void Write(const std::string& target, const std::string& name,
           const std::string& bytes) {
  std::filesystem::create_directories(folder / target);
  std::ofstream(folder / target / name, std::ios::binary) << bytes;
}

std::string Text(std::span<const std::byte> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

void WriteTables() {
  std::vector<fdi::LabelledSample> samples(20);
  for (std::uint64_t k = 0; k < samples.size(); ++k) {
    samples[k].sample = PlantSample(k);
    for (std::size_t i = 0; i < fdi::kSignalCount; ++i) {
      samples[k].sample.Set(static_cast<fdi::Signal>(i),
                            10.0 + 0.37 * static_cast<double>(i + k));
    }
  }
  const std::int64_t start = samples[0].sample.stamp_ns;
  for (const bool truth : {false, true}) {
    std::ostringstream text;
    for (std::size_t k = 0; truth && k < samples.size(); ++k) {
      samples[k].truth = fdi::FaultTruth{k > 9 ? 19 : 0, k > 9 ? 0.5 : 0.0};
    }
    fdi::importer::WriteCsv(text, samples, fdi::FlowUnit::kM3PerHour, start);
    Write("csv", truth ? "truth" : "plain", std::string(1, '\1') + text.str());
  }
}

void WriteConfigurations() {
  fdi::simulator::Scenario scenario;
  scenario.config.faults = {
      fdi::simulator::ParseFaultSchedule("f19:abrupt@50:strength=0.75")};
  for (const std::string name :
       {"operating-point", "sine", "level-loop", "inventory-loop"}) {
    fdi::simulator::ChooseExcitation(name, {}, scenario);
    Write("toml", name, '\0' + fdi::simulator::ScenarioText(scenario));
  }
  Write("toml", "tables",
        std::string(1, '\0') +
            "parameters = {base = \"lublin-actuator-3\", trim.kv_m3_h = 70}\n"
            "[excitation]\nname = \"operating-point\"\namplitude_pct = 5\n"
            "[[input]]\nt_s = [0, 600]\ncv_pct = [100, 60]\n"
            "p1_noise_kpa = {sd = 22, correlation = 0.85}\n"
            "[[mode]]\nfrom_s = 0\nuntil_s = 600\nmode = \"MANUAL\"\n");
  Write("toml", "tags",
        "\1[time]\ncolumn = \"Time\"\nunit = \"ms\"\n[signal.CV]\n"
        "column = \"A\"\nunit = \"%\"\nscale = 1.0\nsense = \"opening\"\n"
        "[signal.F]\ncolumn = \"B\"\nunit = \"t/h\"\n");
}

void WriteModels() {
  constexpr std::size_t kBefore = 16;  // Magic, format, length.
  constexpr std::size_t kBehind = 4;   // CRC.
  for (const fdi::ModelSet& models :
       {fdi::monitor::LinearModels(), fdi::storage::RandomModelSet("r")}) {
    const std::string bytes = Text(fdi::storage::EncodeModelSet(models));
    Write("model", models.name,
          bytes.substr(kBefore, bytes.size() - kBefore - kBehind));
  }
}

void WriteChunks() {
  std::vector<fdi::storage::StoredSample> samples(30);
  for (std::uint64_t k = 0; k < samples.size(); ++k) {
    samples[k].sample = PlantSample(k, 0.1 * static_cast<double>(k % 7));
  }
  samples[7].sample.Set(fdi::Signal::kPv, 3.2);
  for (const auto codec :
       {fdi::storage::ChunkCodec::kPlain, fdi::storage::ChunkCodec::kColumns}) {
    const auto chunk = fdi::storage::EncodeChunk(samples, codec);
    const char kind = static_cast<char>(codec);
    Write("chunk", "codec" + std::to_string(kind),
          std::string{kind, static_cast<char>(samples.size()), '\0'} +
              Text(chunk.bytes));
  }
}

template <int kVersion = 1, typename Message>
std::string MessageBytes(const Message& message) {
  using Codec = fdi::idl::Codec<Message, kVersion>;
  typename Codec::Type type;
  typename Codec::Wire wire;
  Codec::Encode(message, wire);
  return fdi::idl::Serialized(type, &wire);
}

template <int kVersion = 1, typename Message>
void WriteMessage(char kind, const Message& message) {
  Write("wire", std::string("kind") + std::to_string(kind),
        kind + MessageBytes<kVersion>(message));
}

void WriteMessages() {
  const fdi::ModelSet models = fdi::monitor::LinearModels();
  WriteMessage(0, fdi::idl::ValveSampleMessage{"V1", PlantSample(7)});
  fdi::Sample with_pv = PlantSample(7);
  with_pv.Set(fdi::Signal::kPv, 3.2);
  WriteMessage<2>(8, fdi::idl::ValveSampleMessage{"V1", with_pv});
  fdi::idl::DecisionMessage decision;
  decision.valve_id = "V1";
  decision.channel_count = static_cast<int>(models.channels.size());
  decision.fault_count = static_cast<int>(models.faults.size());
  decision.observer_count = static_cast<int>(models.observers.size());
  WriteMessage(1, decision);
  fdi::FaultEvent event;
  event.valve_id = "V1";
  event.model_set = "linear";
  event.candidates = {{7, 0.9, 0.5, true}};
  WriteMessage(2, event);
  WriteMessage(3, fdi::idl::Describe(models));
  fdi::idl::MonitorStatusMessage status;
  status.monitor = "host:1";
  status.counters = {{"received", 12}};
  WriteMessage(4, status);
  WriteMessage(5,
               fdi::idl::DecisionBatchMessage{"host:1", {decision, decision}});
  WriteMessage(6, fdi::MonitorShare{"host:1", "FV-*", "hall-1"});
  fdi::idl::ValveStateMessage state;
  state.valve_id = "V1";
  state.fault = "f3|f6";
  state.certainty = "one of";
  WriteMessage(7, state);
}

void WriteDatagrams() {
  for (const auto& [name, message] : fdi::idl::RtpsMessages(
           MessageBytes(fdi::idl::ValveSampleMessage{"V1", PlantSample(7)}))) {
    Write("rtps", name, message);
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::cerr << "usage: fdi_fuzz_seeds DIR\n";
    return 2;
  }
  folder = argv[1];
  WriteTables();
  WriteConfigurations();
  WriteModels();
  WriteChunks();
  WriteMessages();
  WriteDatagrams();
}
