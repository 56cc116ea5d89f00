#include "diagnosis/records/partitions.h"

#include <algorithm>
#include <sstream>
#include <string_view>

#include "base/error.h"

namespace fdi {

std::vector<std::string> PartitionNames(const std::string& text) {
  std::vector<std::string> names;
  std::istringstream stream(text);
  for (std::string name; std::getline(stream, name, ',');) {
    names.push_back(name);
  }
  return names;
}

std::vector<std::string> ParsePartitions(const std::string& text,
                                         bool patterns) {
  constexpr std::size_t kMaxPartitions = 8;
  constexpr std::size_t kMaxNameLength = 30;
  constexpr std::string_view kPlain =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_./";
  const std::string accepted = std::string(kPlain) + (patterns ? "*?[]!" : "");
  std::vector<std::string> names = PartitionNames(text);
  const bool fit = std::ranges::all_of(names, [&](const std::string& name) {
    return !name.empty() && name.size() <= kMaxNameLength &&
           name.find_first_not_of(accepted) == std::string::npos;
  });
  if (!fit || names.size() > kMaxPartitions) {
    throw ConfigError(
        "--partition is '" + text +
        "', accepted are at most 8 names of 1 to 30 letters, digits and -_./" +
        (patterns ? ", or patterns of them with *?[]!" : "") +
        ", separated by commas");
  }
  return names;
}

}  // namespace fdi
