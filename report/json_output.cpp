#include "report/json_output.h"

#include <cstddef>
#include <cstdio>

namespace fdi::report {

std::string JsonText(const Json& json, int indent) {
  const std::string text =
      json.dump(indent, ' ', false, Json::error_handler_t::replace);
  std::string result;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const auto next =
        static_cast<unsigned char>(i + 1 < text.size() ? text[i + 1] : '\0');
    const bool c1 = text[i] == '\xc2' && next >= 0x80 && next < 0xa0;
    if (!c1 && text[i] != '\x7f') {
      result += text[i];
      continue;
    }
    char escaped[8];
    std::snprintf(escaped, sizeof escaped, "\\u%04x", c1 ? next : 0x7fU);
    result += escaped;
    i += c1 ? 1 : 0;
  }
  return result;
}

}  // namespace fdi::report
