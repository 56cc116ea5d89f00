#include "base/toml_text.h"

#include <sstream>

#include <toml++/toml.h>

namespace fdi {

std::string TomlText(std::string_view text) {
  const toml::value<std::string> value{std::string(text)};
  std::ostringstream out;
  // Only the basic form of a string holds any text on one line.
  out << toml::toml_formatter(value, toml::format_flags::allow_unicode_strings);
  return out.str();
}

}  // namespace fdi
