#include "base/toml_limits.h"

#include <algorithm>

#include "base/error.h"

namespace fdi {

// Outside of text and comments,
//
//     parts = dots since the last of  = , { } [ ] LF
//     nesting = open { and [
void CheckTomlLimits(std::string_view text, const std::string& name) {
  constexpr int kMaxParts = 16;
  constexpr int kMaxNesting = 32;
  int line = 1;
  const auto refuse = [&](const std::string& what) {
    throw ConfigError(name + ':' + std::to_string(line) + ": " + what);
  };
  if (text.size() > kMaxTomlBytes) {
    refuse("the file has more than 16 MiB; accepted are smaller ones");
  }
  int parts = 1;
  int nesting = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (c == '#') {
      i = std::min(text.find('\n', i), text.size()) - 1;
    } else if (c == '"' || c == '\'') {
      const std::string_view rest = text.substr(i);
      const std::string quote(
          rest.size() > 2 && rest[1] == c && rest[2] == c ? 3 : 1, c);
      // To the closing quote; in a text between " a backslash escapes it.
      for (i += quote.size();
           i < text.size() && !text.substr(i).starts_with(quote) &&
           (quote.size() == 3 || text[i] != '\n');
           ++i) {
        line += text[i] == '\n' ? 1 : 0;
        i += c == '"' && text[i] == '\\' ? 1U : 0U;
      }
      i += quote.size() - 1;
    } else if (c == '.') {
      if (++parts > kMaxParts) {
        refuse("a key has more than " + std::to_string(kMaxParts) + " parts");
      }
    } else if (std::string_view("=,{}[]\n").find(c) != std::string_view::npos) {
      parts = 1;
      line += c == '\n' ? 1 : 0;
      nesting += c == '{' || c == '[' ? 1 : c == '}' || c == ']' ? -1 : 0;
      if (nesting > kMaxNesting) {
        refuse("values are nested more than " + std::to_string(kMaxNesting) +
               " deep");
      }
    }
  }
}

}  // namespace fdi
