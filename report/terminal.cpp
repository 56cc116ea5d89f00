#include "report/terminal.h"

#include <cstdlib>
#include <string_view>

#include <sys/ioctl.h>
#include <unistd.h>

namespace fdi::report {
namespace {

std::string_view Environment(const char* name) {
  const char* value = std::getenv(name);
  return value == nullptr ? "" : value;
}

// COLUMNS, if set, overrides the terminal, as for `less`.
std::size_t TerminalColumns() {
  const long asked = std::strtol(Environment("COLUMNS").data(), nullptr, 10);
  if (asked > 0) {
    return static_cast<std::size_t>(asked);
  }
  winsize size{};
  return ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) == 0 ? size.ws_col : 0;
}

}  // namespace

TextStyle StdoutStyle() {
  if (isatty(STDOUT_FILENO) == 0) {
    return {};
  }
  const bool colour =
      Environment("NO_COLOR").empty() && Environment("TERM") != "dumb";
  return {colour, TerminalColumns()};
}

}  // namespace fdi::report
