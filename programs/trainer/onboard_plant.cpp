// fdi-trainer onboard --plant: every loop of a plant from one table.
#include "programs/trainer/onboard_plant.h"

#include <algorithm>
#include <map>
#include <memory>
#include <set>
#include <utility>

#include <CLI/CLI.hpp>

#include "base/error.h"
#include "base/time_text.h"
#include "diagnosis/records/valve_glob.h"
#include "import/plant_table.h"
#include "report/progress.h"
#include "report/stop_signals.h"
#include "storage/database/data_directory.h"
#include "trainer/campaign/campaign_runs.h"
#include "trainer/campaign/file_runs.h"
#include "trainer/fleet/plant_run.h"

namespace fdi::trainer {
namespace {

using report::Json;
using report::Tone;
using storage::LoopState;

// Lines that a dry run reads of each file, for form, words and ranges.
constexpr std::size_t kDryRunLines = 600;

std::vector<std::filesystem::path> FilesOf(
    const importer::PlantTable& table, const std::vector<std::string>& given,
    const std::filesystem::path& folder) {
  std::vector<std::filesystem::path> files;
  for (const std::string& pattern : given) {
    for (auto& file : MatchingFiles(pattern, "")) {
      files.push_back(std::move(file));
    }
  }
  if (given.empty()) {
    for (const std::string& pattern : table.files) {
      for (auto& file : MatchingFiles(pattern, folder)) {
        files.push_back(std::move(file));
      }
    }
  }
  return files;
}

// Takes from the table everything that the command line does not state.
importer::ColumnMap FormOf(importer::TableOptions form,
                           const importer::PlantTable& table,
                           const std::filesystem::path& folder, bool utc) {
  if (form.map.empty() && !table.map.empty()) {
    form.map = std::filesystem::path(table.map).is_absolute()
                   ? std::filesystem::path(table.map)
                   : folder / table.map;
  }
  form.zone = form.zone.empty() ? table.zone : form.zone;
  form.resample = form.resample.empty() ? table.resample : form.resample;
  return form.Read(utc);
}

Json RowJson(const PlantJob& job, const PlantOutcome& outcome, bool dry_run) {
  const storage::PlantLoop& loop = outcome.loop;
  return {{"loop", loop.name},
          {"row", job.row.place},
          {"service", loop.service.empty() ? Json() : Json(loop.service)},
          {"type", loop.type.empty() ? Json() : Json(loop.type)},
          {"grade", loop.grade ? Json(*loop.grade) : Json()},
          {"group", loop.group.empty() ? Json() : Json(loop.group)},
          {"state", dry_run && loop.state != LoopState::kRefused
                        ? "expected"
                        : storage::LoopStateName(loop.state)},
          {"watched_by", storage::LoopWatchName(loop.watch)},
          {"model_set",
           outcome.model_set.empty() ? Json() : Json(outcome.model_set)},
          {"unchanged", outcome.unchanged},
          {"seconds", outcome.seconds},
          {"finding", loop.finding},
          {"tags", job.matched},
          {"unmatched", job.unmatched},
          {"ambiguous", job.ambiguous}};
}

std::string CountsText(const Json& counts, bool dry_run) {
  const auto count = [&](const char* key) {
    return std::to_string(counts[key].get<std::size_t>());
  };
  return dry_run
             ? count("rows") + " rows: " + count("faults") +
                   " for named faults, " + count("audit") + " for the audit, " +
                   count("refused") + " refused; nothing was stored"
             : count("rows") + " rows: " + count("faults") +
                   " watched for named faults, " + count("audit") +
                   " by the audit, " + count("refused") + " refused; " +
                   count("unchanged") + " had not changed";
}

Json CountsJson(const Json& rows) {
  Json counts = {{"rows", rows.size()}, {"faults", 0},  {"audit", 0},
                 {"nothing", 0},        {"refused", 0}, {"unchanged", 0}};
  const auto add = [&](const std::string& key) {
    counts[key] = counts[key].get<std::size_t>() + 1;
  };
  for (const Json& row : rows) {
    add(row["watched_by"]);
    if (row["state"] == "refused") {
      add("refused");
    }
    if (row["unchanged"] == true) {
      add("unchanged");
    }
  }
  return counts;
}

// Tags that no row uses, by file.
Json UnusedTags(const std::vector<PlantJob>& jobs, const PlantFiles& files) {
  std::map<std::string, std::set<std::string>> used;
  for (const PlantJob& job : jobs) {
    for (const RowSource& source : job.sources) {
      used[source.path.string()].insert(source.match.columns.begin(),
                                        source.match.columns.end());
    }
  }
  Json unused = Json::array();
  for (const auto& [file, tags] : files.AllTags()) {
    Json rest = Json::array();
    for (const std::string& tag : tags) {
      if (!used[file].contains(tag)) {
        rest.push_back(tag);
      }
    }
    if (!rest.empty()) {
      unused.push_back({{"file", file}, {"tags", rest}});
    }
  }
  return unused;
}

report::Column StateColumn() {
  report::Column column{"state", "state"};
  column.text = [](const Json& row) {
    return row["unchanged"] == true
               ? row["state"].get<std::string>() + ", unchanged"
               : row["state"].get<std::string>();
  };
  column.tone = [](const Json& row) {
    return row["state"] == "refused" ? Tone::kWarning : Tone::kPlain;
  };
  return column;
}

// Ten are enough to see what a pattern has missed; JSON has all.
report::Column FirstTags() {
  report::Column column{"tags that no row uses", "tags"};
  column.text = [](const Json& row) {
    const Json& tags = row["tags"];
    std::string text;
    for (std::size_t i = 0; i < std::min<std::size_t>(tags.size(), 10); ++i) {
      text += (i == 0 ? "" : ", ") + tags[i].get<std::string>();
    }
    return tags.size() > 10
               ? text + " and " + std::to_string(tags.size() - 10) + " more"
               : text;
  };
  return column;
}

report::Report ReportOf(const importer::PlantTable& table,
                        const std::vector<PlantJob>& jobs,
                        const std::vector<PlantOutcome>& outcomes,
                        const PlantFiles& files,
                        const PlantVerbOptions& options) {
  report::Report report;
  Json rows = Json::array();
  for (std::size_t i = 0; i < jobs.size(); ++i) {
    rows.push_back(RowJson(jobs[i], outcomes[i], options.dry_run));
  }
  report.document = {{"plant", table.source},
                     {"dry_run", options.dry_run},
                     {"counts", CountsJson(rows)},
                     {"rows", std::move(rows)},
                     {"unused_tags", options.dry_run && options.valve == "*"
                                         ? UnusedTags(jobs, files)
                                         : Json::array()}};
  std::vector<report::Column> columns = {
      {"loop", "loop"},
      {"group", "group", report::Format::kPlain, 0, 3},
      StateColumn(),
      {"watched by", "watched_by"}};
  if (options.dry_run) {
    columns.push_back({"tags", "tags", report::Format::kPlain, 0, 2});
    columns.push_back({"unmatched", "unmatched", report::Format::kPlain, 0, 1});
  } else {
    columns.push_back({"model set", "model_set", report::Format::kPlain, 0, 2});
  }
  columns.push_back({"finding", "finding"});
  report.Table("rows", std::move(columns));
  report.Line("").Line(CountsText(report.document["counts"], options.dry_run));
  if (!report.document["unused_tags"].empty()) {
    report.Line("").Table("unused_tags", {{"file", "file"}, FirstTags()});
  }
  const Json& counts = report.document["counts"];
  if (!report.document["rows"].empty() && counts["refused"] == counts["rows"]) {
    report.exit_code = report::kExitData;
  }
  return report;
}

}  // namespace

void PlantVerbOptions::AddTo(CLI::App& verb) {
  verb.add_option("--plant", plant,
                  "Table of valves and loops, a row each: onboards every row "
                  "with a type, audits the others (docs/plant.md)")
      ->type_name("FILE.toml|FILE.csv");
}

report::Report OnboardFromTable(const PlantVerbOptions& options,
                                const std::vector<std::string>& files,
                                const importer::TableOptions& form,
                                const OnboardingOptions& onboarding,
                                const report::Context& context) {
  importer::PlantTable table = importer::ReadPlantTable(options.plant);
  std::erase_if(table.rows, [&](const importer::PlantRow& row) {
    return !GlobMatches(options.valve, row.name);
  });
  if (table.rows.empty()) {
    throw ConfigError("--valve " + options.valve + ": no row of " +
                      table.source + " has a name like that");
  }
  const auto folder = options.plant.parent_path();
  PlantSettings settings;
  settings.folder = folder;
  settings.jobs = options.jobs;
  settings.onboarding = onboarding;
  settings.onboarding.software = context.software;
  settings.onboarding.created_ns = NowNs();
  settings.utc = context.options.utc;
  PlantFiles plant_files(FormOf(form, table, folder, context.options.utc),
                         options.dry_run ? kDryRunLines : 0);
  const std::vector<PlantJob> jobs =
      MatchRows(table, FilesOf(table, files, folder), folder, plant_files);
  const storage::DataDirectory directory{context.options.data_dir};
  if (options.dry_run) {
    const std::unique_ptr<storage::ModelStore> store =
        std::filesystem::exists(directory.models())
            ? std::make_unique<storage::ModelStore>(directory.models())
            : nullptr;
    return ReportOf(table, jobs,
                    CheckPlant(jobs, plant_files, store.get(), settings),
                    plant_files, options);
  }
  storage::EnsureExists(directory);
  storage::ModelStore store(directory.models(),
                            storage::Access::kOccasionalWriter);
  const report::StopSignals signals;
  settings.stop = [&signals] { return signals.stop_requested(); };
  report::Progress bar("onboard");
  try {
    const auto outcomes =
        OnboardPlant(jobs, plant_files, store, settings,
                     [&bar](double share, const std::string& row) {
                       bar.Update(share, row);
                     });
    bar.Finish();
    return ReportOf(table, jobs, outcomes, plant_files, options);
  } catch (const Interrupted&) {
    throw Interrupted(
        "interrupted: finished rows are stored; the same command goes on with "
        "the others");
  }
}

}  // namespace fdi::trainer
