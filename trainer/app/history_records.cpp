#include "trainer/app/history_records.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <regex>

#include "diagnosis/error.h"
#include "diagnosis/valve_engine.h"
#include "storage/cli/time_text.h"
#include "trainer/app/matching_files.h"
#include "trainer/evaluation.h"

namespace fdi::trainer {
namespace {

using std::filesystem::path;

bool IsCsv(const path& file) {
  return file.extension() == ".csv";
}

std::vector<path> FilesOf(const std::string& pattern) {
  if (!std::filesystem::is_directory(pattern)) {
    std::vector<path> files =
        MatchingFiles(pattern, std::filesystem::current_path());
    std::erase_if(files, [](const path& file) { return !exists(file); });
    return files;
  }
  std::vector<path> files;
  for (const auto& entry :
       std::filesystem::recursive_directory_iterator(pattern)) {
    if (entry.is_regular_file() && IsCsv(entry.path())) {
      files.push_back(entry.path());
    }
  }
  return files;
}

// One valve's stream through one engine.
class Follower {
 public:
  explicit Follower(const std::shared_ptr<const ModelSet>& models,
                    PastRecord& record)
      : models_(*models), engine_(models), record_(record) {}

  void Take(Sample sample) {
    sample.source_id = 1;
    sample.seq = seq_++;
    const Verdict& verdict = engine_.Step(sample);
    const double hours = models_.sample_period_s / 3600.0;
    record_.first_ns = seq_ == 1 ? sample.stamp_ns : record_.first_ns;
    record_.last_ns = sample.stamp_ns;
    record_.hours += hours;
    record_.live_hours += verdict.quality == Quality::kLive ? hours : 0.0;
    record_.rejected += verdict.intake != Intake::kAccepted;
    for (const Transition& transition : verdict.Transitions()) {
      Take(transition);
    }
    if (verdict.detected) {
      record_.episodes.back().ended_ns = sample.stamp_ns;
    }
  }

  bool has_samples() const { return seq_ > 0; }

 private:
  void Take(const Transition& transition) {
    if (transition.kind == TransitionKind::kDetected) {
      record_.episodes.push_back(
          {record_.valve, transition.stamp_ns, transition.stamp_ns, {}});
      return;
    }
    PastEpisode& episode = record_.episodes.back();
    episode.ended_ns = transition.stamp_ns;
    if (transition.faults != 0) {
      episode.said = FaultsIn(models_, transition.faults);
    }
  }

  const ModelSet& models_;
  ValveEngine engine_;
  PastRecord& record_;
  std::uint64_t seq_{0};
};

void RequireSuited(const path& file, const storage::CsvHeader& header,
                   const ModelSet& models) {
  if ((RequiredSignals(models) & MaskOf(Signal::kF)) != 0 &&
      header.flow_unit != models.flow_unit) {
    throw DataError(file.string() + ": has its flow in " +
                    std::string(FlowUnitName(header.flow_unit)) +
                    ", model set " + models.name + " was trained in " +
                    std::string(FlowUnitName(models.flow_unit)));
  }
}

}  // namespace

std::optional<std::int64_t> StartInName(const path& file) {
  static const std::regex kDate(
      R"((\d{4}-\d{2}-\d{2})(?:T(\d{2}):?(\d{2})(?::?(\d{2}))?Z?)?)");
  const std::string name = file.stem().string();
  std::smatch match;
  if (!std::regex_search(name, match, kDate)) {
    return std::nullopt;
  }
  std::string time = match[1].str() + "T00:00:00Z";
  if (match[2].matched) {
    time = match[1].str() + "T" + match[2].str() + ":" + match[3].str() + ":" +
           (match[4].matched ? match[4].str() : "00") + "Z";
  }
  return cli::ParseTime(time, true);
}

std::vector<ValveFiles> FindHistory(const std::string& pattern,
                                    const std::string& valve) {
  std::map<std::string, std::vector<path>> by_valve;
  for (const path& file : FilesOf(pattern)) {
    const path folder = std::filesystem::absolute(file).parent_path();
    by_valve[valve.empty() ? folder.filename().string() : valve].push_back(
        file);
  }
  if (by_valve.empty()) {
    throw NotFoundError("no CSV file in " + pattern);
  }
  std::vector<ValveFiles> valves;
  for (auto& [name, files] : by_valve) {
    std::sort(files.begin(), files.end(), [](const path& a, const path& b) {
      return std::pair(StartInName(a), a) < std::pair(StartInName(b), b);
    });
    valves.push_back({name, std::move(files)});
  }
  return valves;
}

PastRecord FollowHistory(const ValveFiles& files,
                         const std::shared_ptr<const ModelSet>& models,
                         const std::optional<storage::ColumnMap>& map,
                         const FileSink& progress) {
  PastRecord record;
  record.valve = files.valve;
  Follower follower(models, record);
  for (const path& file : files.files) {
    if (progress) {
      progress(file);
    }
    storage::CsvOptions csv;
    csv.map = map.value_or(storage::ColumnMap{});
    csv.required = RequiredSignals(*models);
    csv.split_gaps = true;
    csv.period_s = models->sample_period_s;
    csv.start_ns = StartInName(file).value_or(0);
    const storage::CsvTable table = storage::ReadCsvFile(file, csv);
    RequireSuited(file, table.header, *models);
    const Sample& first = table.runs.front().samples.front().sample;
    if (follower.has_samples() && first.stamp_ns <= record.last_ns) {
      throw DataError(file.string() + ": begins at " +
                      cli::FormatTime(first.stamp_ns, true) +
                      ", not after the end of the file before, " +
                      cli::FormatTime(record.last_ns, true) +
                      "; a date in the names of files (YYYY-MM-DD or "
                      "YYYY-MM-DDTHHMM) tells when t_s = 0 is");
    }
    for (const storage::CsvRun& run : table.runs) {
      for (const LabelledSample& labelled : run.samples) {
        follower.Take(labelled.sample);
      }
    }
  }
  return record;
}

}  // namespace fdi::trainer
