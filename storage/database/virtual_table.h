#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <ctime>
#include <exception>
#include <limits>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <tuple>

#include <sqlite3ext.h>

#include "base/time_units.h"

SQLITE_EXTENSION_INIT3

/// The frame of the tables that fdi_samples.so adds to an SQLite that loads it.
/// All calls go to that SQLite, not to the one that our programs link.
namespace fdi::storage::loadable {

inline constexpr auto kEarliest = std::numeric_limits<std::int64_t>::min();
inline constexpr auto kLatest = std::numeric_limits<std::int64_t>::max();

struct Finalize {
  void operator()(sqlite3_stmt* statement) const {
    sqlite3_finalize(statement);
  }
};
using Rows = std::unique_ptr<sqlite3_stmt, Finalize>;

[[noreturn]] inline void Fail(sqlite3* database) {
  throw std::runtime_error(sqlite3_errmsg(database));
}

inline Rows Prepare(sqlite3* database, const std::string& text) {
  sqlite3_stmt* statement = nullptr;
  if (sqlite3_prepare_v2(database, text.c_str(), -1, &statement, nullptr) !=
      SQLITE_OK) {
    Fail(database);
  }
  return Rows(statement);
}

inline bool Step(sqlite3_stmt* statement) {
  const int result = sqlite3_step(statement);
  if (result != SQLITE_ROW && result != SQLITE_DONE) {
    Fail(sqlite3_db_handle(statement));
  }
  return result == SQLITE_ROW;
}

inline std::string Text(sqlite3_stmt* statement, int column) {
  const auto* text =
      reinterpret_cast<const char*>(sqlite3_column_text(statement, column));
  return text == nullptr ? "" : text;
}

inline std::int64_t Pragma(sqlite3* database, const std::string& name) {
  const Rows rows = Prepare(database, "PRAGMA " + name);
  return Step(rows.get()) ? sqlite3_column_int64(rows.get(), 0) : 0;
}

/// The name, quoted and with a dot, of the first database of the connection
/// that is of this kind: the one that was opened, or one that was attached.
/// @param file what such a database is called, "a runs.db".
/// @throws std::runtime_error if there is none, or if it has another version.
inline std::string FindDatabase(sqlite3* database, std::int64_t application_id,
                                int expected, const std::string& file) {
  const Rows rows = Prepare(database, "PRAGMA database_list");
  while (Step(rows.get())) {
    std::string schema = "\"";
    for (const char c : Text(rows.get(), 1)) {
      schema += c == '"' ? "\"\"" : std::string(1, c);
    }
    schema += "\".";
    if (Pragma(database, schema + "application_id") != application_id) {
      continue;
    }
    const std::int64_t version = Pragma(database, schema + "user_version");
    if (version != expected) {
      throw std::runtime_error(
          Text(rows.get(), 2) + " has version " + std::to_string(version) +
          ", this module reads version " + std::to_string(expected) +
          "; fdi-store doctor brings an older file up to date");
    }
    return schema;
  }
  throw std::runtime_error("none of the open databases is " + file);
}

/// "2026-11-20T14:56:11.250Z", as the views of the databases write times, so
/// that the order of the texts is that of the times.
inline std::string UtcText(std::int64_t stamp_ns) {
  const std::int64_t of_second =
      (stamp_ns % kNsPerSecond + kNsPerSecond) % kNsPerSecond;
  const std::time_t seconds = (stamp_ns - of_second) / kNsPerSecond;
  std::tm fields{};
  gmtime_r(&seconds, &fields);
  std::array<char, 40> text{};
  const std::size_t size =
      std::strftime(text.data(), text.size(), "%FT%T", &fields);
  std::snprintf(text.data() + size, text.size() - size, ".%03dZ",
                static_cast<int>(of_second / 1'000'000));
  return text.data();
}

struct Window {
  std::int64_t from{kEarliest};
  std::int64_t to{kLatest};  ///< Included.

