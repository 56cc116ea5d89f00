#pragma once

#include <string>

#include <nlohmann/json.hpp>

namespace fdi::report {

/// Keys keep their insertion order.
using Json = nlohmann::ordered_json;

/// JSON as text, on one line if `indent` is negative. NaN and infinity become
/// null, invalid UTF-8 the replacement character; control characters that JSON
/// allows (DEL, C1) are escaped, too.
std::string JsonText(const Json& json, int indent = -1);

}  // namespace fdi::report
