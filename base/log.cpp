#include "base/log.h"

#include "base/printable.h"

namespace fdi {

std::string EventLine(
    std::string_view event,
    std::initializer_list<std::pair<std::string_view, std::string>> fields) {
  std::string line(event);
  for (const auto& [key, value] : fields) {
    line += ' ';
    line += key;
    line += '=';
    line += LogValue(value);
  }
  return line;
}

}  // namespace fdi
