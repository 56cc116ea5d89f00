#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace fdi::report {

/// The sentence for a verb or an option that has been removed: what replaces
/// it. Nothing for a word that never was one. All of them are in one table,
/// which stays until version 1.0.
/// @param program "fdi-store"
/// @param verb that had the option, or the group that had the verb: "history
///   list"; "" for the program itself.
/// @param name of the option with its dashes, or of the verb.
std::optional<std::string> RemovedWord(std::string_view program,
                                       std::string_view verb,
                                       std::string_view name);

}  // namespace fdi::report
