#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "base/csv_cells.h"
#include "base/error.h"
#include "base/text.h"
#include "base/time_text.h"
#include "storage/database/record.h"
#include "storage/models/models.h"
#include "storage/models/sql.h"

// The valves of ModelStore: entries, epochs, baselines and valve types.
namespace fdi::storage {

template <>
struct EnumText<ValveEventKind> {
  static constexpr auto name = ValveEventKindName;
  static constexpr auto last = ValveEventKind::kOrdered;
};

namespace sql = models_sql;
namespace {

std::string Select(std::string_view rest) {
  return std::string(sql::valves) + " " + std::string(rest) +
         " ORDER BY valve_entry_id";
}

std::string_view SenseName(Sense sense) {
  return sense == Sense::kOpening ? "opening" : "closing";
}

ValveEntry ReadEntry(const Statement& row) {
  ValveEntry entry;
  std::string sense;
  std::optional<std::string> set;
  std::optional<int> version;
  row.Read(0, entry.pattern, entry.type, entry.flow_unit, sense, entry.signals,
           entry.period_s, entry.epoch, entry.baseline_epoch, set, version);
  entry.sense = sense == "opening" ? Sense::kOpening : Sense::kClosing;
  if (set) {
    entry.model_set = ModelReference{*set, version};
  }
  return entry;
}

std::optional<std::string> NameOf(const std::optional<ModelReference>& set) {
  return set ? std::optional(set->name) : std::nullopt;
}

std::optional<int> VersionOf(const std::optional<ModelReference>& set) {
  return set ? set->version : std::nullopt;
}

constexpr std::array<std::string_view, 3> kStateNames = {"none", "provisional",
                                                         "valid"};
constexpr std::array<std::string_view, 4> kKindNames = {
    "replaced", "repacked", "recalibrated", "ordered"};

// The figures of a baseline are JSON in two columns, so that SQL can read them
// (queries.sql, json_numbers). storage/ has no library for JSON, and these few
// lines write all that a baseline needs. Control characters are left out
// instead of escaped; UTF-8 stays as it is.
std::string JsonText(std::string_view text) {
  std::string quoted = "\"";
  for (const char c : text) {
    if (static_cast<unsigned char>(c) >= 0x20) {
      quoted += c == '"' || c == '\\' ? std::string{'\\', c} : std::string{c};
    }
  }
  return quoted + '"';
}

// JSON has no infinities; `null` reads back as NaN.
std::string JsonNumber(double value) {
  return std::isfinite(value) ? NumberText(value) : "null";
}

std::string JsonOf(
    const std::vector<std::pair<std::string, double>>& parameters) {
  std::string text = "{";
  for (const auto& [name, value] : parameters) {
    text += (text.size() > 1 ? ", " : "") + JsonText(name) + ": " +
            JsonNumber(value);
  }
  return text + '}';
}

std::string JsonOf(const std::vector<ChannelFigures>& channels) {
  std::string text = "[";
  for (const ChannelFigures& c : channels) {
    text += (text.size() > 1 ? ", {\"name\": " : "{\"name\": ") +
            JsonText(c.name) + ", \"rmse\": " + JsonNumber(c.rmse) +
            ", \"bias\": " + JsonNumber(c.bias) +
            ", \"vaf\": " + JsonNumber(c.vaf) + '}';
  }
  return text + ']';
}

void InsertBaseline(Database& database, std::string_view pattern,
                    const BaselineRecord& record) {
  database.Run(sql::insert_baseline, pattern, record.epoch, record.model_set,
               record.version, record.created_ns, record.hours,
               JsonOf(record.parameters), JsonOf(record.channels));
}

void InsertEvent(Database& database, std::string_view pattern,
                 const ValveEvent& event) {
  database.Run(sql::insert_valve_event, pattern, event.epoch, event.kind,
               event.note, event.at_ns, event.who, event.order,
               event.expected_ns);
}

double NumberOf(const Statement& row, int column) {
  return row.OptionalDouble(column).value_or(std::nan(""));
}

void ReadParts(Database& database, const std::string& parameters,
               const std::string& channels, BaselineRecord& record) {
  Statement pairs = database.Prepare(sql::json_numbers);
  pairs.Bind(parameters);
  while (pairs.Step()) {
    record.parameters.emplace_back(pairs.Text(0), NumberOf(pairs, 1));
  }
  Statement figures = database.Prepare(sql::json_channels);
  figures.Bind(channels);
  while (figures.Step()) {
    record.channels.push_back({figures.Text(0), NumberOf(figures, 1),
                               NumberOf(figures, 2), NumberOf(figures, 3)});
  }
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
  Transaction transaction(database_);
  StoreEntry(entry);
  transaction.Commit();
}

// In the transaction of the caller, as StoreBaseline(), StoreType() and
// StoreLoop(), because transactions do not nest. By the generation a running
// monitor sees that it has to look at its valves again (ChangeCounter).
void ModelStore::StoreEntry(const ValveEntry& entry) {
  if (entry.pattern.empty() || !(entry.period_s > 0.0)) {
    throw ConfigError("valve \"" + entry.pattern +
                      "\": an id or glob and a positive sample period are "
                      "needed");
  }
  if (entry.model_set) {
    RequireId(*entry.model_set);
  }
  database_.Run(sql::put_valve, entry.pattern, entry.type, entry.flow_unit,
                SenseName(entry.sense), entry.signals, entry.period_s,
                entry.epoch, entry.baseline_epoch, NameOf(entry.model_set),
                VersionOf(entry.model_set));
  BumpGeneration();
}

void ModelStore::RemoveValve(std::string_view pattern) {
  Transaction transaction(database_);
  database_.Run("DELETE FROM valve WHERE pattern = ?", pattern);
  const int entries = database_.Changes();
  database_.Run("DELETE FROM plant_loop WHERE name = ?", pattern);
  if (entries + database_.Changes() == 0) {
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

// A new entry takes flow unit and period from the set that it will be judged
// by.
ValveEntry ModelStore::EntryOrNew(
    std::string_view pattern, const std::optional<ModelReference>& reference) {
  Statement row = database_.Prepare(Select("WHERE pattern = ?"));
  if (row.Bind(pattern).Step()) {
    return ReadEntry(row);
  }
  ValveEntry entry;
  entry.pattern = std::string(pattern);
  if (reference) {
    const ModelSummary summary = ReadSummaryOf(*reference);
    entry.flow_unit = summary.flow_unit;
    entry.period_s = summary.period_s;
  }
  return entry;
}

void ModelStore::AssignModelSet(
    std::string_view pattern, const std::optional<ModelReference>& reference) {
  Transaction transaction(database_);
  ValveEntry entry = EntryOrNew(pattern, reference);
  if (entry.model_set != reference) {
    entry.baseline_epoch.reset();
  }
  entry.model_set = reference;
  StoreEntry(entry);
  transaction.Commit();
}

// Entries match in the order of valve_entry_id, which an entry keeps when it is
// replaced. The equality beside GLOB is for ids with brackets: as a glob,
// "V[1]" matches "V1" but not itself.
std::optional<ValveEntry> ModelStore::FindValve(std::string_view valve_id) {
  Statement row =
      database_.Prepare(Select("WHERE pattern = ?1 OR ?1 GLOB pattern"));
  return row.Bind(valve_id).Step() ? std::optional(ReadEntry(row))
                                   : std::nullopt;
}

std::optional<ModelReference> ModelStore::AssignedModelSet(
    std::string_view valve_id) {
  // The entry and the active version of its set are as of one instant.
  const Snapshot snapshot(database_);
  Statement row =
      database_.Prepare(Select("WHERE (pattern = ?1 OR ?1 GLOB pattern)"
                               " AND model_set IS NOT NULL"));
  ModelReference reference{std::string(valve_id), std::nullopt};
  if (row.Bind(valve_id).Step()) {
    reference = *ReadEntry(row).model_set;
  }
  if (!reference.version) {
    const auto active =
        database_.QueryInt64(sql::active_version, reference.name);
    if (!active) {
      return std::nullopt;
    }
    reference.version = static_cast<int>(*active);
  }
  return reference;
}

// The hash of its content is all that a set has in common with its copy in
// another store: each store numbers the versions of a name itself.
std::optional<ModelReference> ModelStore::FindContent(std::uint64_t hash) {
  const std::vector<ModelSummary> sets = List();
  const auto found = std::ranges::find(sets, hash, &ModelSummary::content_hash);
  return found == sets.end()
             ? std::nullopt
             : std::optional(ModelReference{found->name, found->version});
}

ModelReference ModelStore::TakeModelSet(ModelStore& other,
                                        const ModelReference& reference) {
  const ModelSet models = other.Load(reference);
  if (const auto found = FindContent(models.content_hash)) {
    return *found;
  }
  const ModelSet saved =
      Save(models, Activation::kIfFirst, other.LineageOf(reference));
  return {saved.name, saved.version};
}

std::optional<ModelReference> ModelStore::TakeValve(
    ModelStore& other, const std::string& valve_id,
    std::optional<std::uint64_t> in_use) {
  auto assigned = other.AssignedModelSet(valve_id);
  if (!assigned && in_use) {
    assigned = other.FindContent(*in_use);
  }
  const auto theirs = other.FindValve(valve_id);
  const bool of_its_own = theirs && theirs->pattern == valve_id;
  auto ours = AssignedModelSet(valve_id);
  const bool same =
      assigned && ours &&
      other.Summary(*assigned).content_hash == Summary(*ours).content_hash;
  // The valve has this set here already, e.g. by an entry with a glob.
  if (same && !of_its_own) {
    return ours;
  }
  if (!assigned && !of_its_own) {
    return std::nullopt;
  }
  const auto first = FindValve(valve_id);
  // The entry of the valve would stand behind this one and never apply.
  if (!same && first && first->pattern != valve_id) {
    throw ConfigError("valve '" + valve_id + "': the entry '" + first->pattern +
                      "' in " + database_.path().string() +
                      " stands first and gives it " +
                      (ours ? ToString(*ours) : "no model set") +
                      "; remove it, or add one for the valve before it");
  }
  ValveEntry entry = theirs ? *theirs : other.EntryOrNew(valve_id, assigned);
  entry.pattern = valve_id;
  if (assigned) {
    // The assignment names the version, because another version of that name
    // may be active here. The set is stored in a transaction of its own, as
    // transactions do not nest; if the program is stopped after that, a
    // repeated call finds the set by its hash.
    entry.model_set = TakeModelSet(other, *assigned);
  }
  // Baselines and events are copied once, also if the call is repeated.
  const bool has_past =
      !Baselines(valve_id).empty() || !ValveEvents(valve_id).empty();
  Transaction transaction(database_);
  StoreEntry(entry);
  if (of_its_own && !has_past) {
    for (const BaselineRecord& each : other.Baselines(valve_id)) {
      InsertBaseline(database_, valve_id, each);
    }
    for (const ValveEvent& each : other.ValveEvents(valve_id)) {
      InsertEvent(database_, valve_id, each);
    }
  }
  transaction.Commit();
  return entry.model_set;
}

std::int64_t ModelStore::Generation() {
  return database_.QueryInt64("SELECT value FROM generation").value_or(0);
}

ChangeCounter::ChangeCounter(const std::filesystem::path& path)
    : store_(path),
      data_version_(store_.database().DataVersion()),
      generation_(store_.Generation()) {}

bool ChangeCounter::Changed() {
  if (store_.database().Refresh()) {
    data_version_ = -1;
    generation_ = -1;  // No file has it.
  }
  // data_version is read before the generation, here and in the constructor. A
  // commit between the two then costs one needless look at the next call; in
  // the other order it would never be noticed.
  const std::int64_t data_version = store_.database().DataVersion();
  if (data_version == data_version_) {
    return false;
  }
  const std::int64_t generation = store_.Generation();
  // Only now: if the generation could not be read, the next call looks again.
  data_version_ = data_version;
  return std::exchange(generation_, generation) != generation;
}

std::string_view BaselineStateName(BaselineState state) {
  return kStateNames[static_cast<std::size_t>(state)];
}

std::string_view ValveEventKindName(ValveEventKind kind) {
  return kKindNames[static_cast<std::size_t>(kind)];
}

ValveEventKind ParseValveEventKind(std::string_view name) {
  for (std::size_t i = 0; i < kKindNames.size(); ++i) {
    if (name == kKindNames[i]) {
      return static_cast<ValveEventKind>(i);
    }
  }
  throw ConfigError("unknown kind of event '" + std::string(name) +
                    "': expected ordered, replaced, repacked or "
                    "recalibrated");
}

void ModelStore::SetBaseline(std::string_view pattern,
                             const BaselineRecord& record) {
  Transaction transaction(database_);
  StoreBaseline(pattern, record);
  transaction.Commit();
}

// A baseline is of the epoch that the valve is in: figures that were taken
// before somebody worked on it say nothing about the valve of now.
void ModelStore::StoreBaseline(std::string_view pattern,
                               const BaselineRecord& record) {
  const ModelReference reference{record.model_set, record.version};
  ValveEntry entry = EntryOrNew(pattern, reference);
  if (record.epoch != entry.epoch) {
    throw ConfigError("baseline of " + entry.pattern + " is of epoch " +
                      std::to_string(record.epoch) +
                      ": expected the valve's, which is " +
                      std::to_string(entry.epoch));
  }
  entry.model_set = reference;
  entry.baseline_epoch = record.epoch;
  StoreEntry(entry);
  BaselineRecord stored = record;
  stored.created_ns = NowNs();
  InsertBaseline(database_, entry.pattern, stored);
}

std::vector<BaselineRecord> ModelStore::Baselines(std::string_view pattern) {
  std::vector<BaselineRecord> records;
  Statement rows = database_.Prepare(sql::baselines);
  rows.Bind(pattern);
  while (rows.Step()) {
    BaselineRecord& record = records.emplace_back();
    std::string parameters;
    std::string channels;
    rows.Read(0, record.epoch, record.model_set, record.version,
              record.created_ns, record.hours, parameters, channels);
    ReadParts(database_, parameters, channels, record);
  }
  return records;
}

std::optional<ValveEntry> ModelStore::AddValveEvent(std::string_view pattern,
                                                    const ValveEvent& event) {
  Transaction transaction(database_);
  std::optional<ValveEntry> entry;
  if (IsEntry(pattern)) {
    entry = RequireEntry(pattern);
  }
  if (entry && event.kind == ValveEventKind::kReplaced) {
    // Without a baseline, the models are taken to be those of the epoch that
    // ends.
    entry->baseline_epoch = entry->baseline_epoch.value_or(entry->epoch);
    ++entry->epoch;
    StoreEntry(*entry);
  }
  ValveEvent stored = event;
  stored.epoch = entry ? entry->epoch : 0;
  InsertEvent(database_, pattern, stored);
  transaction.Commit();
  return entry;
}

std::vector<std::pair<std::string, ValveEvent>> ModelStore::Repairs() {
  std::vector<std::pair<std::string, ValveEvent>> repairs;
  Statement rows = database_.Prepare(sql::all_valve_events);
  while (rows.Step()) {
    auto& [valves, event] = repairs.emplace_back();
    rows.Read(0, valves, event.epoch, event.kind, event.note, event.at_ns,
              event.who, event.order, event.expected_ns);
  }
  return repairs;
}

std::vector<ValveEvent> ModelStore::ValveEvents(std::string_view pattern) {
  std::vector<ValveEvent> events;
  Statement rows = database_.Prepare(sql::valve_events);
  rows.Bind(pattern);
  while (rows.Step()) {
    ValveEvent& event = events.emplace_back();
    rows.Read(0, event.epoch, event.kind, event.note, event.at_ns, event.who,
              event.order, event.expected_ns);
  }
  return events;
}

void ModelStore::SaveTemplate(const std::string& name,
                              std::span<const std::byte> bytes,
                              const std::string& summary) {
  Transaction transaction(database_);
  StoreType({.name = name,
             .summary = summary,
             .bytes = {bytes.begin(), bytes.end()}});
  transaction.Commit();
}

void ModelStore::StoreType(const ValveType& type) {
  if (ParseModelReference(type.name).version) {
    throw ConfigError("valve type '" + type.name +
                      "': expected a name without @");
  }
  database_.Run(sql::put_valve_type, type.name, NowNs(), type.bytes,
                type.summary);
}

ValveType ModelStore::LoadTemplate(std::string_view name) {
  Statement row = database_.Prepare(sql::valve_type);
  if (!row.Bind(name).Step()) {
    const std::string there = JoinText(ListTemplates(), ", ", &ValveType::name);
    throw NotFoundError("no valve type '" + std::string(name) + "' in " +
                        database_.path().string() +
                        (there.empty() ? "" : "; there are " + there));
  }
  ValveType type;
  row.Read(0, type.name, type.created_ns, type.summary, type.size, type.bytes);
  return type;
}

std::vector<ValveType> ModelStore::ListTemplates() {
  std::vector<ValveType> types;
  Statement rows = database_.Prepare(sql::valve_types);
  while (rows.Step()) {
    ValveType& type = types.emplace_back();
    rows.Read(0, type.name, type.created_ns, type.summary, type.size);
  }
  return types;
}

}  // namespace fdi::storage
