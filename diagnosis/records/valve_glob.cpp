#include "diagnosis/records/valve_glob.h"

#include <algorithm>
#include <cstddef>
#include <tuple>
#include <utility>

#include "base/printable.h"

namespace fdi {
namespace {

// True if the front of `glob`, which is no *, matches the first character of
// `text`; removes both.
bool TakeMatch(std::string_view& glob, std::string_view& text) {
  const std::string_view character = TakeCharacter(text);
  const std::string_view pattern = TakeCharacter(glob);
  if (pattern != "[") {
    return pattern == "?" || pattern == character;
  }
  // Texts are compared byte by byte, which in UTF-8 is the order of characters.
  bool found = false;
  const auto negated =
      TakeGlobSet(glob, [&](std::string_view low, std::string_view high) {
        found = found || (low <= character && character <= high);
      });
  return negated && found != *negated;
}

}  // namespace

std::string_view TakeCharacter(std::string_view& text) {
  const std::size_t size = std::max<std::size_t>(1, LetterSize(text, 0));
  const std::string_view character = text.substr(0, size);
  text.remove_prefix(size);
  return character;
}

std::string GlobOf(std::string_view valve_id) {
  std::string glob;
  for (const char c : valve_id) {
    const bool special = c == '*' || c == '?' || c == '[';
    glob += special ? std::string{'[', c, ']'} : std::string(1, c);
  }
  return glob;
}

bool GlobMatches(std::string_view glob, std::string_view text) {
  // The pattern behind the last *, and the text that it was compared with. If
  // it does not match there, it is tried one character later.
  std::optional<std::pair<std::string_view, std::string_view>> star;
  while (!glob.empty() || !text.empty()) {
    if (glob.starts_with('*')) {
      glob.remove_prefix(1);
      if (glob.empty()) {
        return true;
      }
      star = {glob, text};
    } else if (glob.empty() || text.empty() || !TakeMatch(glob, text)) {
      if (!star || star->second.empty()) {
        return false;
      }
      TakeCharacter(star->second);
      std::tie(glob, text) = *star;
    }
  }
  return true;
}

}  // namespace fdi
