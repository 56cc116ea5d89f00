#pragma once

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>

namespace fdi {

/// The items of `range` with `separator` between them: "a, b, c".
/// @param text makes the text of an item.
template <typename Range, typename Text = std::identity>
std::string JoinText(const Range& range, std::string_view separator = ", ",
                     const Text& text = {}) {
  std::string joined;
  bool first = true;
  for (const auto& item : range) {
    joined += std::exchange(first, false) ? std::string_view() : separator;
    joined += std::invoke(text, item);
  }
  return joined;
}

/// The letters A to Z in lower case; all other bytes as they are.
inline std::string Lower(std::string_view text) {
  std::string lower(text);
  std::ranges::transform(lower, lower.begin(), [](unsigned char c) {
    return static_cast<char>(std::tolower(c));
  });
  return lower;
}

/// 16 hexadecimal digits, as ids and hashes are shown.
inline std::string Hex16(std::uint64_t value) {
  char text[17];
  std::snprintf(text, sizeof text, "%016llx",
                static_cast<unsigned long long>(value));
  return text;
}

/// Matches `text` against `pattern`, in which each * stands for anything. Goes
/// back to the last star only: O(length of pattern x length of text).
inline bool MatchesStars(std::string_view pattern, std::string_view text) {
  std::size_t p = 0;
  std::size_t t = 0;
  std::optional<std::size_t> star;
  std::size_t resume = 0;
  while (t < text.size()) {
    if (p < pattern.size() && pattern[p] == '*') {
      star = p++;
      resume = t;
    } else if (p < pattern.size() && pattern[p] == text[t]) {
      ++p;
      ++t;
    } else if (star) {
      p = *star + 1;
      t = ++resume;
    } else {
      return false;
    }
  }
  return pattern.find_first_not_of('*', p) == std::string_view::npos;
}

/// The number that `text` is as a whole: no blanks, no leading "+".
/// @param base of an integer.
template <typename Number>
std::optional<Number> ParseWhole(std::string_view text, int base = 10) {
  Number number{};
  const char* const end = text.data() + text.size();
  std::from_chars_result result{};
  if constexpr (std::is_floating_point_v<Number>) {
    result = std::from_chars(text.data(), end, number);
  } else {
    result = std::from_chars(text.data(), end, number, base);
  }
  return result.ec == std::errc() && result.ptr == end ? std::optional(number)
                                                       : std::nullopt;
}

}  // namespace fdi
