#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "storage/alarm.h"
#include "storage/database.h"

namespace fdi::storage {

/// By beginning: those in force at a time, or all there ever were.
std::vector<Shelf> ReadShelves(Database& database,
                               std::optional<std::int64_t> in_force_at_ns = {});

/// @throws NotFoundError
Shelf ReadShelf(Database& database, std::int64_t shelf_id);

/// Stores a new one; within a transaction. @returns its id.
std::int64_t InsertShelf(Database& database, const Shelf& shelf);

/// Ends one that is in force; within a transaction. @throws NotFoundError if
/// there is none, DataError if it is over.
void EndShelf(Database& database, std::int64_t shelf_id, std::int64_t now_ns,
              const std::string& who, const std::string& origin);

}  // namespace fdi::storage
