#include "storage/models/plant_loops.h"

#include <algorithm>
#include <array>

#include "base/time_text.h"
#include "storage/database/record.h"
#include "storage/models/sql.h"

namespace fdi::storage {

template <>
struct EnumText<LoopWatch> {
  static constexpr auto name = LoopWatchName;
  static constexpr auto last = LoopWatch::kFaults;
};
template <>
struct EnumText<LoopState> {
  static constexpr auto name = LoopStateName;
  static constexpr auto last = LoopState::kRefused;
};

namespace sql = models_sql;

std::string_view LoopWatchName(LoopWatch watch) {
  constexpr std::array<std::string_view, 3> kNames = {"nothing", "audit",
                                                      "faults"};
  return kNames[static_cast<std::size_t>(watch)];
}

std::string_view LoopStateName(LoopState state) {
  constexpr std::array<std::string_view, 4> kNames = {"expected", "onboarded",
                                                      "data_only", "refused"};
  return kNames[static_cast<std::size_t>(state)];
}

void ModelStore::StoreLoop(const PlantLoop& loop) {
  database_.Run(sql::put_loop, loop.name, loop.service, loop.type, loop.grade,
                loop.group, loop.watch, loop.state, loop.finding,
                loop.input_hash, NowNs(), loop.description, loop.location,
                loop.document, loop.costs);
}

bool ModelStore::IsEntry(std::string_view pattern) {
  return database_.QueryInt64("SELECT 1 FROM valve WHERE pattern = ?", pattern)
      .has_value();
}

std::optional<ModelSet> ModelStore::Store(const ValveResult& result) {
  std::optional<ModelSet> saved;
  const std::string& valve = result.entry.pattern;
  // A set from before still serves, whatever became of this record.
  const bool has_set =
      result.loop && AssignedModelSet(result.loop->name).has_value();
  Transaction transaction(database_);
  if (result.models) {
    saved = Insert(*result.models, Activation::kAlways, result.lineage);
    if (result.type) {
      StoreType(result.type(*saved));
    }
  }
  if (!valve.empty()) {
    // A person's entries stay, except where the record knows better.
    ValveEntry entry = IsEntry(valve) ? RequireEntry(valve) : result.entry;
    if (saved) {
      entry.flow_unit = result.entry.flow_unit;
      entry.signals = result.entry.signals;
      entry.period_s = result.entry.period_s;
    }
    StoreEntry(entry);
    if (saved) {
      BaselineRecord baseline = result.baseline;
      baseline.epoch = entry.epoch;
      baseline.model_set = saved->name;
      baseline.version = saved->version;
      StoreBaseline(valve, baseline);
    }
  }
  if (result.loop) {
    PlantLoop loop = *result.loop;
    if (!saved && has_set) {
      loop.watch = LoopWatch::kFaults;
    }
    StoreLoop(loop);
  }
  transaction.Commit();
  return saved;
}

void ModelStore::PutLoop(const PlantLoop& loop, const ValveEntry& entry) {
  Store(
      {.entry = entry, .models = {}, .baseline = {}, .type = {}, .loop = loop});
}

namespace {

std::vector<PlantLoop> ReadLoops(Database& database,
                                 std::optional<std::string_view> name) {
  std::vector<PlantLoop> loops;
  Statement rows = database.Prepare(sql::loops);
  rows.Bind(name);
  while (rows.Step()) {
    PlantLoop& loop = loops.emplace_back();
    rows.Read(0, loop.name, loop.service, loop.type, loop.grade, loop.group,
              loop.watch, loop.state, loop.finding, loop.input_hash,
              loop.checked_ns, loop.description, loop.location, loop.document,
              loop.costs);
  }
  return loops;
}

}  // namespace

std::vector<PlantLoop> ModelStore::Loops() {
  return ReadLoops(database_, std::nullopt);
}

std::optional<PlantLoop> FindLoop(ModelStore& store, std::string_view name) {
  const auto loops = ReadLoops(store.database(), name);
  return loops.empty() ? std::nullopt : std::optional(loops.front());
}

std::size_t ModelStore::TakeLoops(ModelStore& other) {
  const std::vector<PlantLoop> loops = other.Loops();
  for (const PlantLoop& loop : loops) {
    TakeValve(other, loop.name, std::nullopt);
    Transaction transaction(database_);
    StoreLoop(loop);
    transaction.Commit();
  }
  // A type that is here already stays as it is, whatever the other store has.
  const std::vector<ValveType> here = ListTemplates();
  for (const ValveType& type : other.ListTemplates()) {
    if (std::ranges::find(here, type.name, &ValveType::name) == here.end()) {
      Transaction transaction(database_);
      StoreType(other.LoadTemplate(type.name));
      transaction.Commit();
    }
  }
  return loops.size();
}

}  // namespace fdi::storage
