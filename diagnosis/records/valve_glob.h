#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace fdi {

/// True if `text` matches the shell pattern `glob`: * ? [abc] [a-z] [!abc]
/// [^abc]; no escapes. ? and sets match a character of UTF-8. A ] that begins a
/// set is a member of it; a set without an end matches nothing. The databases
/// use this for GLOB, too.
bool GlobMatches(std::string_view glob, std::string_view text);

/// A pattern that matches only the id of this valve: "V[1]" as a pattern
/// matches "V1" and not itself.
std::string GlobOf(std::string_view valve_id);

/// Removes the first printable character, or else the first byte, from a text
/// that is not empty.
std::string_view TakeCharacter(std::string_view& text);

/// Removes the rest of a set behind its [ from the front of `glob`, and calls
/// visit(low, high) for each range of characters in it.
/// @returns whether the set is negated; nothing if it has no end.
template <typename Visit>
std::optional<bool> TakeGlobSet(std::string_view& glob, Visit visit) {
  const bool negated = glob.starts_with('!') || glob.starts_with('^');
  glob.remove_prefix(negated ? 1 : 0);
  for (bool first = true; !glob.empty(); first = false) {
    if (glob.front() == ']' && !first) {
      glob.remove_prefix(1);
      return negated;
    }
    const std::string_view low = TakeCharacter(glob);
    std::string_view high = low;
    if (glob.size() > 1 && glob[0] == '-' && glob[1] != ']') {
      glob.remove_prefix(1);
      high = TakeCharacter(glob);
    }
    visit(low, high);
  }
  return std::nullopt;
}

}  // namespace fdi
