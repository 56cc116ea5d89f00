#include <algorithm>
#include <cerrno>
#include <chrono>
#include <iostream>
#include <memory>
#include <optional>
#include <string_view>
#include <system_error>

#include <CLI/CLI.hpp>
#include <poll.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

#include "base/error.h"
#include "base/time_text.h"
#include "programs/monitor/top_board.h"
#include "programs/monitor/verbs.h"
#include "report/program.h"
#include "report/stop_signals.h"

namespace fdi::monitor {
namespace {

using Clock = TopBoard::Clock;
using std::chrono::milliseconds;

constexpr milliseconds kRefresh{1000};
constexpr milliseconds kQuiet{1000};  // With --once: after the last new valve.
constexpr milliseconds kSilence{10'000};
constexpr std::size_t kPageKeys = 2;  // A page is half a screen.

struct TopOptions {
  BusOptions bus{.program = "fdi-monitor top"};
  bool once{false};
  double wait_s{5.0};
  std::string filter;
};

// Escape codes of ECMA-48 and xterm, which all current terminals understand.
constexpr std::string_view kEnter = "\x1b[?1049h\x1b[?25l";  // Other screen,
constexpr std::string_view kLeave = "\x1b[0m\x1b[?25h\x1b[?1049l";  // no cursor
constexpr std::string_view kHome = "\x1b[H";
constexpr std::string_view kNextLine = "\x1b[0m\x1b[K\r\n";
constexpr std::string_view kEndOfScreen = "\x1b[0m\x1b[K\x1b[J";
constexpr int kRestOfCodeMs = 20;

/// A terminal in full-screen mode: keys arrive at once and without echo, the
/// cursor is hidden, and the previous screen content is restored at the end.
/// Ctrl-C still sends SIGINT.
class Terminal {
 public:
  /// @throws std::system_error if standard input or output is no terminal.
  Terminal() {
    if (isatty(STDOUT_FILENO) == 0 || tcgetattr(STDIN_FILENO, &before_) != 0) {
      throw std::system_error(errno, std::generic_category(), "terminal");
    }
    termios keys = before_;
    keys.c_lflag &= ~static_cast<tcflag_t>(ICANON | ECHO);
    keys.c_cc[VMIN] = 1;
    keys.c_cc[VTIME] = 0;
    keys.c_cc[VSUSP] = _POSIX_VDISABLE;  // ^Z would leave the screen as it is.
    tcsetattr(STDIN_FILENO, TCSAFLUSH, &keys);
    Write(kEnter);
  }
  ~Terminal() {
    Write(kLeave);
    tcsetattr(STDIN_FILENO, TCSAFLUSH, &before_);
  }
  Terminal(const Terminal&) = delete;
  Terminal& operator=(const Terminal&) = delete;

  winsize size() const {
    winsize size{};
    const bool known = ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) == 0 &&
                       size.ws_col > 0 && size.ws_row > 0;
    return known ? size : winsize{24, 80, 0, 0};
  }

  /// Replaces the screen content; lines are separated by newlines.
  void Draw(std::string_view screen) const {
    std::string text(kHome);
    for (const char c : screen) {
      text += c == '\n' ? kNextLine : std::string_view(&c, 1);
    }
    Write(text.append(kEndOfScreen));
  }

  /// The next key pressed, if any, as terminals send it: "q", "\r", ESC alone
  /// or with its code, "\x1b[A"; "\x04" at end of input.
  std::optional<std::string> ReadKey() const {
    if (!Readable(0)) {
      return std::nullopt;
    }
    std::string key;
    if (!ReadByte(key)) {
      return errno == EINTR ? std::nullopt : std::optional<std::string>("\x04");
    }
    // CODE = ESC ("[" | "O") parameter* final; a final byte is in @..~.
    while (key[0] == '\x1b' && key.size() < 9 && Readable(kRestOfCodeMs) &&
           ReadByte(key)) {
      const bool opens =
          key.size() == 2 && (key.back() == '[' || key.back() == 'O');
      if (!opens && key.back() >= '@' && key.back() <= '~') {
        break;
      }
    }
    return key;
  }

 private:
  static void Write(std::string_view text) {
    while (!text.empty()) {
      const ssize_t count = write(STDOUT_FILENO, text.data(), text.size());
      if (count < 0 && errno != EINTR) {
        return;  // The terminal is gone, which the next read reports.
      }
      text.remove_prefix(count > 0 ? static_cast<std::size_t>(count) : 0);
    }
  }
  static bool Readable(int timeout_ms) {
    pollfd input{STDIN_FILENO, POLLIN, 0};
    return poll(&input, 1, timeout_ms) > 0;
  }
  static bool ReadByte(std::string& text) {
    char c = '\0';
    errno = 0;
    if (read(STDIN_FILENO, &c, 1) != 1) {
      return false;
    }
    text += c;
    return true;
  }

  termios before_{};
};

/// Applies a key to the view. @returns false to quit.
bool OnKey(const std::string& key, std::size_t height, TopView& view) {
  const bool character = key.size() == 1 && key[0] >= ' ' && key[0] <= '~';
  if (key == "\x04") {
    return false;
  }
  if (view.typing) {
    if (character) {
      view.filter += key;
    } else if ((key == "\x7f" || key == "\b") && !view.filter.empty()) {
      view.filter.pop_back();
    } else if (key == "\x1b") {
      view.filter.clear();
    }
    view.typing = key[0] != '\x1b' && key != "\r" && key != "\n";
    view.first = 0;
    return true;
  }
  const std::size_t last = view.rows == 0 ? 0 : view.rows - 1;
  const std::size_t page = std::max<std::size_t>(1, height / kPageKeys);
  const auto any = [&key](std::initializer_list<std::string_view> codes) {
    return std::ranges::find(codes, key) != codes.end();
  };
  if (any({"q", "Q"})) {
    return false;
  }
  if (any({"s", "S"})) {
    view.sort = NextSort(view.sort);
    view.first = 0;
  } else if (key == "/") {
    view.typing = true;
  } else if (any({"\x1b[A", "\x1bOA"})) {
    view.first -= std::min<std::size_t>(view.first, 1);
  } else if (any({"\x1b[B", "\x1bOB"})) {
    view.first = std::min(last, view.first + 1);
  } else if (key == "\x1b[5~") {
    view.first -= std::min(view.first, page);
  } else if (key == "\x1b[6~") {
    view.first = std::min(last, view.first + page);
  } else if (any({"\x1b[H", "\x1bOH", "\x1b[1~"})) {
    view.first = 0;
  } else if (any({"\x1b[F", "\x1bOF", "\x1b[4~"})) {
    view.first = last;
  }
  return true;
}

void Take(BusView& bus, TopBoard& board) {
  bus.Take([&board](const auto& message,
                    const auto&) { board.Add(message, Clock::now()); },
           [&board](const std::string& valve_id) { board.Remove(valve_id); });
}

/// Waits until the monitors' valves have all been heard, and prints them.
int Once(const TopOptions& options, const report::Context& context,
         BusView& bus, TopBoard& board) {
  const report::StopSignals signals;
  const auto start = Clock::now();
  auto newest = start;
  std::size_t valves = 0;
  const std::chrono::duration<double> patience(options.wait_s);
  while (!signals.stop_requested() && Clock::now() - start < patience) {
    Take(bus, board);
    if (board.valves() > valves) {
      valves = board.valves();
      newest = Clock::now();
    }
    const bool heard = valves > 0 && !board.Health(Clock::now()).empty();
    if (heard && Clock::now() - newest > kQuiet) {
      break;
    }
  }
  const report::Report report =
      board.Valves(TopSort::kWorst, options.filter, Clock::now());
  if (report.document["monitor"].is_null() && valves == 0) {
    throw NotFoundError("no monitor is heard on domain " +
                        std::to_string(context.options.domain) +
                        ": is one running there, and on the same --interface?");
  }
  if (context.options.json) {
    report.PrintJson(std::cout);
  } else {
    report.PrintText(std::cout, {report::StdoutStyle(), context.options.utc});
  }
  return report::kExitOk;
}

int Live(const TopOptions& options, const report::Context& context,
         BusView& bus, TopBoard& board) {
  const report::StopSignals signals;
  const bool colour = report::StdoutStyle().colour;
  const Terminal terminal;
  TopView view{.filter = options.filter, .utc = context.options.utc};
  auto drawn = Clock::now() - kRefresh;
  while (!signals.stop_requested()) {
    Take(bus, board);
    const winsize size = terminal.size();
    bool touched = false;
    while (const auto key = terminal.ReadKey()) {
      if (!OnKey(*key, size.ws_row, view)) {
        return report::kExitOk;
      }
      touched = true;
    }
    if (touched || Clock::now() - drawn >= kRefresh) {
      view.now_ns = NowNs();
      drawn = Clock::now();
      terminal.Draw(
          TopScreen(board, view, {colour, size.ws_col}, size.ws_row, drawn));
    }
  }
  return report::kExitOk;
}

int RunTop(const TopOptions& options, const report::Context& context) {
  // Log lines would garble the screen.
  const bool live = !options.once && !context.options.json;
  TopBoard board(report::LoadFaultTexts(context.options), kSilence);
  BusView bus(options.bus, context, live ? LogSink() : context.log);
  return live ? Live(options, context, bus, board)
              : Once(options, context, bus, board);
}

}  // namespace

void AddTopVerb(report::Program& program) {
  auto options = std::make_shared<TopOptions>();
  CLI::App& top = program.AddVerb(
      "top",
      "A live table of valves and decision factors, the worst first, from what "
      "monitors publish",
      [options](const report::Context& context) {
        return RunTop(*options, context);
      });
  top.add_flag("--once", options->once,
               "Print the table once and exit, as --json does");
  top.add_option("--wait", options->wait_s,
                 "With --once: time to wait for a monitor [s]")
      ->check(CLI::Range(0.1, 600.0));
  top.add_option("--valves", options->bus.valves, "Only ids that match GLOB");
  top.add_option("--filter", options->filter,
                 "Only valves with this text in their id, fault, state or "
                 "quality");
  top.add_option("--max-valves", options->bus.max_valves,
                 "Maximum number of valves")
      ->check(CLI::Range(1, 100000));
}

}  // namespace fdi::monitor
