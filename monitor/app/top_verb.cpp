#include <algorithm>
#include <chrono>
#include <iostream>
#include <memory>
#include <optional>

#include <CLI/CLI.hpp>

#include "diagnosis/error.h"
#include "idl/endpoint.h"
#include "monitor/app/dds_options.h"
#include "monitor/app/terminal_session.h"
#include "monitor/app/top_board.h"
#include "monitor/app/top_screen.h"
#include "monitor/app/verbs.h"
#include "monitor/valve_directory.h"
#include "storage/cli/program.h"
#include "storage/cli/stop_signals.h"
#include "storage/cli/time_text.h"

namespace fdi::monitor {
namespace {

using Clock = TopBoard::Clock;
using std::chrono::milliseconds;

constexpr milliseconds kRefresh{1000};
constexpr milliseconds kTakeTimeout{50};
constexpr milliseconds kQuiet{1000};  // With --once: no new valve for so long.
constexpr milliseconds kSilence{10'000};

struct TopOptions {
  bool once{false};
  double wait_s{5.0};
  std::string valves{"*"};
  std::string filter;
  int max_valves{2000};
};

// On a terminal; lines of the log would spoil its screen.
bool IsLive(const TopOptions& options, const cli::Context& context) {
  return !options.once && !context.options.json;
}

/// The table of valves, filled from the bus.
class Top {
 public:
  Top(const TopOptions& options, const cli::Context& context)
      : options_(options),
        context_(context),
        texts_(cli::LoadFaultTexts(context.options)),
        participant_(DdsOptionsOf(context.options, options.max_valves),
                     IsLive(options, context) ? LogSink() : context.log,
                     "fdi-monitor top"),
        models_(participant_),
        events_(participant_),
        status_(participant_),
        decisions_(participant_, idl::Profile::kLive) {
    view_.filter = options.filter;
    view_.utc = context.options.utc;
  }

  /// Waits until all is there that monitors have said; prints it.
  int Once(cli::StopSignals& signals) {
    const auto start = Clock::now();
    auto newest = start;
    std::size_t valves = 0;
    while (!signals.stop_requested() &&
           Clock::now() - start <
               std::chrono::duration<double>(options_.wait_s)) {
      Take();
      if (board_.valves() > valves) {
        valves = board_.valves();
        newest = Clock::now();
      }
      const bool heard = valves > 0 && !board_.Health(Clock::now()).empty();
      if (heard && Clock::now() - newest > kQuiet) {
        break;
      }
    }
    Look();
    if (view_.health.empty() && valves == 0) {
      throw NotFoundError(
          "no monitor is heard on domain " +
          std::to_string(context_.options.domain) +
          ": is one running there, and on the same --interface?");
    }
    if (context_.options.json) {
      cli::PrintJson(std::cout, TopJson(view_, texts_));
    } else {
      std::cout << TopTable(view_, texts_, cli::StdoutStyle());
    }
    return cli::kExitOk;
  }

  int Live(cli::StopSignals& signals) {
    const bool colour = cli::StdoutStyle().colour;
    TerminalSession terminal;
    auto drawn = Clock::now() - kRefresh;
    while (!signals.stop_requested() && !quit_) {
      Take();
      bool touched = false;
      while (const auto key = terminal.ReadKey(milliseconds(0))) {
        OnKey(*key, terminal.size().rows);
        touched = true;
        if (quit_) {
          break;
        }
      }
      if (touched || Clock::now() - drawn >= kRefresh) {
        Look();
        const auto size = terminal.size();
        terminal.Draw(
            TopScreen(view_, texts_, {colour, size.columns}, size.rows));
        drawn = Clock::now();
      }
    }
    return cli::kExitOk;
  }

 private:
  void Take() {
    // The models first: they explain the vectors.
    models_.Take(
        {[this](const auto& message, const auto&) { board_.Learn(message); },
         {}},
        milliseconds(0));
    events_.Take({[this](const auto& message, const auto&) {
                    if (Matches(message.valve_id)) {
                      board_.Update(message);
                    }
                  },
                  {}},
                 milliseconds(0));
    status_.Take({[this](const auto& message, const auto&) {
                    board_.Update(message, Clock::now());
                  },
                  {}},
                 milliseconds(0));
    decisions_.Take({[this](const auto& message, const auto&) {
                       if (Matches(message.valve_id)) {
                         board_.Update(message, Clock::now());
                       }
                     },
                     [this](const auto& message, const auto&) {
                       board_.Remove(message.valve_id);
                     }},
                    kTakeTimeout, 1000);
  }

  bool Matches(const std::string& valve_id) const {
    return options_.valves == "*" || GlobMatches(options_.valves, valve_id);
  }

  void Look() {
    const auto now = Clock::now();
    view_.rows = board_.Rows(view_.sort, view_.filter, now);
    view_.valves = board_.valves();
    view_.health = board_.Health(now);
    view_.now_ns = cli::NowNs();
  }

  void OnKey(const TerminalSession::KeyPress& press, std::size_t height) {
    using Key = TerminalSession::Key;
    if (press.key == Key::kEndOfInput) {
      quit_ = true;
    } else if (view_.typing) {
      Type(press);
    } else if (press.key == Key::kCharacter) {
      Command(press.character);
    } else {
      Scroll(press.key, std::max<std::size_t>(1, height / 2));
    }
  }

  void Command(char c) {
    if (c == 'q' || c == 'Q') {
      quit_ = true;
    } else if (c == 's' || c == 'S') {
      view_.sort = NextSort(view_.sort);
      view_.first = 0;
    } else if (c == '/') {
      view_.typing = true;
    }
  }

  void Type(const TerminalSession::KeyPress& press) {
    using Key = TerminalSession::Key;
    if (press.key == Key::kCharacter) {
      view_.filter += press.character;
    } else if (press.key == Key::kBackspace && !view_.filter.empty()) {
      view_.filter.pop_back();
    } else if (press.key == Key::kEscape) {
      view_.filter.clear();
    }
    view_.typing = press.key != Key::kEnter && press.key != Key::kEscape;
    view_.first = 0;
  }

  void Scroll(TerminalSession::Key key, std::size_t page) {
    using Key = TerminalSession::Key;
    const std::size_t last = view_.rows.empty() ? 0 : view_.rows.size() - 1;
    const auto up = [this](std::size_t by) {
      view_.first -= std::min(view_.first, by);
    };
    const auto down = [this, last](std::size_t by) {
      view_.first = std::min(last, view_.first + by);
    };
    key == Key::kUp         ? up(1)
    : key == Key::kDown     ? down(1)
    : key == Key::kPageUp   ? up(page)
    : key == Key::kPageDown ? down(page)
    : key == Key::kHome     ? up(last)
    : key == Key::kEnd      ? down(last)
                            : void();
  }

  TopOptions options_;
  const cli::Context& context_;
  cli::FaultTexts texts_;
  TopBoard board_{kSilence};
  TopView view_;
  bool quit_{false};
  idl::Participant participant_;
  idl::Subscriber<idl::ModelSetInfoMessage> models_;
  idl::Subscriber<idl::FaultEventMessage> events_;
  idl::Subscriber<idl::MonitorStatusMessage> status_;
  idl::Subscriber<idl::DecisionMessage> decisions_;
};

int RunTop(const TopOptions& options, const cli::Context& context) {
  cli::StopSignals signals;
  Top top(options, context);
  return IsLive(options, context) ? top.Live(signals) : top.Once(signals);
}

}  // namespace

void AddTopVerb(cli::Program& program) {
  auto options = std::make_shared<TopOptions>();
  CLI::App& top = program.AddVerb(
      "top",
      "A live table of valves and decision factors, the worst first, from what "
      "monitors publish",
      [options](const cli::Context& context) {
        return RunTop(*options, context);
      });
  top.add_flag("--once", options->once,
               "Print the table once and exit; --json alike");
  top.add_option("--wait", options->wait_s,
                 "With --once: wait so long for a monitor [s]")
      ->check(CLI::Range(0.1, 600.0));
  top.add_option("--valves", options->valves, "Only ids that match GLOB");
  top.add_option("--filter", options->filter,
                 "Only valves with this in id, fault, state or quality");
  top.add_option("--max-valves", options->max_valves, "Room for so many valves")
      ->check(CLI::Range(1, 100000));
}

}  // namespace fdi::monitor
