#include <array>
#include <charconv>
#include <chrono>
#include <cmath>

#include "diagnosis/error.h"
#include "storage/models.h"

namespace fdi::storage {
namespace {

constexpr std::array<std::string_view, 3> kStateNames = {"none", "provisional",
                                                         "valid"};
constexpr std::array<std::string_view, 3> kKindNames = {"replaced", "repacked",
                                                        "recalibrated"};

std::int64_t UtcNowNs() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

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
  if (!std::isfinite(value)) {
    return "null";
  }
  std::array<char, 32> digits{};
  const auto end =
      std::to_chars(digits.data(), digits.data() + digits.size(), value).ptr;
  return {digits.data(), end};
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

double NumberOf(const Statement& row, int column) {
  return row.OptionalDouble(column).value_or(std::nan(""));
}

void ReadParts(Database& database, const std::string& parameters,
               const std::string& channels, BaselineRecord& record) {
  Statement pairs =
      database.Prepare("SELECT key, CAST(value AS REAL) FROM json_each(?)");
  pairs.Bind(parameters);
  while (pairs.Step()) {
    record.parameters.emplace_back(pairs.Text(0), NumberOf(pairs, 1));
  }
  Statement figures = database.Prepare(
      "SELECT value ->> 'name', CAST(value ->> 'rmse' AS REAL), "
      "CAST(value ->> 'bias' AS REAL), CAST(value ->> 'vaf' AS REAL) "
      "FROM json_each(?)");
  figures.Bind(channels);
  while (figures.Step()) {
    record.channels.push_back({figures.Text(0), NumberOf(figures, 1),
                               NumberOf(figures, 2), NumberOf(figures, 3)});
  }
}

}  // namespace

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
                    "': expected replaced, repacked or recalibrated");
}

void ModelStore::SetBaseline(std::string_view pattern,
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
  Transaction transaction(database_);
  StoreEntry(entry);
  database_.Run(
      "INSERT INTO baseline (valve, epoch, model_set, version, created_ns, "
      "hours, parameters, channels) VALUES (?, ?, ?, ?, ?, ?, ?, ?)",
      entry.pattern, record.epoch, record.model_set, record.version, UtcNowNs(),
      record.hours, JsonOf(record.parameters), JsonOf(record.channels));
  transaction.Commit();
}

std::vector<BaselineRecord> ModelStore::Baselines(std::string_view pattern) {
  std::vector<BaselineRecord> records;
  Statement rows = database_.Prepare(
      "SELECT epoch, model_set, version, created_ns, hours, parameters, "
      "channels FROM baseline WHERE valve = ? ORDER BY epoch, baseline_id");
  rows.Bind(pattern);
  while (rows.Step()) {
    BaselineRecord& record = records.emplace_back();
    record.epoch = static_cast<std::uint32_t>(rows.Int64(0));
    record.model_set = rows.Text(1);
    record.version = rows.Int(2);
    record.created_ns = rows.Int64(3);
    record.hours = rows.Double(4);
    ReadParts(database_, rows.Text(5), rows.Text(6), record);
  }
  return records;
}

ValveEntry ModelStore::AddValveEvent(std::string_view pattern,
                                     const ValveEvent& event) {
  ValveEntry entry = RequireEntry(pattern);
  // Models that were made some other way are those of the valve until now.
  entry.baseline_epoch = entry.baseline_epoch.value_or(entry.epoch);
  ++entry.epoch;
  Transaction transaction(database_);
  StoreEntry(entry);
  database_.Run(
      "INSERT INTO valve_event (valve, epoch, kind, note, at_ns, who) "
      "VALUES (?, ?, ?, ?, ?, ?)",
      entry.pattern, entry.epoch, ValveEventKindName(event.kind), event.note,
      event.at_ns, event.who);
  transaction.Commit();
  return entry;
}

std::vector<ValveEvent> ModelStore::ValveEvents(std::string_view pattern) {
  std::vector<ValveEvent> events;
  Statement rows = database_.Prepare(
      "SELECT epoch, kind, note, at_ns, who FROM valve_event WHERE valve = ? "
      "ORDER BY epoch, valve_event_id");
  rows.Bind(pattern);
  while (rows.Step()) {
    events.push_back({static_cast<std::uint32_t>(rows.Int64(0)),
                      ParseValveEventKind(rows.Text(1)), rows.Text(2),
                      rows.Int64(3), rows.Text(4)});
  }
  return events;
}

void ModelStore::SaveTemplate(const std::string& name,
                              std::span<const std::byte> bytes,
                              const std::string& summary) {
  if (ParseModelReference(name).version) {
    throw ConfigError("valve type '" + name + "': expected a name without @");
  }
  Transaction transaction(database_);
  database_.Run(
      "INSERT INTO valve_type (name, created_ns, bytes, summary) "
      "VALUES (?, ?, ?, ?) ON CONFLICT (name) DO UPDATE SET "
      "created_ns = excluded.created_ns, bytes = excluded.bytes, "
      "summary = excluded.summary",
      name, UtcNowNs(), bytes, summary);
  transaction.Commit();
}

ValveType ModelStore::LoadTemplate(std::string_view name) {
  Statement row = database_.Prepare(
      "SELECT name, created_ns, summary, bytes FROM valve_type WHERE name = ?");
  if (!row.Bind(name).Step()) {
    std::string there;
    for (const ValveType& type : ListTemplates()) {
      there += (there.empty() ? "" : ", ") + type.name;
    }
    throw NotFoundError("no valve type '" + std::string(name) + "' in " +
                        database_.path().string() +
                        (there.empty() ? "" : "; there are " + there));
  }
  ValveType type{row.Text(0), row.Int64(1), row.Text(2), 0, row.Blob(3)};
  type.size = type.bytes.size();
  return type;
}

std::vector<ValveType> ModelStore::ListTemplates() {
  std::vector<ValveType> types;
  Statement rows = database_.Prepare(
      "SELECT name, created_ns, summary, length(bytes) FROM valve_type "
      "ORDER BY name");
  while (rows.Step()) {
    types.push_back({rows.Text(0),
                     rows.Int64(1),
                     rows.Text(2),
                     static_cast<std::size_t>(rows.Int64(3)),
                     {}});
  }
  return types;
}

void ModelStore::DeleteTemplate(std::string_view name) {
  LoadTemplate(name);  // It must be there.
  Transaction transaction(database_);
  database_.Run("DELETE FROM valve_type WHERE name = ?", name);
  transaction.Commit();
}

}  // namespace fdi::storage
