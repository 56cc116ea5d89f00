#include <iostream>
#include <memory>

#include <CLI/CLI.hpp>

#include "diagnosis/error.h"
#include "storage/app/common.h"
#include "storage/app/verbs.h"
#include "storage/cli/text_table.h"
#include "storage/history.h"
#include "storage/models.h"
#include "storage/runs.h"

namespace fdi::storage {
namespace {

using cli::Align;
using cli::Context;
using cli::Json;

struct File {
  const char* name;
  std::filesystem::path path;
  const Schema* schema;
};

std::vector<File> FilesOf(const DataDirectory& data) {
  return {{"runs.db", data.runs(), &RunsSchema()},
          {"models.db", data.models(), &ModelsSchema()},
          {"history.db", data.history(), &HistorySchema()}};
}

bool IsThere(const std::filesystem::path& path) {
  std::error_code error;
  const bool there = std::filesystem::exists(path, error);
  if (error) {
    throw DataError(path.string() + ": " + error.message());
  }
  return there;
}

// What is worth knowing about one file.
struct Finding {
  std::string name;
  bool present{false};
  int version{0};
  std::uintmax_t bytes{0};
  std::uintmax_t wal_bytes{0};
  std::vector<std::pair<std::string, std::int64_t>> figures;
  std::vector<std::string> troubles;
};

void AddFigures(const File& file, Database& database, Finding& finding) {
  const auto count = [&](const char* what, const char* sql) {
    finding.figures.emplace_back(what, database.QueryInt64(sql).value_or(0));
  };
  if (std::string_view(file.name) == "runs.db") {
    count("runs", "SELECT count(*) FROM run");
    count("tail_rows", "SELECT count(*) FROM tail");
  } else if (std::string_view(file.name) == "models.db") {
    count("model_sets", "SELECT count(*) FROM model_set");
    count("valves", "SELECT count(*) FROM valve");
  } else {
    count("episodes", "SELECT count(*) FROM episode");
    count("open_episodes",
          "SELECT count(*) FROM episode WHERE ended_ns IS NULL");
    count("unsent_events", "SELECT count(*) FROM event_outbox");
    count("unclean_sessions",
          "SELECT count(*) FROM monitor_session WHERE clean = 0");
  }
}

Finding Examine(const File& file) {
  Finding finding;
  finding.name = file.name;
  try {
    finding.present = IsThere(file.path);
    if (!finding.present) {
      return finding;
    }
    Database database(file.path, *file.schema, Access::kReader);
    finding.version = database.version();
    finding.bytes = database.FileBytes();
    finding.wal_bytes = database.WalBytes();
    finding.troubles = database.Check();
    AddFigures(file, database, finding);
  } catch (const DataError& error) {
    finding.troubles.emplace_back(error.what());
  } catch (const SqliteError& error) {
    finding.troubles.emplace_back(error.what());
  }
  return finding;
}

Json FindingJson(const Finding& finding) {
  Json figures = Json::object();
  for (const auto& [name, value] : finding.figures) {
    figures[name] = value;
  }
  return {{"name", finding.name},           {"present", finding.present},
          {"version", finding.version},     {"bytes", finding.bytes},
          {"wal_bytes", finding.wal_bytes}, {"figures", figures},
          {"troubles", finding.troubles}};
}

void PrintFindings(const std::vector<Finding>& findings) {
  cli::TextTable table({{"file"},
                        {"version", Align::kRight},
                        {"size [kB]", Align::kRight},
                        {"WAL [kB]", Align::kRight},
                        {"contents"},
                        {"verdict"}});
  for (const Finding& f : findings) {
    std::string contents;
    for (const auto& [name, value] : f.figures) {
      contents +=
          (contents.empty() ? "" : ", ") + std::to_string(value) + " " + name;
    }
    const auto number = [&f](std::uintmax_t value) {
      return f.present ? std::to_string(value) : std::string("-");
    };
    table.AddRow({f.name, number(static_cast<std::uintmax_t>(f.version)),
                  number(f.bytes / 1000), number(f.wal_bytes / 1000), contents,
                  !f.troubles.empty() ? "trouble"
                  : f.present         ? "sound"
                                      : "not there"});
  }
  table.Print(std::cout);
  for (const Finding& finding : findings) {
    for (const std::string& trouble : finding.troubles) {
      std::cout << finding.name << ": " << trouble << '\n';
    }
  }
}

int Doctor(const Context& context) {
  const DataDirectory data = DataOf(context);
  if (!IsThere(data.path)) {
    throw DataError("no data directory " + data.path.string());
  }
  std::vector<Finding> findings;
  Json databases = Json::array();
  bool sound = true;
  for (const File& file : FilesOf(data)) {
    findings.push_back(Examine(file));
    databases.push_back(FindingJson(findings.back()));
    sound = sound && findings.back().troubles.empty();
  }
  if (context.options.json) {
    cli::PrintJson(std::cout, {{"sound", sound}, {"databases", databases}});
  } else {
    PrintFindings(findings);
  }
  return sound ? cli::kExitOk : cli::kExitData;
}

int Backup(const std::string& target, const Context& context) {
  const std::filesystem::path folder(target);
  const DataDirectory data = DataOf(context);
  std::vector<File> present;
  for (File& file : FilesOf(data)) {
    if (IsThere(file.path)) {
      if (IsThere(folder / file.name)) {
        throw DataError("backup " + (folder / file.name).string() +
                        " exists already");
      }
      present.push_back(std::move(file));
    }
  }
  if (present.empty()) {
    throw NotFoundError("no database in " + data.path.string());
  }
  EnsureExists({folder});
  Json files = Json::array();
  for (const File& file : present) {
    const std::filesystem::path copy = folder / file.name;
    Database(file.path, *file.schema, Access::kReader).BackupTo(copy);
    files.push_back(copy.string());
    if (!context.options.json) {
      std::cout << copy.string() << '\n';
    }
  }
  if (context.options.json) {
    cli::PrintJson(std::cout, {{"files", files}});
  }
  return cli::kExitOk;
}

int Migrate(const Context& context) {
  Json files = Json::array();
  for (const File& file : FilesOf(DataOf(context))) {
    if (!IsThere(file.path)) {
      continue;
    }
    const Database database(file.path, *file.schema, Access::kOccasionalWriter);
    const auto& backup = database.migration_backup();
    files.push_back({{"name", file.name},
                     {"version", database.version()},
                     {"backup", backup ? Json(backup->string()) : Json()}});
    if (!context.options.json) {
      std::cout << file.name << ": version " << database.version()
                << (backup ? ", migrated; the old file is " + backup->string()
                           : ", nothing to do")
                << '\n';
    }
  }
  if (context.options.json) {
    cli::PrintJson(std::cout, {{"databases", files}});
  }
  return cli::kExitOk;
}

}  // namespace

void AddMaintenanceVerbs(cli::Program& program) {
  program.AddVerb("doctor", "Check the three databases", Doctor);
  auto target = std::make_shared<std::string>();
  program
      .AddVerb("backup", "Copy the databases while they are in use",
               [target](const Context& c) { return Backup(*target, c); })
      .add_option("folder", *target, "Where to; made if it is not there")
      ->required();
  program.AddVerb("migrate", "Bring the databases to the current version",
                  Migrate);
}

}  // namespace fdi::storage
