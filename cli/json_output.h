#pragma once

#include <ostream>

#include <nlohmann/json.hpp>

namespace fdi::cli {

/// Keys keep their insertion order.
using Json = nlohmann::ordered_json;

/// One object and a newline. NaN and infinity become null, invalid UTF-8 the
/// replacement character.
inline void PrintJson(std::ostream& out, const Json& object) {
  out << object.dump(2, ' ', false, Json::error_handler_t::replace) << '\n';
}

}  // namespace fdi::cli
