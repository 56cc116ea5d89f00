#pragma once

#include <string>
#include <string_view>
#include <utility>

#include <SQLiteCpp/Exception.h>

#include "storage/database.h"

namespace fdi::storage {

/// Runs `call` and turns what SQLiteCpp throws into a SqliteError that names
/// the operation. For the .cpp files of storage/ alone.
template <typename Call>
auto SqliteCall(std::string_view operation, Call&& call) {
  try {
    return std::forward<Call>(call)();
  } catch (const SQLite::Exception& error) {
    const int extended = error.getExtendedErrorCode();
    throw SqliteError(
        extended > 0 ? extended : error.getErrorCode(),
        std::string(error.what()) + " in: " + std::string(operation));
  }
}

}  // namespace fdi::storage
