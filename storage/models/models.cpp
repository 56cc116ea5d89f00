#include "storage/models/models.h"

#include <cerrno>
#include <cstring>
#include <fstream>
#include <iterator>

#include "base/error.h"
#include "base/text.h"
#include "base/time_text.h"
#include "diagnosis/model/fault_catalogue.h"
#include "storage/database/record.h"
#include "storage/models/model_codec.h"
#include "storage/models/sql.h"

// The model sets of ModelStore. A set is one BLOB of model_codec.h; only that
// is loaded. The rows of its observers, channels and runs just show in SQL what
// is in it. Valves and types are in valves.cpp, the loops of a plant in
// plant_loops.cpp.
namespace fdi::storage {
namespace sql = models_sql;
namespace {

constexpr std::uintmax_t kMaxFileBytes = std::uintmax_t{64} << 20U;

// A name needs no quotes in a shell, a file name or NAME@VERSION.
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
  // These rows only show in SQL what is in the bytes; Load() does not read
  // them.
  Statement observer = database.Prepare(sql::insert_observer);
  Statement channel = database.Prepare(sql::insert_channel);
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
  Statement run = database.Prepare(sql::insert_training_run);
  for (std::size_t i = 0; i < models.training_runs.size(); ++i) {
    run.Bind(id, i, models.training_runs[i]).Run();
  }
}

ModelSummary ReadSummary(const Statement& row) {
  ModelSummary summary;
  std::string hash;
  row.Read(0, summary.name, summary.version, hash, summary.created_ns,
           summary.active, summary.preset, summary.software, summary.period_s,
           summary.flow_unit, summary.observers, summary.training_runs,
           summary.bytes, summary.lowest_vaf, summary.greatest_mse,
           summary.greatest_bias);
  summary.content_hash = ParseWhole<std::uint64_t>(hash, 16).value_or(0);
  return summary;
}

// The parent is kept by name, version and hash, not by a reference to its row:
// it need not be in this store.
void InsertLineage(Database& database, std::int64_t model_set_id,
                   const Lineage& lineage) {
  const auto& parent = lineage.parent;
  database.Run(
      sql::insert_lineage, model_set_id, lineage.settings,
      parent ? std::optional(parent->name) : std::nullopt,
      parent ? std::optional(parent->version) : std::nullopt,
      parent ? std::optional(Hex16(parent->content_hash)) : std::nullopt);
  Statement episode = database.Prepare(sql::insert_training_episode);
  for (const TrainingEpisode& e : lineage.episodes) {
    episode
        .Bind(model_set_id, e.episode_id, e.valve_id, e.label, e.labelled_by,
              e.labelled_ns, FaultName(e.fault), e.strength, e.run, e.samples)
        .Run();
  }
}

Lineage ReadLineage(Database& database, std::int64_t model_set_id) {
  Lineage lineage;
  Statement row = database.Prepare(sql::lineage);
  if (row.Bind(model_set_id).Step()) {
    lineage.settings = row.Text(0);
    if (const auto name = row.OptionalText(1)) {
      lineage.parent =
          ParentSet{*name, row.Int(2),
                    ParseWhole<std::uint64_t>(row.Text(3), 16).value_or(0)};
    }
  }
  Statement rows = database.Prepare(sql::training_episodes);
  rows.Bind(model_set_id);
  while (rows.Step()) {
    TrainingEpisode& e = lineage.episodes.emplace_back();
    std::string fault;
    rows.Read(0, e.episode_id, e.valve_id, e.label, e.labelled_by,
              e.labelled_ns, fault, e.strength, e.run, e.samples);
    // Fault 0 is stored as "normal", which is not the name of a fault.
    if (fault != FaultName(0)) {
      const std::optional<int> known = ParseFault(fault);
      if (!known) {
        throw DataError("training episode " + e.episode_id +
                        ": no fault is called " + fault);
      }
      e.fault = *known;
    }
  }
  return lineage;
}

}  // namespace

