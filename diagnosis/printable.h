#pragma once

#include <cstddef>
#include <cstdio>
#include <string>
#include <string_view>

namespace fdi {

/// Bytes of `text` from `place` on that are one letter of a terminal: 1 to 4 of
/// UTF-8. 0 for a control character (C0, DEL, C1, which move the cursor or
/// command the terminal) and for what is not UTF-8.
inline std::size_t LetterSize(std::string_view text, std::size_t place) {
  const auto byte = [&](std::size_t i) {
    return place + i < text.size()
               ? static_cast<unsigned>(
                     static_cast<unsigned char>(text[place + i]))
               : 0U;
  };
  const unsigned first = byte(0);
  if (first < 0x80) {
    return first >= 0x20 && first != 0x7f ? 1 : 0;
  }
  const std::size_t size = first >= 0xf0   ? 4
                           : first >= 0xe0 ? 3
                           : first >= 0xc2 ? 2
                                           : 0;
  for (std::size_t i = 1; i < size; ++i) {
    if ((byte(i) & 0xc0U) != 0x80) {
      return 0;
    }
  }
  const bool control = first == 0xc2 && byte(1) < 0xa0;
  return control || first > 0xf4 ? 0 : size;
}

inline bool IsPrintable(std::string_view text) {
  for (std::size_t i = 0; i < text.size();) {
    const std::size_t size = LetterSize(text, i);
    if (size == 0) {
      return false;
    }
    i += size;
  }
  return true;
}

/// The one rule for texts from outside that reach a terminal or a log: a byte
/// that is no part of a letter is written as \xNN.
/// @param kept control characters that stay as they are, e.g. "\n".
inline std::string Printable(std::string_view text,
                             std::string_view kept = "") {
  std::string result;
  for (std::size_t i = 0; i < text.size();) {
    const std::size_t size = LetterSize(text, i);
    if (size > 0 || kept.find(text[i]) != std::string_view::npos) {
      result += text.substr(i, size > 0 ? size : 1);
      i += size > 0 ? size : 1;
      continue;
    }
    char escaped[8];
    std::snprintf(escaped, sizeof escaped, "\\x%02x",
                  static_cast<unsigned>(static_cast<unsigned char>(text[i++])));
    result += escaped;
  }
  return result;
}

/// A value of a log line, `key=VALUE`, by the same rule: in quotes if a script
/// that splits at blanks would not see where it ends.
inline std::string LogValue(std::string_view value) {
  if (!value.empty() && value.find_first_of(" \"=") == std::string_view::npos) {
    return Printable(value);
  }
  std::string text;
  for (const char c : value) {
    text += c == '"' || c == '\\' ? "\\" : "";
    text += c;
  }
  return '"' + Printable(text) + '"';
}

}  // namespace fdi
