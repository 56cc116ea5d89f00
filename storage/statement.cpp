#include <SQLiteCpp/SQLiteCpp.h>
#include <sqlite3.h>

#include "storage/database.h"
#include "storage/sqlite_call.h"

namespace fdi::storage {
namespace {

// SQLiteCpp keeps the handle of a statement to itself: find it by its text.
bool Writes(sqlite3* connection, const std::string& sql) {
  for (sqlite3_stmt* s = sqlite3_next_stmt(connection, nullptr); s != nullptr;
       s = sqlite3_next_stmt(connection, s)) {
    if (sqlite3_sql(s) == sql) {
      return sqlite3_stmt_readonly(s) == 0;
    }
  }
  return false;
}

}  // namespace

Statement::Statement(Database& database, std::string_view sql)
    : database_(&database) {
  const std::string text(sql);
  SqliteCall(text, [&] {
    statement_ =
        std::make_unique<SQLite::Statement>(*database.connection_, text);
  });
  writes_ = Writes(database.connection_->getHandle(), text);
}

Statement::~Statement() = default;
Statement::Statement(Statement&&) noexcept = default;
Statement& Statement::operator=(Statement&&) noexcept = default;

bool Statement::Step() {
  if (writes_ && !database_->InTransaction()) {
    throw std::logic_error("written outside a transaction: " +
                           statement_->getQuery());
  }
  return SqliteCall(statement_->getQuery(),
                    [this] { return statement_->executeStep(); });
}

void Statement::Run() {
  while (Step()) {
  }
  Reset();
}

void Statement::Reset() {
  // The result of a reset repeats the error of the step before: not an error.
  statement_->tryReset();
}

void Statement::BindNull(int index) {
  SqliteCall(statement_->getQuery(), [&] { statement_->bind(index); });
}

void Statement::BindInt64(int index, std::int64_t value) {
  SqliteCall(statement_->getQuery(), [&] { statement_->bind(index, value); });
}

void Statement::BindDouble(int index, double value) {
  SqliteCall(statement_->getQuery(), [&] { statement_->bind(index, value); });
}

void Statement::BindText(int index, std::string_view value) {
  SqliteCall(statement_->getQuery(),
             [&] { statement_->bind(index, std::string(value)); });
}

void Statement::BindBlob(int index, std::span<const std::byte> value) {
  // A null pointer would bind NULL: an empty blob needs an address.
  const void* data =
      value.empty() ? "" : static_cast<const void*>(value.data());
  SqliteCall(statement_->getQuery(), [&] {
    statement_->bind(index, data, static_cast<int>(value.size()));
  });
}

bool Statement::IsNull(int column) const {
  return statement_->isColumnNull(column);
}

std::int64_t Statement::Int64(int column) const {
  return statement_->getColumn(column).getInt64();
}

double Statement::Double(int column) const {
  return statement_->getColumn(column).getDouble();
}

std::string Statement::Text(int column) const {
  return statement_->getColumn(column).getString();
}

std::vector<std::byte> Statement::Blob(int column) const {
  const SQLite::Column value = statement_->getColumn(column);
  const auto* data = static_cast<const std::byte*>(value.getBlob());
  return data == nullptr
             ? std::vector<std::byte>{}
             : std::vector<std::byte>(data, data + value.getBytes());
}

std::optional<std::int64_t> Statement::OptionalInt64(int column) const {
  return IsNull(column) ? std::nullopt : std::optional(Int64(column));
}

std::optional<double> Statement::OptionalDouble(int column) const {
  return IsNull(column) ? std::nullopt : std::optional(Double(column));
}

std::optional<std::string> Statement::OptionalText(int column) const {
  return IsNull(column) ? std::nullopt : std::optional(Text(column));
}

int Statement::ColumnCount() const {
  return statement_->getColumnCount();
}

std::string Statement::ColumnName(int column) const {
  return statement_->getColumnName(column);
}

}  // namespace fdi::storage
