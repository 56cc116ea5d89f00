#pragma once

#include <optional>
#include <string>
#include <vector>

namespace fdi {

/// The candidate that `word` was probably meant to be: at most a third of its
/// letters (at least one) changed, added, omitted or transposed.
std::optional<std::string> Suggest(const std::string& word,
                                   const std::vector<std::string>& candidates);

}  // namespace fdi
