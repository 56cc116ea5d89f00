#include "trainer/app/file_runs.h"

#include <cmath>
#include <filesystem>

#include "diagnosis/error.h"

namespace fdi::trainer {
namespace {

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

bool IsWithin(const LabelledSample& labelled,
              const storage::RunSelector& selector) {
  const double t_s = static_cast<double>(labelled.sample.stamp_ns) * 1e-9;
  return t_s >= selector.from_s && t_s < selector.to_s;
}

}  // namespace

storage::StoredRun ReadRunFile(const std::string& text,
                               const std::optional<storage::ColumnMap>& map,
                               SignalMask required) {
  storage::StoredRun run;
  run.selector = SplitStretch(text);
  const std::filesystem::path path = run.selector.id;
  if (!std::filesystem::exists(path)) {
    throw NotFoundError("no file " + path.string());
  }
  storage::CsvOptions csv;
  csv.required = required;
  csv.map = map.value_or(storage::ColumnMap{});
  const storage::CsvTable table = storage::ReadCsvFile(path, csv);
  const storage::CsvRun& content = table.runs.front();
  run.info.id = run.selector.id;
  run.info.run.origin = storage::RunOrigin::kImported;
  run.info.run.period_s = content.period_s;
  run.info.run.flow_unit = content.flow_unit;
  run.info.signals = content.signals;
  run.info.has_truth = content.has_truth;
  for (const LabelledSample& labelled : content.samples) {
    if (IsWithin(labelled, run.selector)) {
      storage::StoredSample stored;
      stored.sample = labelled.sample;
      stored.truth = labelled.truth;
      run.samples.push_back(stored);
    }
  }
  if (run.samples.empty()) {
    throw NotFoundError("file " + text + " holds no sample (of " +
                        std::to_string(content.samples.size()) + ")");
  }
  return run;
}

}  // namespace fdi::trainer
