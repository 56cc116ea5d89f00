#include "diagnosis/error.h"
#include "storage/models.h"

namespace fdi::storage {
namespace {

constexpr std::string_view kColumns =
    "pattern, type, flow_unit, sense, signals, period_s, epoch, model_set,"
    " model_set_version, baseline_epoch";

std::string Select(std::string_view rest) {
  return "SELECT " + std::string(kColumns) + " FROM valve " +
         std::string(rest) + " ORDER BY valve_entry_id";
}

ValveEntry ReadEntry(const Statement& row) {
  ValveEntry entry;
  entry.pattern = row.Text(0);
  entry.type = row.Text(1);
  entry.flow_unit = ParseFlowUnit(row.Text(2)).value_or(FlowUnit::kM3PerHour);
  entry.sense = row.Text(3) == "opening" ? Sense::kOpening : Sense::kClosing;
  entry.signals = static_cast<SignalMask>(row.Int64(4));
  entry.period_s = row.Double(5);
  entry.epoch = static_cast<std::uint32_t>(row.Int64(6));
  if (!row.IsNull(7)) {
    entry.model_set = ModelReference{row.Text(7), std::nullopt};
    if (!row.IsNull(8)) {
      entry.model_set->version = row.Int(8);
    }
  }
  if (!row.IsNull(9)) {
    entry.baseline_epoch = static_cast<std::uint32_t>(row.Int64(9));
  }
  return entry;
}

std::optional<std::string> NameOf(const std::optional<ModelReference>& set) {
  return set ? std::optional(set->name) : std::nullopt;
}

std::optional<int> VersionOf(const std::optional<ModelReference>& set) {
  return set ? set->version : std::nullopt;
}

}  // namespace

std::vector<ValveEntry> ModelStore::Valves() {
  std::vector<ValveEntry> entries;
  Statement rows = database_.Prepare(Select(""));
  while (rows.Step()) {
    entries.push_back(ReadEntry(rows));
  }
  return entries;
}

void ModelStore::PutValve(const ValveEntry& entry) {
  if (entry.pattern.empty() || !(entry.period_s > 0.0)) {
    throw ConfigError("valve \"" + entry.pattern +
                      "\": an id or glob and a positive sample period are "
                      "needed");
  }
  Transaction transaction(database_);
  StoreEntry(entry);
  transaction.Commit();
}

void ModelStore::StoreEntry(const ValveEntry& entry) {
  if (entry.model_set) {
    RequireId(*entry.model_set);
  }
  database_.Run(
      "INSERT INTO valve (" + std::string(kColumns) +
          ") VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?) ON CONFLICT (pattern)"
          " DO UPDATE SET type = excluded.type, flow_unit = excluded.flow_unit,"
          " sense = excluded.sense, signals = excluded.signals,"
          " period_s = excluded.period_s, epoch = excluded.epoch,"
          " model_set = excluded.model_set,"
          " model_set_version = excluded.model_set_version,"
          " baseline_epoch = excluded.baseline_epoch",
      entry.pattern, entry.type, FlowUnitName(entry.flow_unit),
      entry.sense == Sense::kOpening ? "opening" : "closing", entry.signals,
      entry.period_s, entry.epoch, NameOf(entry.model_set),
      VersionOf(entry.model_set), entry.baseline_epoch);
  BumpGeneration();
}

void ModelStore::RemoveValve(std::string_view pattern) {
  Transaction transaction(database_);
  database_.Run("DELETE FROM valve WHERE pattern = ?", pattern);
  if (database_.Changes() == 0) {
    throw NotFoundError("there is no valve entry \"" + std::string(pattern) +
                        "\" in " + database_.path().string());
  }
  BumpGeneration();
  transaction.Commit();
}

ValveEntry ModelStore::RequireEntry(std::string_view pattern) {
  Statement row = database_.Prepare(Select("WHERE pattern = ?"));
  if (!row.Bind(pattern).Step()) {
    throw NotFoundError("there is no valve entry \"" + std::string(pattern) +
                        "\" in " + database_.path().string());
  }
  return ReadEntry(row);
}

ValveEntry ModelStore::EntryOrNew(
    std::string_view pattern, const std::optional<ModelReference>& reference) {
  Statement row = database_.Prepare(Select("WHERE pattern = ?"));
  if (row.Bind(pattern).Step()) {
    return ReadEntry(row);
  }
  ValveEntry entry;
  entry.pattern = std::string(pattern);
  if (reference) {
    const ModelSummary summary = Summary(*reference);
    entry.flow_unit = summary.flow_unit;
    entry.period_s = summary.period_s;
  }
  return entry;
}

void ModelStore::AssignModelSet(
    std::string_view pattern, const std::optional<ModelReference>& reference) {
  ValveEntry entry = EntryOrNew(pattern, reference);
  if (entry.model_set != reference) {
    entry.baseline_epoch.reset();
  }
  entry.model_set = reference;
  PutValve(entry);
}

std::optional<ValveEntry> ModelStore::FindValve(std::string_view valve_id) {
  Statement row =
      database_.Prepare(Select("WHERE pattern = ?1 OR ?1 GLOB pattern"));
  return row.Bind(valve_id).Step() ? std::optional(ReadEntry(row))
                                   : std::nullopt;
}

std::optional<ModelReference> ModelStore::AssignedModelSet(
    std::string_view valve_id) {
  const Snapshot snapshot(database_);
  Statement row =
      database_.Prepare(Select("WHERE (pattern = ?1 OR ?1 GLOB pattern)"
                               " AND model_set IS NOT NULL"));
  ModelReference reference{std::string(valve_id), std::nullopt};
  if (row.Bind(valve_id).Step()) {
    reference = *ReadEntry(row).model_set;
  }
  if (!reference.version) {
    const auto active = database_.QueryInt64(
        "SELECT version FROM model_set WHERE name = ? AND active",
        reference.name);
    if (!active) {
      return std::nullopt;
    }
    reference.version = static_cast<int>(*active);
  }
  return reference;
}

std::int64_t ModelStore::Generation() {
  return database_.QueryInt64("SELECT value FROM generation").value_or(0);
}

ChangeCounter::ChangeCounter(const std::filesystem::path& path)
    : store_(path),
      data_version_(store_.database().DataVersion()),
      generation_(store_.Generation()) {}

bool ChangeCounter::Changed() {
  const std::int64_t data_version = store_.database().DataVersion();
  if (data_version == data_version_) {
    return false;
  }
  data_version_ = data_version;
  const std::int64_t generation = store_.Generation();
  const bool changed = generation != generation_;
  generation_ = generation;
  return changed;
}

}  // namespace fdi::storage
