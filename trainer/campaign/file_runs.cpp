#include "trainer/campaign/file_runs.h"

#include <algorithm>
#include <cstdlib>
#include <string_view>
#include <utility>

#include "base/error.h"
#include "base/log.h"
#include "base/text.h"

namespace fdi::trainer {
namespace {

using std::filesystem::path;

// Replaces every ${NAME} by the environment variable of that name.
std::string WithVariables(std::string text) {
  std::size_t begin = 0;
  while ((begin = text.find("${", begin)) != std::string::npos) {
    const std::size_t end = text.find('}', begin);
    if (end == std::string::npos) {
      throw ConfigError("'" + text + "' lacks a } behind ${");
    }
    const std::string name = text.substr(begin + 2, end - begin - 2);
    const char* value = std::getenv(name.c_str());
    if (value == nullptr || *value == '\0') {
      throw ConfigError("the environment variable " + name + " is not set; '" +
                        text + "' needs it");
    }
    text.replace(begin, end - begin + 1, value);
    begin += std::string_view(value).size();  // It may hold a ${ of its own.
  }
  return text;
}

// The file and the stretch; an @ may be part of the name of a file.
storage::RunSelector SplitStretch(const std::string& text) {
  storage::RunSelector selector;
  selector.id = text;
  const std::size_t at = text.rfind('@');
  if (std::filesystem::exists(text) || at == std::string::npos) {
    return selector;
  }
  try {
    selector = storage::ParseRunSelector("f" + text.substr(at));
  } catch (const ConfigError&) {
    throw ConfigError("file " + text +
                      ": accepted are FILE, FILE@from:to, FILE@from: and "
                      "FILE@:to with seconds of its time column");
  }
  selector.id = text.substr(0, at);
  return selector;
}

storage::StoredRun EmptyRunOf(const importer::CsvTable& table,
                              storage::RunSelector selector) {
  storage::StoredRun run;
  run.selector = std::move(selector);
  const SampleSeries& content = table.runs.front();
  run.info.id = run.selector.id;
  run.info.run.start_ns = table.start_ns;
  run.info.run.origin = storage::RunOrigin::kImported;
  run.info.run.period_s = content.period_s;
  run.info.run.flow_unit = content.flow_unit;
  run.info.signals = content.signals;
  run.info.has_truth = content.has_truth;
  return run;
}

bool IsSelected(const storage::StoredRun& run, const Sample& sample) {
  const double t_s =
      static_cast<double>(sample.stamp_ns - run.info.run.start_ns) * 1e-9;
  return t_s >= run.selector.from_s && t_s < run.selector.to_s;
}

}  // namespace

std::vector<path> MatchingFiles(const std::string& pattern,
                                const path& folder) {
  const path given = WithVariables(pattern);
  const path absolute = given.is_absolute() ? given : folder / given;
  const std::string name = absolute.filename().string();
  if (name.find('*') == std::string::npos) {
    return {absolute};
  }
  std::vector<path> files;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(
           absolute.has_parent_path() ? absolute.parent_path() : ".", error)) {
    if (MatchesStars(name, entry.path().filename().string())) {
      files.push_back(entry.path());
    }
  }
  if (files.empty()) {
    throw ConfigError("no file is called " + absolute.string());
  }
  // An order that does not depend on the file system: runs of a campaign are
  // numbered by it.
  std::sort(files.begin(), files.end());
  return files;
}

storage::StoredRun RunOf(importer::CsvTable table,
                         storage::RunSelector selector) {
  storage::StoredRun run = EmptyRunOf(table, std::move(selector));
  for (SampleSeries& part : table.runs) {
    // Freed as soon as it is copied.
    const std::vector<LabelledSample> samples = std::move(part.samples);
    for (const LabelledSample& labelled : samples) {
      if (IsSelected(run, labelled.sample)) {
        run.samples.push_back({labelled.sample, labelled.truth});
      }
    }
  }
  return run;
}

storage::StoredRun ReadRunFile(const std::string& text,
                               importer::CsvOptions csv) {
  storage::RunSelector selector = SplitStretch(text);
  csv.split_gaps = true;
  std::vector<storage::StoredSample> samples;
  csv.take = [&samples](const LabelledSample& labelled) {
    samples.push_back({labelled.sample, labelled.truth});
  };
  const importer::CsvTable table = importer::ReadCsvFile(selector.id, csv);
  const std::size_t count = samples.size();
  storage::StoredRun run = EmptyRunOf(table, std::move(selector));
  std::erase_if(samples, [&run](const storage::StoredSample& stored) {
    return !IsSelected(run, stored.sample);
  });
  if (samples.empty()) {
    throw NotFoundError("file " + text + " holds no sample (of " +
                        std::to_string(count) + ")");
  }
  run.samples = std::move(samples);
  return run;
}

std::vector<storage::StoredRun> LoadRunsAndFiles(
    const std::vector<std::string>& runs, const std::vector<std::string>& files,
    const storage::DataDirectory& directory, const importer::CsvOptions& csv) {
  std::vector<storage::StoredRun> loaded;
  if (!runs.empty()) {
    storage::RunStore store(directory.runs());
    for (const std::string& selector : runs) {
      loaded.push_back(store.Load(selector));
    }
  }
  for (const std::string& file : files) {
    loaded.push_back(ReadRunFile(file, csv));
  }
  return loaded;
}

void ConvertFlow(storage::StoredRun& run, const simulator::FlowTarget& to,
                 const LogSink& log) {
  if (run.info.run.flow_unit == to.unit) {
    return;
  }
  simulator::FlowConversion conversion(to);
  try {
    for (storage::StoredSample& stored : run.samples) {
      conversion.Apply(stored.sample);
    }
  } catch (const DataError& error) {
    throw DataError("run " + run.info.id + ": " + error.what());
  }
  if (log && (run.info.signals & MaskOf(Signal::kF)) != 0) {
    log(LogLevel::kInfo,
        EventLine("flow_converted",
                  {{"run", run.info.id},
                   {"from", std::string(FlowUnitName(run.info.run.flow_unit))},
                   {"to", std::string(FlowUnitName(to.unit))}}));
  }
  run.info.run.flow_unit = to.unit;
}

}  // namespace fdi::trainer
