#include "tests/system/pty_process.h"

#include <csignal>
#include <stdexcept>

#include <poll.h>
#include <pty.h>
#include <sys/wait.h>
#include <unistd.h>
#include <utmp.h>

namespace fdi {
namespace {

constexpr std::chrono::seconds kPatience{30};

}  // namespace

PtyProcess::PtyProcess(const std::vector<std::string>& command, int columns,
                       int rows) {
  winsize size{};
  size.ws_col = static_cast<unsigned short>(columns);
  size.ws_row = static_cast<unsigned short>(rows);
  std::vector<char*> arguments;
  for (const std::string& word : command) {
    arguments.push_back(const_cast<char*>(word.c_str()));
  }
  arguments.push_back(nullptr);
  if (openpty(&terminal_, &keeper_, nullptr, nullptr, &size) != 0) {
    throw std::runtime_error("openpty failed");
  }
  pid_ = fork();
  if (pid_ == 0) {
    close(terminal_);
    login_tty(keeper_);
    execv(arguments[0], arguments.data());
    _exit(127);
  }
  if (pid_ < 0) {
    throw std::runtime_error("fork failed");
  }
}

PtyProcess::~PtyProcess() {
  if (!ended_) {
    kill(pid_, SIGKILL);
    waitpid(pid_, nullptr, 0);
  }
  close(terminal_);
  close(keeper_);
}

bool PtyProcess::Read(std::chrono::milliseconds timeout) {
  pollfd input{terminal_, POLLIN, 0};
  if (poll(&input, 1, static_cast<int>(timeout.count())) <= 0) {
    return false;
  }
  char buffer[4096];
  const ssize_t count = read(terminal_, buffer, sizeof buffer);
  output_.append(buffer, count > 0 ? static_cast<std::size_t>(count) : 0);
  return count > 0;
}

bool PtyProcess::AwaitText(const std::string& text) {
  const auto deadline = std::chrono::steady_clock::now() + kPatience;
  while (output_.find(text) == std::string::npos) {
    if (std::chrono::steady_clock::now() > deadline) {
      return false;
    }
    Read(std::chrono::milliseconds(50));
  }
  return true;
}

void PtyProcess::Type(const std::string& keys) const {
  if (write(terminal_, keys.data(), keys.size()) !=
      static_cast<ssize_t>(keys.size())) {
    throw std::runtime_error("cannot type");
  }
}

void PtyProcess::Signal(int signal) const {
  kill(pid_, signal);
}

std::optional<int> PtyProcess::AwaitExit() {
  const auto deadline = std::chrono::steady_clock::now() + kPatience;
  int status = 0;
  while (waitpid(pid_, &status, WNOHANG) == 0) {
    if (std::chrono::steady_clock::now() > deadline) {
      return std::nullopt;
    }
    Read(std::chrono::milliseconds(20));
  }
  ended_ = true;
  while (Read(std::chrono::milliseconds(0))) {
  }
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

termios PtyProcess::Settings() const {
  termios settings{};
  tcgetattr(keeper_, &settings);
  return settings;
}

}  // namespace fdi
