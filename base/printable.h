#pragma once

#include <cstddef>
#include <cstdio>
#include <string>
#include <string_view>

namespace fdi {

/// Bytes of the id of a valve, a set, an observer, as in idl/fdi_v1.idl.
inline constexpr std::size_t kMaxIdLength = 64;

/// Length of the printable UTF-8 character of `text` at `place`, 1 to 4 bytes.
/// 0 for a control character (C0, DEL, C1, which control the terminal) and for
/// invalid UTF-8.
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
  // C1, longer forms than needed, surrogates, beyond U+10FFFF.
  const unsigned second = byte(1);
  const bool bad =
      (first == 0xc2 && second < 0xa0) || (first == 0xe0 && second < 0xa0) ||
      (first == 0xed && second >= 0xa0) || (first == 0xf0 && second < 0x90) ||
      (first == 0xf4 && second >= 0x90) || first > 0xf4;
  return bad ? 0 : size;
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

/// Sanitises external text for a terminal or a log: bytes that are not part of
/// a printable character are written as \xNN.
/// @param kept control characters that are kept, e.g. "\n".
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

/// The value of a log field, `key=VALUE`, sanitised in the same way, and quoted
/// if a script that splits at blanks would misread it.
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
