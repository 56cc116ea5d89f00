#include "tests/system/monitor_process.h"

#include <array>
#include <csignal>
#include <stdexcept>

#include <fcntl.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

namespace fdi {

using Clock = std::chrono::steady_clock;

ChildProcess::ChildProcess(const std::vector<std::string>& command) {
  std::array<int, 2> ends{};
  if (pipe2(ends.data(), O_CLOEXEC) != 0) {
    throw std::runtime_error("pipe2 failed");
  }
  std::vector<char*> arguments;
  for (const std::string& word : command) {
    arguments.push_back(const_cast<char*>(word.c_str()));
  }
  arguments.push_back(nullptr);
  pid_ = fork();
  if (pid_ == 0) {
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    dup2(ends[1], STDERR_FILENO);
    execv(arguments.front(), arguments.data());
    _exit(127);
  }
  close(ends[1]);
  pipe_ = ends[0];
  if (pid_ < 0) {
    throw std::runtime_error("fork failed");
  }
}

ChildProcess::~ChildProcess() {
  if (!ended_) {
    kill(pid_, SIGKILL);
    waitpid(pid_, nullptr, 0);
  }
  close(pipe_);
}

bool ChildProcess::ReadErrors(std::chrono::milliseconds timeout) {
  pollfd waiting{pipe_, POLLIN, 0};
  if (poll(&waiting, 1, static_cast<int>(timeout.count())) <= 0) {
    return true;
  }
  std::array<char, 4096> buffer{};
  const ssize_t count = read(pipe_, buffer.data(), buffer.size());
  if (count <= 0) {
    return false;
  }
  errors_.append(buffer.data(), static_cast<std::size_t>(count));
  return true;
}

bool ChildProcess::AwaitLine(const std::string& text,
                             std::chrono::seconds timeout) {
  const Clock::time_point deadline = Clock::now() + timeout;
  while (errors_.find(text) == std::string::npos) {
    if (Clock::now() > deadline ||
        !ReadErrors(std::chrono::milliseconds(100))) {
      return errors_.find(text) != std::string::npos;
    }
  }
  return true;
}

void ChildProcess::Signal(int signal) const {
  kill(pid_, signal);
}

std::optional<int> ChildProcess::AwaitExit(std::chrono::seconds timeout) {
  const Clock::time_point deadline = Clock::now() + timeout;
  while (Clock::now() < deadline &&
         ReadErrors(std::chrono::milliseconds(100))) {
  }
  int status = 0;
  while (waitpid(pid_, &status, WNOHANG) == 0) {
    if (Clock::now() >= deadline) {
      return std::nullopt;
    }
    poll(nullptr, 0, 10);
  }
  ended_ = true;
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

}  // namespace fdi
