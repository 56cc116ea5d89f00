#pragma once

#include <string>
#include <vector>

namespace fdi {

/// Splits a comma-separated list; empty for empty text.
std::vector<std::string> PartitionNames(const std::string& text);

/// The same for the argument of --partition: at most 8 names of 1 to 30
/// letters, digits and -_./
/// @param patterns also accept fnmatch() patterns with *?[]!
/// @throws ConfigError naming what is accepted.
std::vector<std::string> ParsePartitions(const std::string& text,
                                         bool patterns);

}  // namespace fdi
