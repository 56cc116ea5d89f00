#pragma once

#include <cmath>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>

#include "cli/output_folder.h"
#include "cli/program.h"
#include "cli/report.h"
#include "cli/text_table.h"
#include "cli/time_text.h"
#include "cli/verb_options.h"
#include "storage/database/data_directory.h"
#include "storage/history/alarm.h"
#include "storage/history/episode.h"
#include "storage/history/history_editor.h"
#include "storage/history/history_reader.h"

/// The verbs of fdi-store, one file per noun. A verb reads its data, fills the
/// document of a Report, and declares which members the text output shows.
namespace fdi::storage {

class ModelStore;

using cli::Context;
using cli::Json;
using cli::Report;

// Each adds the verbs of one group, in the order in which --help lists them.
void AddRunsVerbs(cli::Program& program);
void AddSniffVerb(cli::Program& program, CLI::App& group);
void AddModelsVerbs(cli::Program& program);
void AddValvesVerbs(cli::Program& program);
void AddTypesVerbs(cli::Program& program);
void AddHistoryVerbs(cli::Program& program);  ///< list, show, export, plot
// Added to the group `history`, which must exist.
void AddHistoryFigures(cli::Program& program, CLI::App& group);
void AddAlarmVerbs(cli::Program& program, CLI::App& group);
void AddPlannerVerbs(cli::Program& program);  ///< faults, health, worklist
void AddMaintenanceVerbs(cli::Program& program);
void AddKeysVerbs(cli::Program& program);
void AddShipVerb(cli::Program& program);

/// Examples for --help and the manual pages.
std::vector<cli::VerbExamples> Examples();

/// For verbs without options.
struct NoOptions {};

/// Adds a verb to a group or, with program.root(), to the program. The action
/// receives the Options that the caller binds to command-line options:
///
///     auto [verb, options] = AddVerb(program, group, "list", "...", List);
///     verb.add_option("--valve", options.valve, "Glob over valve ids");
template <typename Options>
std::pair<CLI::App&, Options&> AddVerb(cli::Program& program, CLI::App& group,
                                       const std::string& name,
                                       const std::string& description,
                                       Report (*action)(const Options&,
                                                        const Context&)) {
  auto options = std::make_shared<Options>();
  CLI::App& verb = program.AddVerb(
      group, name, description,
      cli::ReportAction([options, action](const Context& context) {
        return action(*options, context);
      }));
  return {verb, *options};
}

/// The data directory of --data.
DataDirectory DataOf(const Context& context);
/// The same, created if it does not exist; for verbs that write.
DataDirectory WritableDataOf(const Context& context);
/// Its model store, opened for changes.
ModelStore WritableModels(const Context& context);

/// Options that filter a list of episodes.
struct EpisodeOptions {
  std::string valve{"*"};
  std::string fault;
  std::string state{"any"};
  std::int64_t limit{0};
  cli::TimeWindow window;

  void AddTo(CLI::App& verb);
  /// @throws ConfigError
  EpisodeFilter Filter(const Context& context) const;
};

/// --from, --monitor: selects a history other than that of --data.
struct PlantOptions {
  std::string url;
  std::string monitor;

  bool asked() const { return !url.empty(); }
  void AddTo(CLI::App& verb);
};

/// Which episodes of which history.
struct HistoryOptions {
  EpisodeOptions filter;
  PlantOptions plant;

  void AddTo(CLI::App& verb) {
    filter.AddTo(verb);
    plant.AddTo(verb);
  }
};

/// The history of --data, or the plant's.
std::unique_ptr<History> OpenHistory(const PlantOptions& plant,
                                     const Context& context);

/// Options of operator actions: --by, --comment.
struct NoteOptions {
  std::string who{cli::UserName()};
  std::string comment;

  void AddTo(CLI::App& verb);
  /// A note from this program, stamped now.
  OperatorNote Note() const;
};

/// The positional argument of verbs about one episode.
void AddEpisode(CLI::App& verb, std::string& id, bool required = true);
/// -o, --output with "-" for stdout.
void AddOutput(CLI::App& verb, std::string& output);
/// --limit.
void AddLimit(CLI::App& verb, std::int64_t& limit);

// JSON values; null where there is none.
Json TimeJson(const std::optional<std::int64_t>& stamp_ns);  ///< RFC 3339, UTC
Json TextJson(const std::optional<std::string>& text);  ///< Null if empty, too.
Json NumberJson(const std::optional<double>& number);   ///< Null if not finite.
/// False if the variance accounted for, 100 (1 - var(residual) / var(output))
/// %, is meaningless because the output stood still in the validation data.
bool IsVafMeaningful(double vaf);
Json VafJson(double vaf);              ///< Null if it is meaningless.
std::string Hex(std::uint64_t value);  ///< 16 digits

/// An array with row_of(item) for each item.
template <typename Items, typename RowOf>
Json Rows(const Items& items, RowOf row_of) {
  Json rows = Json::array();
  for (const auto& item : items) {
    rows.push_back(row_of(item));
  }
  return rows;
}

/// The columns of the view fault_history, in its order.
const std::vector<std::string>& EpisodeKeys();
Json EpisodeJson(const Episode& episode);
Json ShelfJson(const Shelf& shelf);

/// {"V1": {"LIVE": 12.5, ...}, ...}: hours by valve and quality.
Json HoursJson(const std::vector<CoverageTime>& coverage);
/// The same as a text table; adds nothing if it is empty.
void AddHours(Report& report, const std::vector<CoverageTime>& coverage);
/// A table in the text output only, whose rows are not in the document.
void AddTextTable(Report& report, const cli::TextTable& table);

/// In the user's time format; "-" if there is none.
std::string TimeText(const std::optional<std::int64_t>& stamp_ns,
                     const Context& context);
/// A column, or field, whose text is not a member of the document.
cli::Column TextColumn(std::string heading,
                       std::function<std::string(const Json& row)> text,
                       int spare = 0, cli::Align align = cli::Align::kLeft);
cli::Column TextField(std::string heading, std::string text);

}  // namespace fdi::storage