ModelReference ParseModelReference(std::string_view text) {
  ModelReference reference;
  const std::size_t at = text.find('@');
  reference.name = std::string(text.substr(0, at));
  bool good = IsName(reference.name);
  if (at != std::string_view::npos) {
    reference.version = ParseWhole<int>(text.substr(at + 1));
    good = good && reference.version.value_or(0) >= 1;
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

const Schema& ModelsSchema() {
  static const Schema schema{
      "model",
      0x4644496D,  // "FDIm"
      Synchronous::kFull,
      {sql::kMigrations.begin(), sql::kMigrations.end()},
      sql::kBaseline,
      "make its model sets anew from stored runs, with `fdi-trainer train` or "
      "`fdi-trainer onboard`"};
  return schema;
}

ModelStore::ModelStore(const std::filesystem::path& path, Access access)
    : database_(path, ModelsSchema(), access) {}

ModelSet ModelStore::Save(const ModelSet& models, Activation activation,
                          const Lineage& lineage) {
  Transaction transaction(database_);
  ModelSet saved = Insert(models, activation, lineage);
  transaction.Commit();
  return saved;
}

ModelSet ModelStore::Insert(const ModelSet& models, Activation activation,
                            const Lineage& lineage) {
  Validate(models);
  if (ParseModelReference(models.name).version) {
    throw ConfigError("model set \"" + models.name +
                      "\": expected a name without version; the store numbers "
                      "the versions of a name itself");
  }
  ModelSet saved = models;
  if (saved.created_ns == 0) {
    saved.created_ns = NowNs();
  }
  const std::vector<std::byte> bytes = EncodeModelSet(saved);
  saved.content_hash = ContentHash(saved);
  // Within the transaction, so that no other writer takes the same version.
  saved.version = static_cast<int>(
      database_.QueryInt64(sql::newest_version, saved.name).value_or(0) + 1);
  const bool activate = activation == Activation::kAlways ||
                        !database_.QueryInt64(sql::active_version, saved.name);
  // The version that was active goes first: a unique index admits one active
  // version of a name.
  if (activate) {
    database_.Run(sql::deactivate, saved.name);
  }
  database_.Run(sql::insert_model_set, saved.name, saved.version,
                Hex16(saved.content_hash), saved.created_ns, saved.software,
                saved.preset, saved.sample_period_s,
                FlowUnitName(saved.flow_unit), activate, bytes);
  const std::int64_t id = database_.LastInsertRowid();
  InsertParts(database_, id, saved);
  InsertLineage(database_, id, lineage);
  if (activate) {
    BumpGeneration();
  }
  return saved;
}

ModelSet ModelStore::Load(std::string_view reference) {
  return Load(ParseModelReference(reference));
}

ModelSet ModelStore::Load(const ModelReference& reference) {
  const Snapshot snapshot(database_);
  Statement row = database_.Prepare(sql::model_set);
  row.Bind(RequireId(reference)).Step();
  const std::string where = database_.path().string() + ": model set " +
                            row.Text(0) + "@" + row.Text(1);
  const std::vector<std::byte> bytes = row.Blob(3);
  ModelSet models = DecodeModelSet(bytes, where);
  models.version = row.Int(1);
  // The CRC-32 finds damaged bytes. Hash and name also find intact bytes that
  // belong to another row.
  if (Hex16(models.content_hash) != row.Text(2) || models.name != row.Text(0)) {
    throw DataError(where + " is damaged: its content hash differs");
  }
  Validate(models);
  return models;
}

std::vector<ModelSummary> ModelStore::List() {
  std::vector<ModelSummary> summaries;
  Statement rows = database_.Prepare(std::string(sql::summaries) +
                                     " ORDER BY m.name, m.version");
  while (rows.Step()) {
    summaries.push_back(ReadSummary(rows));
  }
  return summaries;
}

ModelSummary ModelStore::Summary(const ModelReference& reference) {
  const Snapshot snapshot(database_);
  return ReadSummaryOf(reference);
}

ModelSummary ModelStore::ReadSummaryOf(const ModelReference& reference) {
  Statement row = database_.Prepare(std::string(sql::summaries) +
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
    if (const auto newest =
            database_.QueryInt64(sql::newest_version, chosen.name)) {
      chosen.version = static_cast<int>(*newest);
    }
  }
  const std::int64_t id = RequireId(chosen);
  database_.Run(sql::deactivate, chosen.name);
  database_.Run(sql::activate, id);
  // Onboarding has written the version into the entry of its valve, which no
  // person has chosen.
  database_.Run(sql::follow_active, *chosen.version, chosen.name);
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

// The row of a set, or of its active version if none is given. The message of
// the exception lists the stored sets, because the mistake is mostly one of
// spelling.
std::int64_t ModelStore::RequireId(const ModelReference& reference) {
  const auto id = database_.QueryInt64(sql::model_set_id, reference.name,
                                       reference.version);
  if (id) {
    return *id;
  }
  std::string stored;
  Statement names = database_.Prepare(sql::model_set_names);
  while (names.Step()) {
    stored += (stored.empty() ? "" : ", ") + names.Text(0);
  }
  throw NotFoundError("there is no model set " + ToString(reference) + " in " +
                      database_.path().string() +
                      "; stored: " + (stored.empty() ? "none" : stored));
}

void ModelStore::BumpGeneration() {
  database_.Run(sql::bump_generation);
}

}  // namespace fdi::storage
