#include "report/live_screen.h"

#include <cerrno>
#include <iostream>
#include <string>
#include <system_error>

#include <sys/ioctl.h>
#include <unistd.h>

namespace fdi::report {
namespace {

// Escape codes of ECMA-48 and xterm, which all current terminals understand:
// the other screen, no cursor, no wrapping.
constexpr std::string_view kEnter = "\x1b[?1049h\x1b[?25l\x1b[?7l";
constexpr std::string_view kLeave = "\x1b[0m\x1b[?7h\x1b[?25h\x1b[?1049l";
constexpr std::string_view kHome = "\x1b[H";
constexpr std::string_view kNextLine = "\x1b[0m\x1b[K\n";
constexpr std::string_view kEndOfScreen = "\x1b[J";

}  // namespace

LiveScreen::LiveScreen() {
  if (isatty(STDOUT_FILENO) == 0) {
    throw std::system_error(errno, std::generic_category(), "terminal");
  }
  std::cout << kEnter << std::flush;
}

LiveScreen::~LiveScreen() {
  std::cout << kLeave << std::flush;
}

std::size_t LiveScreen::height() const {
  winsize size{};
  const bool known =
      ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_row > 0;
  return known ? size.ws_row : 24;
}

void LiveScreen::Draw(std::string_view text) const {
  std::string screen(kHome);
  for (const char c : text) {
    screen += c == '\n' ? kNextLine : std::string_view(&c, 1);
  }
  std::cout << screen << kEndOfScreen << std::flush;
}

}  // namespace fdi::report
