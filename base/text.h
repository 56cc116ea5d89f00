#pragma once

#include <algorithm>
#include <cctype>
#include <charconv>
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
