#include "monitor/app/terminal_session.h"

#include <cerrno>
#include <map>
#include <string_view>
#include <system_error>

#include <poll.h>
#include <sys/ioctl.h>
#include <unistd.h>

namespace fdi::monitor {
namespace {

// Alternate screen, no cursor; and back.
constexpr std::string_view kEnter = "\x1b[?1049h\x1b[?25l";
constexpr std::string_view kLeave = "\x1b[0m\x1b[?25h\x1b[?1049l";
constexpr std::string_view kHome = "\x1b[H";
constexpr std::string_view kNextLine = "\x1b[0m\x1b[K\r\n";
constexpr std::string_view kEndOfScreen = "\x1b[0m\x1b[K\x1b[J";
// So long the rest of the code of a key may take.
constexpr int kRestMs = 20;

void WriteAll(std::string_view text) {
  while (!text.empty()) {
    const ssize_t count = write(STDOUT_FILENO, text.data(), text.size());
    if (count < 0 && errno != EINTR) {
      return;  // The terminal is gone; its input says so.
    }
    text.remove_prefix(count > 0 ? static_cast<std::size_t>(count) : 0);
  }
}

bool Readable(int timeout_ms) {
  pollfd input{STDIN_FILENO, POLLIN, 0};
  return poll(&input, 1, timeout_ms) > 0;
}

std::optional<char> ReadByte() {
  char c = '\0';
  return read(STDIN_FILENO, &c, 1) == 1 ? std::optional(c) : std::nullopt;
}

TerminalSession::Key KeyOfCode(const std::string& code) {
  using Key = TerminalSession::Key;
  static const std::map<std::string, Key> keys = {
      {"[A", Key::kUp},   {"OA", Key::kUp},      {"[B", Key::kDown},
      {"OB", Key::kDown}, {"[5~", Key::kPageUp}, {"[6~", Key::kPageDown},
      {"[H", Key::kHome}, {"OH", Key::kHome},    {"[1~", Key::kHome},
      {"[F", Key::kEnd},  {"OF", Key::kEnd},     {"[4~", Key::kEnd}};
  const auto found = keys.find(code);
  return found == keys.end() ? Key::kOther : found->second;
}

// What follows ESC; nothing if it was the key itself.
TerminalSession::Key ReadCode() {
  std::string code;
  while (code.size() < 8 && Readable(kRestMs)) {
    const auto c = ReadByte();
    if (!c) {
      break;
    }
    code += *c;
    const bool opens = code.size() == 1 && (*c == '[' || *c == 'O');
    if (!opens && *c >= '@' && *c <= '~') {
      break;
    }
  }
  return code.empty() ? TerminalSession::Key::kEscape : KeyOfCode(code);
}

}  // namespace

TerminalSession::TerminalSession() {
  if (isatty(STDOUT_FILENO) == 0 || tcgetattr(STDIN_FILENO, &before_) != 0) {
    throw std::system_error(errno, std::generic_category(), "terminal");
  }
  termios keys = before_;
  keys.c_lflag &= ~static_cast<tcflag_t>(ICANON | ECHO);
  keys.c_cc[VMIN] = 1;
  keys.c_cc[VTIME] = 0;
  keys.c_cc[VSUSP] = _POSIX_VDISABLE;  // It would leave the screen as it is.
  tcsetattr(STDIN_FILENO, TCSAFLUSH, &keys);
  WriteAll(kEnter);
}

TerminalSession::~TerminalSession() {
  WriteAll(kLeave);
  tcsetattr(STDIN_FILENO, TCSAFLUSH, &before_);
}

TerminalSession::Size TerminalSession::size() const {
  winsize size{};
  if (ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) != 0 || size.ws_col == 0 ||
      size.ws_row == 0) {
    return {};
  }
  return {size.ws_col, size.ws_row};
}

void TerminalSession::Draw(const std::string& screen) {
  std::string text(kHome);
  for (const char c : screen) {
    if (c == '\n') {
      text += kNextLine;
    } else {
      text += c;
    }
  }
  WriteAll(text + std::string(kEndOfScreen));
}

std::optional<TerminalSession::KeyPress> TerminalSession::ReadKey(
    std::chrono::milliseconds timeout) {
  if (!Readable(static_cast<int>(timeout.count()))) {
    return std::nullopt;
  }
  const auto c = ReadByte();
  if (!c) {
    return errno == EINTR ? std::nullopt
                          : std::optional(KeyPress{Key::kEndOfInput, '\0'});
  }
  switch (*c) {
    case '\x1b':
      return KeyPress{ReadCode(), '\0'};
    case '\r':
    case '\n':
      return KeyPress{Key::kEnter, '\0'};
    case '\x7f':
    case '\b':
      return KeyPress{Key::kBackspace, '\0'};
    case '\x04':
      return KeyPress{Key::kEndOfInput, '\0'};
    default:
      return *c >= ' ' && *c < '\x7f' ? KeyPress{Key::kCharacter, *c}
                                      : KeyPress{Key::kOther, '\0'};
  }
}

}  // namespace fdi::monitor
