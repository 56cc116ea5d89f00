#pragma once

#include <string>

#include "cli/json_output.h"

namespace fdi::cli {

/// JSON as text; of one line if `indent` is negative. NaN and infinity become
/// null, bytes that are not UTF-8 the replacement character; the controls that
/// JSON allows (DEL, C1) are escaped like the others.
std::string JsonText(const Json& json, int indent = -1);

}  // namespace fdi::cli