  /// Keeps what may satisfy `column OP v`, if v is in [low, high]. SQLite
  /// checks each row again, so bounds may be wider than needed, but never
  /// narrower.
  void Narrow(int op, std::int64_t low, std::int64_t high) {
    if (op != SQLITE_INDEX_CONSTRAINT_LT && op != SQLITE_INDEX_CONSTRAINT_LE) {
      from = std::max(from, low);
    }
    if (op != SQLITE_INDEX_CONSTRAINT_GT && op != SQLITE_INDEX_CONSTRAINT_GE) {
      to = std::min(to, high);
    }
  }
};

/// Narrows to the instants whose text begins with `text`, a day or a second;
/// any others are before or after it as their texts are. Other texts bound
/// nothing.
inline void NarrowByUtc(int op, const std::string& text, Window& window) {
  for (const auto& [format, size, length_s] :
       {std::tuple{"%Y-%m-%dT%H:%M:%S", std::size_t{19}, std::int64_t{1}},
        std::tuple{"%Y-%m-%d", std::size_t{10}, std::int64_t{86'400}}}) {
    std::tm fields{};
    if (strptime(text.c_str(), format, &fields) == nullptr) {
      continue;
    }
    const std::int64_t seconds = timegm(&fields);
    if (std::abs(seconds) < kLatest / kNsPerSecond - 86'400 &&
        UtcText(seconds * kNsPerSecond).compare(0, size, text, 0, size) == 0) {
      window.Narrow(op, seconds * kNsPerSecond,
                    (seconds + length_s) * kNsPerSecond);
      return;
    }
  }
}

inline void ResultText(sqlite3_context* context, std::string_view text) {
  sqlite3_result_text(context, text.data(), static_cast<int>(text.size()),
                      SQLITE_TRANSIENT);
}

struct Table : sqlite3_vtab {
  explicit Table(sqlite3* connection) : sqlite3_vtab{}, database(connection) {}
  sqlite3* database;
};

/// A module whose table is there by its name: without xCreate nothing is
/// written to the file, and without xUpdate the table is read-only.
///
/// `Cursor` derives from sqlite3_vtab_cursor and is made of the connection. It
/// has kName, kTable (the CREATE TABLE of its columns), Narrows(column, op) for
/// the comparisons that choose what is read, Filter(plan, values) with two
/// characters of `plan` for each value ('a' + column and the comparison),
/// Next(), AtEnd(), Result(context, column) and RowId(). SQLite, which is
/// written in C, gets what they throw as an error with the name of the table.
template <typename Cursor>
struct VirtualTable {
  template <typename Call>
  static int Guard(char*& message, Call&& call) {
    try {
      call();
      return SQLITE_OK;
    } catch (const std::exception& error) {
      sqlite3_free(message);
      message = sqlite3_mprintf("%s: %s", Cursor::kName, error.what());
      return SQLITE_ERROR;
    }
  }

  static Cursor& Of(sqlite3_vtab_cursor* cursor) {
    return static_cast<Cursor&>(*cursor);
  }

  static int BestIndex(sqlite3_vtab* table, sqlite3_index_info* info) {
    return Guard(table->zErrMsg, [&] {
      std::string plan;
      info->estimatedCost = 1e9;
      for (int i = 0; i < info->nConstraint; ++i) {
        const auto& [column, op, usable, offset] = info->aConstraint[i];
        if (usable != 0 && Cursor::Narrows(column, op)) {
          plan += {static_cast<char>('a' + column), static_cast<char>(op)};
          info->aConstraintUsage[i].argvIndex =
              static_cast<int>(plan.size()) / 2;
          info->estimatedCost /= 10.0;
        }
      }
      info->idxStr = sqlite3_mprintf("%s", plan.c_str());
      info->needToFreeIdxStr = 1;
    });
  }

  static sqlite3_module Module() {
    sqlite3_module module{};
    module.xConnect = [](sqlite3* database, void* /*data*/, int /*count*/,
                         const char* const* /*arguments*/, sqlite3_vtab** table,
                         char** message) {
      return Guard(*message, [&] {
        if (sqlite3_declare_vtab(database, Cursor::kTable) != SQLITE_OK) {
          Fail(database);
        }
        *table = new Table(database);
      });
    };
    module.xDisconnect = [](sqlite3_vtab* table) {
      delete static_cast<Table*>(table);
      return SQLITE_OK;
    };
    module.xBestIndex = BestIndex;
    module.xOpen = [](sqlite3_vtab* table, sqlite3_vtab_cursor** cursor) {
      return Guard(table->zErrMsg, [&] {
        *cursor = new Cursor(static_cast<Table*>(table)->database);
      });
    };
    module.xClose = [](sqlite3_vtab_cursor* cursor) {
      delete &Of(cursor);
      return SQLITE_OK;
    };
    module.xFilter = [](sqlite3_vtab_cursor* cursor, int /*index*/,
                        const char* plan, int count, sqlite3_value** values) {
      return Guard(cursor->pVtab->zErrMsg, [&] {
        Of(cursor).Filter(plan, {values, static_cast<std::size_t>(count)});
      });
    };
    module.xNext = [](sqlite3_vtab_cursor* cursor) {
      return Guard(cursor->pVtab->zErrMsg, [&] { Of(cursor).Next(); });
    };
    module.xEof = [](sqlite3_vtab_cursor* cursor) {
      return Of(cursor).AtEnd() ? 1 : 0;
    };
    module.xColumn = [](sqlite3_vtab_cursor* cursor, sqlite3_context* context,
                        int column) {
      return Guard(cursor->pVtab->zErrMsg,
                   [&] { Of(cursor).Result(context, column); });
    };
    module.xRowid = [](sqlite3_vtab_cursor* cursor, sqlite3_int64* id) {
      *id = Of(cursor).RowId();
      return SQLITE_OK;
    };
    return module;
  }
};

}  // namespace fdi::storage::loadable
