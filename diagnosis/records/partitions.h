#pragma once

#include <string>
#include <vector>

namespace fdi {

/// What is between the commas of `text`; nothing in an empty one.
std::vector<std::string> PartitionNames(const std::string& text);

/// The same, of what --partition takes: at most 8 of 1 to 30 letters, digits
/// and -_./
/// @param patterns of fnmatch() are accepted, too: with *?[]!
/// @throws ConfigError naming what is accepted.
std::vector<std::string> ParsePartitions(const std::string& text,
                                         bool patterns);

}  // namespace fdi
