// Configuration: a scenario (with parameters, excitation, inputs, faults) and
// a tag map, refused with a reason or taken.
#include <filesystem>
#include <fstream>
#include <string>

#include <unistd.h>

#include "base/error.h"
#include "base/toml_reader.h"
#include "import/tag_map.h"
#include "simulator/scenario/scenario_toml.h"

namespace {

// A text that was taken is taken again after it was written as text.
void ReadScenario(const std::string& text) {
  fdi::simulator::Scenario scenario;
  fdi::TomlReader file(text, "fuzz.toml");
  fdi::simulator::ApplyScenario(file, "/nowhere", scenario);
  file.Finish();
  const std::string canonical = fdi::simulator::ScenarioText(scenario);
  fdi::simulator::Scenario again;
  fdi::TomlReader written(canonical, "written.toml");
  try {
    fdi::simulator::ApplyScenario(written, "/nowhere", again);
    written.Finish();
  } catch (const fdi::ConfigError&) {
    __builtin_trap();
  }
}

void ReadTagMap(const std::string& text) {
  static const std::filesystem::path path =
      std::filesystem::temp_directory_path() /
      ("fdi-fuzz-" + std::to_string(getpid()) + ".toml");
  std::ofstream(path, std::ios::trunc) << text;
  fdi::importer::ReadTagMap(path);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const unsigned char* data,
                                      std::size_t size) {
  if (size == 0) {
    return 0;
  }
  const std::string text(reinterpret_cast<const char*>(data) + 1, size - 1);
  if (text.find("csv:") != std::string::npos ||
      text.find(".toml") != std::string::npos) {
    return 0;  // Would read other files.
  }
  try {
    (data[0] & 1) != 0 ? ReadTagMap(text) : ReadScenario(text);
  } catch (const fdi::ConfigError&) {
  } catch (const fdi::DataError&) {
  } catch (const fdi::NotFoundError&) {
  }
  return 0;
}
