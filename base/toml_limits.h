#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace fdi {

inline constexpr std::size_t kMaxTomlBytes = 16U << 20U;

/// Limits of every program on TOML before it is parsed. The parser and the
/// destructors of its tree recurse, and a key of many thousand parts, or as
/// many brackets, would overflow the stack.
/// @param name of the file, for messages.
/// @throws ConfigError naming file and line if a key has more than 16 parts, if
///   values are nested more than 32 deep, or if there are more than 16 MiB.
void CheckTomlLimits(std::string_view text, const std::string& name);

}  // namespace fdi
