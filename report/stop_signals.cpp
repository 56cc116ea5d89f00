#include "report/stop_signals.h"

#include <array>
#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstdint>
#include <cstring>
#include <stdexcept>
#include <system_error>

#include <fcntl.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/time.h>
#include <unistd.h>

#include "report/output_patience.h"

namespace fdi::report {
namespace {

constexpr std::array<int, 4> kSignals = {SIGINT, SIGTERM, SIGHUP, SIGPIPE};

// A signal handler can only access globals.
std::atomic<int> g_event{-1};
std::atomic<bool> g_stop{false};
std::atomic<bool> g_reload{false};
std::atomic<bool> g_reloads{false};  // The meaning of SIGHUP.
std::atomic<bool> g_installed{false};
std::atomic<std::int64_t> g_patience_ms{0};  // 0: any.
std::atomic<const char*> g_last_words{""};
std::array<struct sigaction, kSignals.size()> g_previous;
static_assert(std::atomic<bool>::is_always_lock_free);

bool HasControllingTerminal() {
  const int file =
      open("/dev/tty", O_RDONLY | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  if (file >= 0) {
    close(file);
  }
  return file >= 0;  // ENXIO after a hang-up, or if there never was one.
}

// stdin, stdout and stderr that are terminals, and the controlling one.
using Terminals = std::array<bool, 4>;

Terminals FindTerminals() {
  // isatty() fails with EIO after a hang-up.
  return {isatty(0) == 1, isatty(1) == 1, isatty(2) == 1,
          HasControllingTerminal()};
}

Terminals g_terminals{};  // At the start; none under nohup.

bool HasLostTerminal() {
  const Terminals now = FindTerminals();
  for (std::size_t i = 0; i < now.size(); ++i) {
    if (g_terminals[i] && !now[i]) {
      return true;
    }
  }
  return false;
}

// Makes the descriptor readable. A handler may interrupt code that has not read
// its errno yet.
void Wake() noexcept {
  const int saved_errno = errno;
  const std::uint64_t one = 1;
  [[maybe_unused]] const auto written = write(g_event, &one, sizeof one);
  errno = saved_errno;
}

extern "C" void FdiOnAlarm(int /*signal*/) {
  const char* words = g_last_words;
  pollfd stream{STDERR_FILENO, POLLOUT, 0};
  if (poll(&stream, 1, 0) == 1) {  // Its reader may have stopped reading.
    [[maybe_unused]] const auto written =
        write(STDERR_FILENO, words, std::strlen(words));
  }
  _exit(1);
}

// With 0, none is set any more. A plain system call in Linux.
void SetAlarm(std::int64_t after_ms) noexcept {
  const itimerval timer{{0, 0}, {after_ms / 1000, after_ms % 1000 * 1000}};
  setitimer(ITIMER_REAL, &timer, nullptr);
}

void SetAlarmHandler(bool ends) noexcept {
  struct sigaction action {};
  action.sa_flags = SA_RESTART;
  sigemptyset(&action.sa_mask);
  action.sa_handler = ends ? &FdiOnAlarm : SIG_DFL;
  sigaction(SIGALRM, &action, nullptr);
}

extern "C" void FdiOnSignal(int signal) {
  if (signal == SIGHUP) {
    // Kernel and shell may both send it when a terminal is closed.
    (g_reloads ? g_reload : g_stop) = true;
  } else if (g_stop.exchange(true)) {
    _exit(1);  // The orderly stop hangs; exit() is unsafe here.
  }
  if (g_stop && g_patience_ms > 0) {
    SetAlarm(g_patience_ms);
  }
  Wake();
}

}  // namespace

StopSignals::StopSignals(HangUp hang_up) {
  if (g_installed.exchange(true)) {
    throw std::logic_error("StopSignals: one at a time");
  }
  g_event = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
  if (g_event < 0) {
    g_installed = false;
    throw std::system_error(errno, std::generic_category(), "eventfd");
  }
  g_stop = false;
  g_reload = false;
  g_reloads = hang_up == HangUp::kReload;
  g_terminals = FindTerminals();
  // SA_RESTART: other system calls continue; waiters use the descriptor.
  struct sigaction action {};
  action.sa_flags = SA_RESTART;
  sigemptyset(&action.sa_mask);
  for (std::size_t i = 0; i < kSignals.size(); ++i) {
    action.sa_handler = kSignals[i] == SIGPIPE ? SIG_IGN : &FdiOnSignal;
    sigaction(kSignals[i], &action, &g_previous[i]);
    if (kSignals[i] == SIGHUP && g_previous[i].sa_handler == SIG_IGN) {
      g_terminals = {};  // nohup has said so.
      if (hang_up == HangUp::kStop) {
        sigaction(SIGHUP, &g_previous[i], nullptr);
      }
    }
  }
}

StopSignals::~StopSignals() {
  EndWithin(std::chrono::milliseconds(0));
  for (std::size_t i = 0; i < kSignals.size(); ++i) {
    sigaction(kSignals[i], &g_previous[i], nullptr);
  }
  close(g_event.exchange(-1));
  g_installed = false;
}

void StopSignals::EndWithin(std::chrono::milliseconds patience,
                            const char* last_words) {
  g_last_words = last_words;
  g_patience_ms = patience.count();
  SetAlarm(0);
  SetAlarmHandler(patience.count() > 0);
  if (g_stop && patience.count() > 0) {
    SetAlarm(patience.count());
  }
}

bool StopSignals::stop_requested() const noexcept {
  return g_stop;
}

StopSignals::Event StopSignals::WaitFor(std::chrono::milliseconds timeout) {
  const auto deadline = std::chrono::steady_clock::now() + timeout;
  while (true) {
    if (g_stop) {
      return Event::kStop;  // The descriptor stays readable for others.
    }
    if (g_reload && HasLostTerminal()) {
      g_stop = true;
      continue;
    }
    if (g_reload.exchange(false)) {
      // The reload is consumed, so the descriptor must not stay readable,
      // unless a signal arrived between exchange and read.
      std::uint64_t count = 0;
      [[maybe_unused]] const auto got = read(g_event, &count, sizeof count);
      if (g_stop || g_reload) {
        Wake();
      }
      return Event::kReload;
    }
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(
        deadline - std::chrono::steady_clock::now());
    if (left.count() <= 0) {
      return Event::kTimeout;
    }
    pollfd entry{g_event, POLLIN, 0};
    const int ready = poll(&entry, 1, static_cast<int>(left.count()) + 1);
    if (ready < 0 && errno != EINTR) {
      throw std::system_error(errno, std::generic_category(), "poll");
    }
    if (ready > 0 && !g_stop && !g_reload) {
      std::uint64_t count = 0;  // Another thread consumed the reload.
      [[maybe_unused]] const auto got = read(g_event, &count, sizeof count);
      if (g_stop || g_reload) {
        Wake();
      }
    }
  }
}

OutputPatience::OutputPatience() {
  if (g_stop) {
    g_last_words = "";
    SetAlarmHandler(true);
    SetAlarm(1000);
  }
}

OutputPatience::~OutputPatience() {
  if (g_stop) {
    SetAlarm(0);
    SetAlarmHandler(false);
  }
}

}  // namespace fdi::report
