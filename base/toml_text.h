#pragma once

#include <string>
#include <string_view>

namespace fdi {

/// `text` as a string of TOML, with its quotes and on one line: "f6" for f6.
std::string TomlText(std::string_view text);

}  // namespace fdi
