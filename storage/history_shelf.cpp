#include "storage/history_shelf.h"

#include "diagnosis/error.h"

namespace fdi::storage {
namespace {

constexpr const char* kSelect =
    "SELECT shelf_id, valve_id, fault, from_ns, until_ns, who, comment, "
    "origin, ended_ns, ended_by, ended_origin FROM shelf ";

Shelf ReadRow(const Statement& row) {
  return {row.Int64(0),         row.Text(1), row.OptionalText(2), row.Int64(3),
          row.Int64(4),         row.Text(5), row.Text(6),         row.Text(7),
          row.OptionalInt64(8), row.Text(9), row.Text(10)};
}

}  // namespace

std::vector<Shelf> ReadShelves(Database& database,
                               std::optional<std::int64_t> in_force_at_ns) {
  const std::string where = in_force_at_ns
                                ? "WHERE until_ns > ?1 AND from_ns <= ?1 AND "
                                  "(ended_ns IS NULL OR ended_ns > ?1) "
                                : "";
  Statement row = database.Prepare(kSelect + where + "ORDER BY shelf_id");
  if (in_force_at_ns) {
    row.Bind(*in_force_at_ns);
  }
  std::vector<Shelf> shelves;
  while (row.Step()) {
    shelves.push_back(ReadRow(row));
  }
  return shelves;
}

Shelf ReadShelf(Database& database, std::int64_t shelf_id) {
  Statement row = database.Prepare(std::string(kSelect) + "WHERE shelf_id = ?");
  if (!row.Bind(shelf_id).Step()) {
    throw NotFoundError("no shelved alarm " + std::to_string(shelf_id));
  }
  return ReadRow(row);
}

std::int64_t InsertShelf(Database& database, const Shelf& shelf) {
  database.Run(
      "INSERT INTO shelf (valve_id, fault, from_ns, until_ns, who, comment, "
      "origin) VALUES (?, ?, ?, ?, ?, ?, ?)",
      shelf.valve_id, shelf.fault, shelf.from_ns, shelf.until_ns, shelf.who,
      shelf.comment.empty() ? std::nullopt : std::optional(shelf.comment),
      shelf.origin);
  return database.LastInsertRowid();
}

void EndShelf(Database& database, std::int64_t shelf_id, std::int64_t now_ns,
              const std::string& who, const std::string& origin) {
  const Shelf shelf = ReadShelf(database, shelf_id);
  if (!InForce(shelf, now_ns)) {
    throw DataError("shelved alarm " + std::to_string(shelf_id) + " of " +
                    shelf.valve_id + " is over already");
  }
  database.Run(
      "UPDATE shelf SET ended_ns = ?, ended_by = ?, ended_origin = ? "
      "WHERE shelf_id = ?",
      now_ns, who, origin, shelf_id);
}

}  // namespace fdi::storage
