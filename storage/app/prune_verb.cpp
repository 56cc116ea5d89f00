#include <iostream>
#include <memory>

#include <CLI/CLI.hpp>

#include "diagnosis/error.h"
#include "storage/app/common.h"
#include "storage/app/verbs.h"
#include "storage/cli/text_table.h"
#include "storage/cli/time_text.h"
#include "storage/health_retention.h"
#include "storage/retention.h"
#include "storage/shadow_retention.h"

namespace fdi::storage {
namespace {

using cli::Align;
using cli::Context;
using cli::Json;

struct FileOptions {
  std::string age;
  std::optional<std::uint64_t> bytes;

  bool Asked() const { return !age.empty() || bytes.has_value(); }
  RetentionLimits Limits(bool dry_run) const {
    RetentionLimits limits;
    if (!age.empty()) {
      limits.before_ns = cli::NowNs() - cli::ParseDuration(age);
    }
    limits.max_bytes = bytes;
    limits.dry_run = dry_run;
    return limits;
  }
};

struct PruneOptions {
  FileOptions runs;
  FileOptions history;
  FileOptions health;
  FileOptions shadow;
  bool dry_run{false};
};

struct Pruned {
  const char* file;
  const char* items;
  PruneResult result;
};

std::vector<Pruned> PruneAll(const PruneOptions& options,
                             const DataDirectory& data) {
  const auto require = [](const std::filesystem::path& path) {
    if (!std::filesystem::exists(path)) {
      throw NotFoundError("no database " + path.string());
    }
  };
  std::vector<Pruned> pruned;
  if (options.runs.Asked()) {
    require(data.runs());
    pruned.push_back(
        {"runs.db", "runs",
         PruneRuns(data.runs(), options.runs.Limits(options.dry_run))});
  }
  if (options.history.Asked()) {
    require(data.history());
    pruned.push_back({"history.db", "episodes",
                      PruneHistory(data.history(),
                                   options.history.Limits(options.dry_run))});
  }
  if (options.health.Asked()) {
    require(data.history());
    pruned.push_back(
        {"history.db", "hours of health",
         PruneHealth(data.history(), options.health.Limits(options.dry_run))});
  }
  if (options.shadow.Asked()) {
    require(data.history());
    pruned.push_back(
        {"history.db", "shadow differences",
         PruneShadow(data.history(), options.shadow.Limits(options.dry_run))});
  }
  return pruned;
}

Json PrunedJson(const Pruned& pruned) {
  const PruneResult& r = pruned.result;
  return {{"name", pruned.file},
          {"items", pruned.items},
          {"deleted", r.deleted},
          {"protected", r.kept},
          {"from_utc", TimeJson(r.from_ns)},
          {"to_utc", TimeJson(r.to_ns)},
          {"bytes_before", r.bytes_before},
          {"bytes_after", r.bytes_after},
          {"fits", r.fits}};
}

void PrintPruned(const std::vector<Pruned>& pruned, const Context& context) {
  cli::TextTable table({{"file"},
                        {"deleted", Align::kRight},
                        {"items"},
                        {"from"},
                        {"to"},
                        {"protected", Align::kRight},
                        {"before [kB]", Align::kRight},
                        {"after [kB]", Align::kRight}});
  for (const Pruned& p : pruned) {
    const PruneResult& r = p.result;
    table.AddRow({p.file, std::to_string(r.deleted), p.items,
                  TimeText(r.from_ns, context), TimeText(r.to_ns, context),
                  std::to_string(r.kept), std::to_string(r.bytes_before / 1000),
                  std::to_string(r.bytes_after / 1000)});
  }
  table.Print(std::cout);
}

int Prune(const PruneOptions& options, const Context& context) {
  if (!options.runs.Asked() && !options.history.Asked() &&
      !options.health.Asked() && !options.shadow.Asked()) {
    throw ConfigError(
        "prune: say what may go: --runs-age, --runs-size, --history-age, "
        "--history-size, --health-age or --shadow-age");
  }
  const std::vector<Pruned> pruned = PruneAll(options, DataOf(context));
  if (context.options.json) {
    Json files = Json::array();
    for (const Pruned& p : pruned) {
      files.push_back(PrunedJson(p));
    }
    cli::PrintJson(std::cout,
                   {{"dry_run", options.dry_run}, {"databases", files}});
  } else {
    if (options.dry_run) {
      std::cout << "Nothing is deleted; this would go:\n";
    }
    PrintPruned(pruned, context);
  }
  for (const Pruned& p : pruned) {
    if (!p.result.fits) {
      context.log(LogLevel::kWarning,
                  std::string("prune_incomplete file=") + p.file +
                      " bytes=" + std::to_string(p.result.bytes_after) +
                      " reason=\"the rest is protected\"");
    }
  }
  return cli::kExitOk;
}

void AddLimits(CLI::App& verb, const std::string& what, FileOptions& options) {
  verb.add_option("--" + what + "-age", options.age,
                  "Delete what ended longer ago: 90d, 2d12h, ...");
  verb.add_option("--" + what + "-size", options.bytes,
                  "Then the oldest until so much is left: 20GB, 500MB, ...")
      ->transform(CLI::AsSizeValue(true));
}

}  // namespace

void AddPruneVerb(cli::Program& program) {
  auto options = std::make_shared<PruneOptions>();
  CLI::App& verb = program.AddVerb(
      "prune",
      "Delete old recorded runs, old episodes that are closed, acknowledged "
      "and not labelled, old hours of health and old differences of candidates",
      [options](const Context& c) { return Prune(*options, c); });
  AddLimits(verb, "runs", options->runs);
  AddLimits(verb, "history", options->history);
  verb.add_option("--health-age", options->health.age,
                  "Delete hours of health that are older: 1000d, ...");
  verb.add_option("--shadow-age", options->shadow.age,
                  "Delete differences of a candidate that are older: 90d, ...");
  verb.add_flag("--dry-run", options->dry_run, "Only say what would go");
}

}  // namespace fdi::storage
