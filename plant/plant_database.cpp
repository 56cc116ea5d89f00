#include "plant/plant_database.h"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <new>
#include <span>

#include <libpq-fe.h>

#include "plant/sql.h"

namespace fdi::storage {
namespace sql = plant_sql;
namespace {

constexpr int kVersion = static_cast<int>(sql::kMigrations.size());

// libpq's messages have several lines: "ERROR:  no such ...\nDETAIL:  ...\n".
std::string OneLine(std::string_view text) {
  std::string line;
  for (const char c : text) {
    const char plain = c == '\n' || c == '\t' ? ' ' : c;
    if (plain != ' ' || (!line.empty() && line.back() != ' ')) {
      line += plain;
    }
  }
  while (line.ends_with(' ')) {
    line.pop_back();
  }
  return line;
}

}  // namespace

PlantRows::PlantRows(pg_result* result) : result_(result, PQclear) {}

bool PlantRows::good() const {
  const ExecStatusType status = PQresultStatus(result_.get());
  return status == PGRES_COMMAND_OK || status == PGRES_TUPLES_OK ||
         status == PGRES_COPY_IN;
}

int PlantRows::size() const {
  return PQntuples(result_.get());
}

int PlantRows::columns() const {
  return PQnfields(result_.get());
}

bool PlantRows::IsReal(int column) const {
  constexpr Oid kFloat8 = 701;  // Built in: pg_type.dat.
  return PQftype(result_.get(), column) == kFloat8;
}

std::int64_t PlantRows::changed() const {
  return std::atoll(PQcmdTuples(result_.get()));
}

std::optional<std::string> PlantRows::Text(int row, int column) const {
  if (PQgetisnull(result_.get(), row, column) != 0) {
    return std::nullopt;
  }
  return std::string(PQgetvalue(result_.get(), row, column));
}

std::int64_t PlantRows::Int64(int row, int column) const {
  return std::atoll(PQgetvalue(result_.get(), row, column));
}

std::vector<std::byte> PlantRows::Bytes(int row, int column) const {
  const char* text = PQgetvalue(result_.get(), row, column);
  std::size_t size = 0;
  const std::unique_ptr<unsigned char, void (*)(void*)> bytes(
      PQunescapeBytea(reinterpret_cast<const unsigned char*>(text), &size),
      PQfreemem);
  if (!bytes) {
    throw std::bad_alloc();
  }
  const auto all = std::as_bytes(std::span(bytes.get(), size));
  return {all.begin(), all.end()};
}

// A host that is gone is noticed within half a minute. What the URL says comes
// later in the list, and wins.
PlantDatabase::PlantDatabase(const std::string& url, Unchecked)
    : connection_(nullptr, PQfinish) {
  const std::array<const char*, 7> names = {"connect_timeout",
                                            "keepalives_idle",
                                            "tcp_user_timeout",
                                            "application_name",
                                            "client_encoding",
                                            "dbname",
                                            nullptr};
  const std::array<const char*, 7> values = {
      "10", "15", "30000", "fdi-store", "UTF8", url.c_str(), nullptr};
  connection_.reset(PQconnectdbParams(names.data(), values.data(), 1));
  const auto part = [this](const char* (*get)(const PGconn*)) {
    const char* text = connection_ ? get(connection_.get()) : nullptr;
    return std::string(text == nullptr ? "" : text);
  };
  name_ = part([](const PGconn* c) -> const char* { return PQdb(c); }) +
          " on " +
          part([](const PGconn* c) -> const char* { return PQhost(c); });
  if (PQstatus(connection_.get()) != CONNECTION_OK) {
    // Its message may have the words of a URL that cannot be read, and with
    // them the password.
    if (name_ == " on ") {
      throw PlantError(
          "PostgreSQL: the URL cannot be read; it looks like "
          "postgresql://user@host/database");
    }
    Fail(PQerrorMessage(connection_.get()));
  }
  // libpq writes notices to stderr otherwise.
  PQsetNoticeProcessor(
      connection_.get(), [](void*, const char*) {}, nullptr);
}

PlantDatabase::PlantDatabase(const std::string& url)
    : PlantDatabase(url, Unchecked{}) {
  CheckVersion();
}

PlantDatabase::~PlantDatabase() = default;
PlantDatabase::PlantDatabase(PlantDatabase&&) noexcept = default;

void PlantDatabase::CheckVersion() {
  if (Run(sql::is_there).Text(0, 0) != "t") {
    Fail(
        "has no schema fdi: run `fdi-store ship --init --to URL` as its owner");
  }
  const PlantRows plant = Run(sql::plant);
  plant_id_ = plant.Text(0, 0).value_or("");
  const std::int64_t version = plant.Int64(0, 1);
  if (version != kVersion) {
    const std::string reason =
        "schema fdi has version " + std::to_string(version) +
        ", this program needs " + std::to_string(kVersion) +
        (version < kVersion
             ? ": run `fdi-store ship --init --to URL` as its owner"
             : ": update this program");
    Fail(reason.c_str());
  }
}

PlantDatabase PlantDatabase::Init(const std::string& url) {
  PlantDatabase plant(url, Unchecked{});
  if (plant.Run(sql::encoding).Text(0, 0) != "UTF8") {
    plant.Fail(
        "its encoding is not UTF8: make it with createdb -E UTF8 -T "
        "template0");
  }
  {
    // PostgreSQL rolls back statements that define tables, too.
    PlantTransaction transaction(plant);
    std::int64_t version = 0;
    if (plant.Run(sql::is_there).Text(0, 0) == "t") {
      version = plant.Run(sql::plant).Int64(0, 1);
    }
    for (std::int64_t v = version; v < kVersion; ++v) {
      plant.RunScript(sql::kMigrations[static_cast<std::size_t>(v)]);
    }
    if (version < kVersion) {
      plant.Run(sql::set_version, {std::to_string(kVersion)});
    }
    transaction.Commit();
  }
  plant.CheckVersion();
  return plant;
}

PlantRows PlantDatabase::Run(std::string_view sql,
                             const Parameters& parameters) {
  // Types are not given: PostgreSQL infers that of each parameter from where it
  // stands, or from a cast ($1::bigint).
  std::vector<const char*> values;
  values.reserve(parameters.size());
  for (const auto& parameter : parameters) {
    values.push_back(parameter ? parameter->c_str() : nullptr);
  }
  PlantRows rows(PQexecParams(connection_.get(), std::string(sql).c_str(),
                              static_cast<int>(values.size()), nullptr,
                              values.data(), nullptr, nullptr, 0));
  if (!rows.good()) {
    Fail(PQerrorMessage(connection_.get()));
  }
  return rows;
}

void PlantDatabase::RunScript(std::string_view sql) {
  // PQexecParams() would take one statement only.
  const PlantRows rows(PQexec(connection_.get(), std::string(sql).c_str()));
  if (!rows.good()) {
    Fail(PQerrorMessage(connection_.get()));
  }
}

void PlantDatabase::Copy(const std::string& target, std::string_view bytes) {
  // libpq takes an int for the length, and its buffer grows to hold a piece.
  constexpr std::size_t kPiece = 1 << 20;
  PGconn* c = connection_.get();
  RunScript("COPY " + target + " FROM STDIN (FORMAT binary)");
  while (!bytes.empty()) {
    const std::string_view piece = bytes.substr(0, kPiece);
    if (PQputCopyData(c, piece.data(), static_cast<int>(piece.size())) != 1) {
      Fail(PQerrorMessage(c));
    }
    bytes.remove_prefix(piece.size());
  }
  if (PQputCopyEnd(c, nullptr) != 1) {
    Fail(PQerrorMessage(c));
  }
  // The connection takes no other command before all results are read, and its
  // message is that of the last one: the reason is kept before.
  const bool good = PlantRows(PQgetResult(c)).good();
  const std::string reason = good ? "" : PQerrorMessage(c);
  while (PGresult* rest = PQgetResult(c)) {  // To its end, which is null.
    PQclear(rest);
  }
  if (!good) {
    Fail(reason.c_str());
  }
}

void PlantDatabase::Fail(const char* reason) const {
  throw PlantError("PostgreSQL " + name_ + ": " + OneLine(reason));
}

namespace {

PlantPruned Old(PlantDatabase& plant, std::string_view sql,
                const std::string& before) {
  const PlantRows rows = plant.Run(sql, {before});
  PlantPruned old;
  old.deleted = rows.Int64(0, 0);
  if (old.deleted > 0) {
    old.from_ns = rows.Int64(0, 1);
    old.to_ns = rows.Int64(0, 2);
  }
  return old;
}

}  // namespace

PlantPruned PrunePlantEpisodes(PlantDatabase& plant, std::int64_t before_ns,
                               bool dry_run) {
  const std::string before = std::to_string(before_ns);
  PlantPruned pruned = Old(plant, sql::old_in_plant, before);
  while (!dry_run && plant.Run(sql::prune_plant, {before}).Int64(0, 0) > 0) {
  }
  pruned.kept = plant.Run(sql::protected_in_plant).Int64(0, 0);
  return pruned;
}

PlantPruned PrunePlantHealth(PlantDatabase& plant, std::int64_t before_ns,
                             bool dry_run) {
  const std::string before = std::to_string(before_ns);
  const PlantPruned pruned = Old(plant, sql::old_health_in_plant, before);
  if (!dry_run) {
    plant.Run(sql::prune_health_in_plant, {before});
  }
  return pruned;
}

PlantTransaction::PlantTransaction(PlantDatabase& plant) : plant_(plant) {
  plant_.Run("BEGIN");
}

PlantTransaction::~PlantTransaction() {
  if (open_) {
    try {
      plant_.Run("ROLLBACK");
    } catch (const PlantError&) {
      // It ends with the connection.
    }
  }
}

void PlantTransaction::Commit() {
  // Of a transaction with a failed statement, COMMIT rolls back and reports
  // success. The failed statement has thrown before it gets here.
  plant_.Run("COMMIT");
  open_ = false;
}

}  // namespace fdi::storage
