#include "storage/models.h"

#include <cerrno>
#include <charconv>
#include <chrono>
#include <cstring>
#include <fstream>
#include <iterator>

#include "diagnosis/error.h"
#include "storage/model_codec.h"

namespace fdi::storage {
namespace {

constexpr std::uintmax_t kMaxFileBytes = std::uintmax_t{64} << 20U;

bool IsName(std::string_view name) {
  return !name.empty() && name.size() <= 64 &&
         name.find_first_not_of(
             "abcdefghijklmnopqrstuvwxyz"
             "ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789._-") ==
             std::string_view::npos;
}

/// "CV(k) X(k-1)".
std::string RegressorText(const TsModel& model) {
  std::string text;
  for (const Regressor& regressor : model.regressors) {
    if (!text.empty()) {
      text += ' ';
    }
    text += SignalName(regressor.signal);
    text += "(k";
    if (regressor.lag > 0) {
      text += '-';
      text += std::to_string(regressor.lag);
    }
    text += ')';
  }
  return text;
}

std::vector<std::byte> ReadBytes(const std::filesystem::path& path) {
  std::error_code error;
  const std::uintmax_t size = std::filesystem::file_size(path, error);
  if (error || size > kMaxFileBytes) {
    throw DataError("model file " + path.string() + ": " +
                    (error ? error.message() : "larger than 64 MiB"));
  }
  std::ifstream input(path, std::ios::binary);
  std::vector<std::byte> bytes(size);
  if (!input.read(reinterpret_cast<char*>(bytes.data()),
                  static_cast<std::streamsize>(size))) {
    throw DataError("model file " + path.string() +
                    " cannot be read: " + std::strerror(errno));
  }
  return bytes;
}

void InsertParts(Database& database, std::int64_t id, const ModelSet& models) {
  Statement observer =
      database.Prepare("INSERT INTO observer VALUES (?, ?, ?, ?, ?)");
  Statement channel = database.Prepare(
      "INSERT INTO channel VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?)");
  for (std::size_t o = 0; o < models.observers.size(); ++o) {
    const Observer& from = models.observers[o];
    observer.Bind(id, o, from.name, from.fault, from.strength).Run();
    for (std::size_t c = 0; c < from.channels.size(); ++c) {
      const ValidationFigures& v = from.channels[c].validation;
      channel
          .Bind(id, o, c, models.channels[c].name,
                RegressorText(from.channels[c].model),
                from.channels[c].model.rules.size(), v.mse, v.vaf, v.bias,
                v.samples)
          .Run();
    }
  }
  Statement run = database.Prepare("INSERT INTO training_run VALUES (?, ?, ?)");
  for (std::size_t i = 0; i < models.training_runs.size(); ++i) {
    run.Bind(id, i, models.training_runs[i]).Run();
  }
}

constexpr std::string_view kSelectSummary =
    "SELECT m.name, m.version, m.content_hash, m.created_ns, m.active,"
    " m.preset, m.software, m.period_s, m.flow_unit, s.observers,"
    " (SELECT count(*) FROM training_run t"
    "   WHERE t.model_set_id = m.model_set_id), length(m.bytes),"
    " s.lowest_vaf, s.greatest_mse, s.greatest_bias"
    " FROM model_set m JOIN model_summary s"
    " ON s.model_set = m.name AND s.version = m.version";

ModelSummary ReadSummary(const Statement& row) {
  ModelSummary summary;
  summary.name = row.Text(0);
  summary.version = row.Int(1);
  summary.content_hash = HashOfHex(row.Text(2));
  summary.created_ns = row.Int64(3);
  summary.active = row.Bool(4);
  summary.preset = row.Text(5);
  summary.software = row.Text(6);
  summary.period_s = row.Double(7);
  summary.flow_unit = ParseFlowUnit(row.Text(8)).value_or(FlowUnit::kM3PerHour);
  summary.observers = row.Int(9);
  summary.training_runs = row.Int(10);
  summary.bytes = row.Int64(11);
  summary.lowest_vaf = row.Double(12);
  summary.greatest_mse = row.Double(13);
  summary.greatest_bias = row.Double(14);
  return summary;
}

}  // namespace

ModelReference ParseModelReference(std::string_view text) {
  ModelReference reference;
  const std::size_t at = text.find('@');
  reference.name = std::string(text.substr(0, at));
  bool good = IsName(reference.name);
  if (at != std::string_view::npos) {
    const std::string_view digits = text.substr(at + 1);
    int version = 0;
    const auto [end, error] =
        std::from_chars(digits.data(), digits.data() + digits.size(), version);
    good = good && error == std::errc() &&
           end == digits.data() + digits.size() && version >= 1;
    reference.version = version;
  }
  if (!good) {
    throw ConfigError("model set \"" + std::string(text) +
                      "\": accepted are NAME (letters, digits, . _ -; at most "
                      "64) and NAME@VERSION (1, 2, ...)");
  }
  return reference;
}

std::string ToString(const ModelReference& reference) {
  return reference.version
             ? reference.name + "@" + std::to_string(*reference.version)
             : reference.name;
}

ModelStore::ModelStore(const std::filesystem::path& path, Access access)
    : database_(path, ModelsSchema(), access) {}

ModelSet ModelStore::Save(const ModelSet& models, Activation activation,
                          const Lineage& lineage) {
  Validate(models);
  ParseModelReference(models.name);
  ModelSet saved = models;
  if (saved.created_ns == 0) {
    saved.created_ns = std::chrono::duration_cast<std::chrono::nanoseconds>(
                           std::chrono::system_clock::now().time_since_epoch())
                           .count();
  }
  const std::vector<std::byte> bytes = EncodeModelSet(saved);
  saved.content_hash = ContentHash(saved);
  Transaction transaction(database_);
  saved.version =
      static_cast<int>(*database_.QueryInt64(
          "SELECT ifnull(max(version), 0) FROM model_set WHERE name = ?",
          saved.name)) +
      1;
  const bool activate =
      activation == Activation::kAlways ||
      !database_.QueryInt64("SELECT 1 FROM model_set WHERE name = ? AND active",
                            saved.name);
  if (activate) {
    database_.Run("UPDATE model_set SET active = 0 WHERE name = ?", saved.name);
  }
  database_.Run(
      "INSERT INTO model_set (name, version, content_hash, created_ns,"
      " software, preset, period_s, flow_unit, active, bytes)"
      " VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
      saved.name, saved.version, HashHex(saved.content_hash), saved.created_ns,
      saved.software, saved.preset, saved.sample_period_s,
      FlowUnitName(saved.flow_unit), activate, bytes);
  const std::int64_t id = database_.LastInsertRowid();
  InsertParts(database_, id, saved);
  InsertLineage(database_, id, lineage);
  if (activate) {
    BumpGeneration();
  }
  transaction.Commit();
  return saved;
}

ModelSet ModelStore::Load(std::string_view reference) {
  return Load(ParseModelReference(reference));
}

ModelSet ModelStore::Load(const ModelReference& reference) {
  const Snapshot snapshot(database_);
  Statement row = database_.Prepare(
      "SELECT name, version, content_hash, bytes FROM model_set"
      " WHERE model_set_id = ?");
  row.Bind(RequireId(reference)).Step();
  const std::string where = database_.path().string() + ": model set " +
                            row.Text(0) + "@" + row.Text(1);
  const std::vector<std::byte> bytes = row.Blob(3);
  ModelSet models = DecodeModelSet(bytes, where);
  models.version = row.Int(1);
  models.content_hash = ContentHash(models);
  if (HashHex(models.content_hash) != row.Text(2) ||
      models.name != row.Text(0)) {
    throw DataError(where + " is damaged: its content hash differs");
  }
  Validate(models);
  return models;
}

std::vector<ModelSummary> ModelStore::List() {
  std::vector<ModelSummary> summaries;
  Statement rows = database_.Prepare(std::string(kSelectSummary) +
                                     " ORDER BY m.name, m.version");
  while (rows.Step()) {
    summaries.push_back(ReadSummary(rows));
  }
  return summaries;
}

ModelSummary ModelStore::Summary(const ModelReference& reference) {
  const Snapshot snapshot(database_);
  Statement row = database_.Prepare(std::string(kSelectSummary) +
                                    " WHERE m.model_set_id = ?");
  row.Bind(RequireId(reference)).Step();
  return ReadSummary(row);
}

Lineage ModelStore::LineageOf(const ModelReference& reference) {
  const Snapshot snapshot(database_);
  return ReadLineage(database_, RequireId(reference));
}

void ModelStore::Activate(const ModelReference& reference) {
  Transaction transaction(database_);
  ModelReference chosen = reference;
  if (!chosen.version) {
    if (const auto newest = database_.QueryInt64(
            "SELECT max(version) FROM model_set WHERE name = ?", chosen.name)) {
      chosen.version = static_cast<int>(*newest);
    }
  }
  const std::int64_t id = RequireId(chosen);
  database_.Run("UPDATE model_set SET active = 0 WHERE name = ?", chosen.name);
  database_.Run("UPDATE model_set SET active = 1 WHERE model_set_id = ?", id);
  BumpGeneration();
  transaction.Commit();
}

void ModelStore::ExportFile(const ModelReference& reference,
                            const std::filesystem::path& path) {
  if (std::filesystem::exists(path)) {
    throw DataError("model file " + path.string() + " exists already");
  }
  const std::vector<std::byte> bytes = EncodeModelSet(Load(reference));
  std::ofstream output(path, std::ios::binary);
  output.write(reinterpret_cast<const char*>(bytes.data()),
               static_cast<std::streamsize>(bytes.size()));
  if (!output.flush()) {
    throw DataError("model file " + path.string() +
                    " cannot be written: " + std::strerror(errno));
  }
}

ModelSet ModelStore::ImportFile(const std::filesystem::path& path,
                                Activation activation) {
  return Save(DecodeModelSet(ReadBytes(path), "model file " + path.string()),
              activation);
}

std::int64_t ModelStore::RequireId(const ModelReference& reference) {
  const auto id = database_.QueryInt64(
      "SELECT model_set_id FROM model_set WHERE name = ?1 AND"
      " CASE WHEN ?2 IS NULL THEN active ELSE version = ?2 END",
      reference.name, reference.version);
  if (id) {
    return *id;
  }
  std::string stored;
  Statement names = database_.Prepare(
      "SELECT name || '@' || version FROM model_set ORDER BY name, version");
  while (names.Step()) {
    stored += (stored.empty() ? "" : ", ") + names.Text(0);
  }
  throw NotFoundError("there is no model set " + ToString(reference) + " in " +
                      database_.path().string() +
                      "; stored: " + (stored.empty() ? "none" : stored));
}

void ModelStore::BumpGeneration() {
  database_.Run("UPDATE generation SET value = value + 1");
}

}  // namespace fdi::storage
