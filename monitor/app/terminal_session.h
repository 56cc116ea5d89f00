#pragma once

#include <chrono>
#include <cstddef>
#include <optional>
#include <string>

#include <termios.h>

namespace fdi::monitor {

/// A terminal as a program has it that draws whole screens: keys come at once
/// and unseen, the cursor is hidden, and what was on the screen comes back at
/// the end. Ctrl-C stays the signal that it is.
class TerminalSession {
 public:
  enum class Key {
    kCharacter,
    kEnter,
    kEscape,
    kBackspace,
    kUp,
    kDown,
    kPageUp,
    kPageDown,
    kHome,
    kEnd,
    kEndOfInput,
    kOther,
  };
  struct KeyPress {
    Key key{Key::kOther};
    char character{'\0'};  ///< Of kCharacter: printable ASCII.
  };
  struct Size {
    std::size_t columns{80};
    std::size_t rows{24};
  };

  /// @throws std::system_error if standard input or output is no terminal.
  TerminalSession();
  ~TerminalSession();
  TerminalSession(const TerminalSession&) = delete;
  TerminalSession& operator=(const TerminalSession&) = delete;

  /// As it is now.
  Size size() const;
  /// Replaces what is on the screen; lines are separated by newlines.
  void Draw(const std::string& screen);
  /// The next key, if one comes in time.
  std::optional<KeyPress> ReadKey(std::chrono::milliseconds timeout);

 private:
  termios before_{};
};

}  // namespace fdi::monitor
