#pragma once

#include <cmath>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>

#include "base/text.h"
#include "base/time_text.h"
#include "diagnosis/records/loop_audits.h"
#include "report/findings/finding.h"
#include "report/output_folder.h"
#include "report/program.h"
#include "report/report.h"
#include "report/text_table.h"
#include "report/verb_options.h"
#include "storage/database/data_directory.h"
#include "storage/history/alarm.h"
#include "storage/history/episode.h"
#include "storage/history/history_editor.h"
#include "storage/history/history_reader.h"
#include "storage/models/models.h"

/// The verbs of fdi-store, one file per noun. A verb reads its data, fills the
/// document of a Report, and declares which members the text output shows.
namespace fdi::storage {

class ModelStore;

using report::Context;
using report::Json;
using report::Report;

// Each adds the verbs of one group, in the order in which --help lists them.
void AddRunsVerbs(report::Program& program);
void AddSniffVerb(report::Program& program, CLI::App& group);
void AddModelsVerbs(report::Program& program);
void AddValvesVerbs(report::Program& program);
void AddTypesVerbs(report::Program& program);
void AddHistoryVerbs(report::Program& program);  ///< list, show, export, plot
// Added to the group `history`, which must exist.
void AddAlarmVerbs(report::Program& program, CLI::App& group);
void AddAuditVerb(report::Program& program);
/// Audits at most `windows` windows of two hours of each loop, spread over its
/// newest run since `since_ns`. Simulated runs are of no loop of the plant.
/// Empty without runs.
LoopAudits AuditStoredRuns(const DataDirectory& data, std::int64_t since_ns,
                           int windows);
void AddFaultsVerb(report::Program& program);
void AddMaintenanceVerbs(report::Program& program);
// Verbs of optional components; in a build without them, left_out.cpp has them.
void AddPlannerVerbs(report::Program& program);  ///< health, worklist
void AddShipVerb(report::Program& program);

/// Lists present and planned shelves; with filter.since_ns also those that have
/// ended since then.
Report ListShelf(History& history, const EpisodeFilter& filter,
                 const Context& context);

/// Examples for --help and the manual pages.
std::vector<report::VerbExamples> Examples();

/// For verbs without options.
struct NoOptions {};

/// The data directory of --data.
DataDirectory DataOf(const Context& context);
/// The same, created if it does not exist; for verbs that write.
DataDirectory WritableDataOf(const Context& context);
/// Its model store, opened for changes.
ModelStore WritableModels(const Context& context);

/// Options that filter a list of episodes.
struct EpisodeOptions {
  std::string valve;  ///< Glob; empty: all.
  std::string fault;
  std::string state{"any"};
  report::TimeWindow window;

  void AddTo(CLI::App& verb);
  /// True if one of them narrows the list.
  bool given() const {
    return !valve.empty() || !fault.empty() || state != "any" ||
           !window.since.empty() || !window.until.empty();
  }
  /// @throws ConfigError
  EpisodeFilter Filter(const Context& context) const;
};

/// --db, --monitor: selects a history other than that of --data.
struct PlantOptions {
  std::string url;
  std::string monitor;

  /// @throws ConfigError for a monitor without a plant.
  bool asked() const;
  void AddTo(CLI::App& verb);
};

/// The episodes and the history that a verb reads.
struct HistoryOptions {
  EpisodeOptions filter;
  PlantOptions plant;
  std::int64_t rows{0};  ///< At most; 0: all.
  bool shelved{false};   ///< The shelf instead.
};

/// The limits of `prune --db`, which deletes from the plant's history.
struct PlantPrune {
  std::string url;
  std::string history_age;
  std::string health_age;
  bool dry_run{false};
  bool trust_clock{false};
};
Report PrunePlant(const PlantPrune& options, const Context& context);

/// This build has the plant's history, an optional component.
bool ReadsPlants();
/// Hides an option of the plant's history in a build without it; OpenPlant()
/// and PrunePlant() refuse it there.
void ShowWithPlant(CLI::Option* option);
/// The plant's history.
std::unique_ptr<History> OpenPlant(const PlantOptions& plant);
/// The history of --data, or the plant's.
std::unique_ptr<History> OpenHistory(const PlantOptions& plant,
                                     const Context& context);

/// Options of operator actions: --by, --comment.
struct NoteOptions {
  std::string who{report::UserName()};
  std::string comment;

  void AddTo(CLI::App& verb);
  /// A note from this program, stamped now.
  OperatorNote Note() const;
};

/// The positional argument of verbs about one episode.
void AddEpisode(CLI::App& verb, std::string& id);
/// -o, --output with "-" for stdout.
void AddOutput(CLI::App& verb, std::string& output);

// JSON values; null where there is none.
Json TimeJson(const std::optional<std::int64_t>& stamp_ns);  ///< RFC 3339, UTC
Json TextJson(const std::optional<std::string>& text);  ///< Null if empty, too.
Json NumberJson(const std::optional<double>& number);   ///< Null if not finite.
/// False if the variance accounted for, 100 (1 - var(residual) / var(output))
/// %, is meaningless because the output stood still in the validation data.
bool IsVafMeaningful(double vaf);
Json VafJson(double vaf);  ///< Null if it is meaningless.

/// An array with row_of(item) for each item.
template <typename Items, typename RowOf>
Json Rows(const Items& items, RowOf row_of) {
  Json rows = Json::array();
  for (const auto& item : items) {
    rows.push_back(row_of(item));
  }
  return rows;
}

/// Who the valves are, and what was done to them.
struct ValveNotes {
  findings::Identities about{};
  std::vector<std::pair<std::string, ValveEvent>> repairs{};
};
/// Notes from models.db; nothing for the history of a plant.
ValveNotes NotesOf(const Context& context);
ValveNotes NotesOf(const PlantOptions& plant, const Context& context);
/// The columns of the view fault_history, in its order.
const std::vector<std::string>& EpisodeKeys();
/// Puts the names of the fault catalogue where the history has none.
void NameFaults(std::vector<Episode>& episodes, const Context& context);
Json EpisodeJson(const Alarm& alarm, const ValveNotes& valves);
Json ValveEventJson(const ValveEvent& event);
Json ShelfJson(const Shelf& shelf);

/// {"V1": {"LIVE": 12.5, ...}, ...}: hours by valve and quality.
Json HoursJson(const std::vector<CoverageTime>& coverage);
/// The same as a text table; adds nothing if it is empty.
void AddHours(Report& report, const std::vector<CoverageTime>& coverage);
/// A table in the text output only, whose rows are not in the document.
void AddTextTable(Report& report, const report::TextTable& table);

/// In the user's time format; "-" if there is none.
std::string TimeText(const std::optional<std::int64_t>& stamp_ns,
                     const Context& context);
/// A column, or field, whose text is not a member of the document.
report::Column TextColumn(std::string heading,
                          std::function<std::string(const Json& row)> text,
                          int spare = 0,
                          report::Align align = report::Align::kLeft);
report::Column TextField(std::string heading, std::string text);

}  // namespace fdi::storage
