#include "plant/plant_database.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cstdlib>
#include <new>
#include <span>
#include <utility>

#include <libpq-fe.h>
#include <poll.h>

#include "plant/sql.h"

namespace fdi::storage {
namespace sql = plant_sql;
namespace {

constexpr int kVersion =
    sql::kBaseline + static_cast<int>(sql::kMigrations.size()) - 1;

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

std::string NameOf(const PGconn* c) {
  const char* database = PQdb(c);
  const char* host = PQhost(c);
  return std::string(database == nullptr ? "" : database) + " on " +
         (host == nullptr ? "" : host);
}

}  // namespace

PlantRows::PlantRows(pg_result* result) : result_(result, PQclear) {}

bool PlantRows::IsNull() const {
  return !result_;
}

bool PlantRows::TakesData() const {
  return PQresultStatus(result_.get()) == PGRES_COPY_IN;
}

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

// ---- Waiting. libpq's own calls wait for as long as the server pleases: one
// that is stopped still answers to TCP. So nothing here blocks but poll(), and
// the look-up of a host's name, which has the limits of resolv.conf.

struct PlantDatabase::Wait {
  const char* what;  // "an answer"
  Clock::time_point begin;
  Clock::time_point end;
  bool said{false};
};

PlantDatabase::Wait PlantDatabase::BeginWait(
    const char* what, std::chrono::milliseconds limit) const {
  const auto now = Clock::now();
  const auto end = now + limit;
  return {what, now, finish_by_ ? std::min(end, *finish_by_) : end};
}

// Until the socket is ready for `events` of poll().
void PlantDatabase::WaitFor(Wait& wait, short events) {
  using std::chrono::milliseconds;
  constexpr milliseconds kSlice{100};  // After which a stop is noticed.
  const auto give_up = [&](const std::string& reason) {
    // The server notices at its next write, or by its own limits. It could not
    // be asked to cancel without another wait.
    connection_.reset();
    Fail(reason.c_str());
  };
  while (true) {
    if (limits_.stop.stop_requested()) {
      give_up("given up because the program stops");
    }
    const auto now = Clock::now();
    const auto text = [&wait](Clock::duration time) {
      const auto ms = std::chrono::round<milliseconds>(time).count();
      return std::string(wait.what) + " for " +
             (ms % 1000 == 0 ? std::to_string(ms / 1000) + " s"
                             : std::to_string(ms) + " ms");
    };
    if (now >= wait.end) {
      give_up("timeout expired: waited for " + text(wait.end - wait.begin));
    }
    if (!wait.said && now - wait.begin >= kPlantPatience) {
      wait.said = true;
      if (limits_.log) {
        limits_.log(
            LogLevel::kWarning,
            EventLine(
                "plant_waits",
                {{"reason", "PostgreSQL " + name_ + ": waits for " +
                                text(wait.end - wait.begin) + " at most"}}));
      }
    }
    pollfd socket{PQsocket(connection_.get()), events, 0};
    const auto slice = std::min<Clock::duration>(kSlice, wait.end - now);
    const int ready =
        poll(&socket, 1,
             static_cast<int>(std::chrono::ceil<milliseconds>(slice).count()));
    if (ready > 0) {
      return;
    }
    if (ready < 0 && errno != EINTR) {
      give_up("poll() failed");
    }
  }
}

// Sends what libpq has in its buffer. It has to read meanwhile: the server may
// wait for that before it takes more.
void PlantDatabase::Flush(Wait& wait) {
  int rest = 0;
  while ((rest = PQflush(connection_.get())) == 1) {
    WaitFor(wait, POLLIN | POLLOUT);
    if (PQconsumeInput(connection_.get()) != 1) {
      Fail(PQerrorMessage(connection_.get()));
    }
  }
  if (rest != 0) {
    Fail(PQerrorMessage(connection_.get()));
  }
}

// The next result of what was sent; behind the last one null, which is not
// good.
PlantRows PlantDatabase::TakeResult(Wait& wait) {
  while (PQisBusy(connection_.get()) != 0) {
    WaitFor(wait, POLLIN);
    if (PQconsumeInput(connection_.get()) != 1) {
      break;  // The connection is lost, as the result says without waiting.
    }
  }
  return PlantRows(PQgetResult(connection_.get()));
}

// All of them: the last one. @throws PlantError with the first error; then,
// too, all have been read, without which the connection takes no other command.
PlantRows PlantDatabase::TakeResults(Wait& wait) {
  PlantRows last(nullptr);
  std::optional<std::string> reason;
  while (true) {
    PlantRows result = TakeResult(wait);
    if (result.IsNull()) {
      break;
    }
    if (!result.good() && !reason) {
      reason = PQerrorMessage(connection_.get());
    }
    const bool takes_data = result.TakesData();
    last = std::move(result);
    if (takes_data) {  // Further results follow the data.
      break;
    }
  }
  if (reason) {
    Fail(reason->c_str());
  }
  return last;
}

// A network that is gone is noticed within 10 s. Settings of the URL come later
// in the list, and wins.
void PlantDatabase::Connect(const std::string& url) {
  const std::array<const char*, 9> names = {"keepalives_idle",
                                            "keepalives_interval",
                                            "keepalives_count",
                                            "tcp_user_timeout",
                                            "connect_timeout",
                                            "application_name",
                                            "client_encoding",
                                            "dbname",
                                            nullptr};
  const std::string timeout = std::to_string(
      std::chrono::ceil<std::chrono::seconds>(limits_.connect).count());
  const std::array<const char*, 9> values = {
      "15",        "5",    "3",         "10000", timeout.c_str(),
      "fdi-store", "UTF8", url.c_str(), nullptr};
  connection_.reset(PQconnectStartParams(names.data(), values.data(), 1));
  PGconn* c = connection_.get();
  // connect_timeout is of a single host, and only PQconnectdb() keeps it.
  std::chrono::milliseconds limit = limits_.connect;
  const std::unique_ptr<PQconninfoOption, void (*)(PQconninfoOption*)> options(
      PQconninfo(c), PQconninfoFree);
  std::ptrdiff_t hosts = 1;
  for (const auto* o = options.get(); o != nullptr && o->keyword; ++o) {
    const std::string_view text = o->val == nullptr ? "" : o->val;
    if (o->keyword == std::string_view("connect_timeout")) {
      int seconds = 0;
      std::from_chars(text.data(), text.data() + text.size(), seconds);
      if (seconds > 0) {
        limit = std::min<std::chrono::milliseconds>(
            limit, std::chrono::seconds(seconds));
      }
    } else if (o->keyword == std::string_view("host")) {
      hosts += std::ranges::count(text, ',');
    }
  }
  name_ = NameOf(c);
  Wait wait = BeginWait("a connection", hosts * limit);
  PostgresPollingStatusType status = PGRES_POLLING_WRITING;
  while (PQstatus(c) != CONNECTION_BAD &&
         (status == PGRES_POLLING_WRITING || status == PGRES_POLLING_READING)) {
    WaitFor(wait, status == PGRES_POLLING_WRITING ? POLLOUT : POLLIN);
    status = PQconnectPoll(c);
    name_ = NameOf(c);  // The present one of several hosts.
  }
}

PlantDatabase::PlantDatabase(const std::string& url, PlantLimits limits,
                             Unchecked)
    : limits_(std::move(limits)), connection_(nullptr, PQfinish) {
  Connect(url);
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
  PQsetnonblocking(connection_.get(), 1);
}

PlantDatabase::PlantDatabase(const std::string& url, PlantLimits limits)
    : PlantDatabase(url, std::move(limits), Unchecked{}) {
  CheckVersion();
}

PlantDatabase::~PlantDatabase() = default;
PlantDatabase::PlantDatabase(PlantDatabase&&) noexcept = default;

void PlantDatabase::CheckVersion() {
  if (Run(sql::is_there).Text(0, 0) != "t") {
    Fail(
        "has no schema fdi: run `fdi-store ship --init --db URL` as its owner");
  }
  const PlantRows plant = Run(sql::plant);
  plant_id_ = plant.Text(0, 0).value_or("");
  const std::int64_t version = plant.Int64(0, 1);
  if (version != kVersion) {
    const std::string reason =
        "schema fdi has version " + std::to_string(version) +
        ", this program needs " + std::to_string(kVersion) +
        (version < sql::kBaseline
             ? ": it was never released, make another database and ship to it"
         : version < kVersion
             ? ": run `fdi-store ship --init --db URL` as its owner"
             : ": update this program");
    Fail(reason.c_str());
  }
}

PlantDatabase PlantDatabase::Init(const std::string& url, PlantLimits limits) {
  PlantDatabase plant(url, std::move(limits), Unchecked{});
  if (plant.Run(sql::encoding).Text(0, 0) != "UTF8") {
    plant.Fail(
        "its encoding is not UTF8: make it with createdb -E UTF8 -T "
        "template0");
  }
  {
    // PostgreSQL rolls back statements that define tables, too.
    PlantTransaction transaction(plant);
    std::int64_t next = sql::kBaseline;
    if (plant.Run(sql::is_there).Text(0, 0) == "t") {
      next = plant.Run(sql::plant).Int64(0, 1) + 1;
      if (next <= sql::kBaseline) {
        plant.CheckVersion();  // Refuses it.
      }
    }
    for (std::int64_t v = next; v <= kVersion; ++v) {
      plant.RunScript(
          sql::kMigrations[static_cast<std::size_t>(v - sql::kBaseline)]);
    }
    if (next <= kVersion) {
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
  Wait wait = BeginWait("an answer", limits_.statement);
  if (PQsendQueryParams(connection_.get(), std::string(sql).c_str(),
                        static_cast<int>(values.size()), nullptr, values.data(),
                        nullptr, nullptr, 0) != 1) {
    Fail(PQerrorMessage(connection_.get()));
  }
  Flush(wait);
  return TakeResults(wait);
}

PlantRows PlantDatabase::Read(std::string_view sql,
                              const Parameters& parameters) {
  PlantTransaction transaction(*this, PlantTransaction::Kind::kReading);
  PlantRows rows = Run(sql, parameters);
  transaction.Commit();
  return rows;
}

void PlantDatabase::RunScript(std::string_view sql) {
  // PQsendQueryParams() would take one statement only.
  Wait wait = BeginWait("an answer", limits_.statement);
  if (PQsendQuery(connection_.get(), std::string(sql).c_str()) != 1) {
    Fail(PQerrorMessage(connection_.get()));
  }
  Flush(wait);
  TakeResults(wait);
}

void PlantDatabase::Copy(const std::string& target, std::string_view bytes) {
  // libpq takes an int for the length, and its buffer grows to hold a piece.
  constexpr std::size_t kPiece = 1 << 20;
  PGconn* c = connection_.get();
  RunScript("COPY " + target + " FROM STDIN (FORMAT binary)");
  Wait wait = BeginWait("an answer", limits_.statement);
  while (!bytes.empty()) {
    const std::string_view piece = bytes.substr(0, kPiece);
    if (PQputCopyData(c, piece.data(), static_cast<int>(piece.size())) != 1) {
      Fail(PQerrorMessage(c));
    }
    Flush(wait);
    bytes.remove_prefix(piece.size());
  }
  if (PQputCopyEnd(c, nullptr) != 1) {
    Fail(PQerrorMessage(c));
  }
  Flush(wait);
  TakeResults(wait);
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

std::int64_t NewestInPlant(PlantDatabase& plant) {
  return plant.Run(sql::newest_in_plant).Int64(0, 0);
}

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

// The server has the same limits, so that it does not go on with what nobody
// waits for, and its message says what was in the way: a lock, say. A program
// that is stopped in a transaction does not hold up the others for ever.
PlantTransaction::PlantTransaction(PlantDatabase& plant, Kind kind)
    : plant_(plant) {
  const auto ms = [](std::chrono::milliseconds limit) {
    return std::to_string(std::max<std::int64_t>(limit.count(), 1));
  };
  const PlantLimits& limits = plant.limits();
  plant_.RunScript(
      std::string(kind == Kind::kReading
                      ? "BEGIN READ ONLY; SET LOCAL search_path = fdi, "
                        "pg_catalog"
                      : "BEGIN; SET LOCAL search_path = pg_catalog") +
      "; SET LOCAL lock_timeout = " + ms(limits.lock) +
      "; SET LOCAL statement_timeout = " + ms(limits.statement * 9 / 10) +
      "; SET LOCAL idle_in_transaction_session_timeout = " +
      ms(std::chrono::minutes(5)));
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
  // If a statement of the transaction has failed, COMMIT rolls back and reports
  // success. The failed statement has thrown before it gets here.
  plant_.Run("COMMIT");
  open_ = false;
}

}  // namespace fdi::storage
