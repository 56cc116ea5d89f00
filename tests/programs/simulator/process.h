#pragma once

#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <fcntl.h>
#include <sys/wait.h>
#include <unistd.h>

#include "tests/storage/temporary_directory.h"

namespace fdi::simulator {

/// End of a process.
struct Ended {
  int code{-1};  ///< Exit code; 128 + signal if it was killed.
  std::string out;
  std::string err;
};

/// fdi-simulator as a child process, with a pipe to its stdin.
class Process {
 public:
  /// @param log takes its stderr; -1: a file, for Ended::err.
  explicit Process(std::vector<std::string> arguments, int log = -1) {
    arguments.insert(arguments.begin(), FDI_SIMULATOR_PROGRAM);
    int input[2];
    if (pipe2(input, O_CLOEXEC) != 0) {
      throw std::runtime_error("pipe");
    }
    const std::string out = OutputFile("out");
    const std::string err = OutputFile("err");
    std::vector<char*> argv;
    for (std::string& argument : arguments) {
      argv.push_back(argument.data());
    }
    argv.push_back(nullptr);
    id_ = fork();
    if (id_ == 0) {
      dup2(input[0], STDIN_FILENO);
      Redirect(out, STDOUT_FILENO);
      if (log < 0) {
        Redirect(err, STDERR_FILENO);
      } else {
        dup2(log, STDERR_FILENO);
      }
      execv(argv[0], argv.data());
      _exit(127);
    }
    close(input[0]);
    stdin_ = input[1];
  }
  ~Process() {
    CloseInput();
    if (id_ > 0) {
      kill(id_, SIGKILL);
      waitpid(id_, nullptr, 0);
    }
  }
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  void Send(const std::string& text) {
    if (write(stdin_, text.data(), text.size()) !=
        static_cast<ssize_t>(text.size())) {
      throw std::runtime_error("write to the child");
    }
  }
  void CloseInput() {
    if (stdin_ >= 0) {
      close(std::exchange(stdin_, -1));
    }
  }
  void Signal(int signal) { kill(id_, signal); }

  /// Kills it if it does not end within a minute.
  Ended Wait() {
    using std::chrono::steady_clock;
    const auto deadline = steady_clock::now() + std::chrono::minutes(1);
    int status = 0;
    while (waitpid(id_, &status, WNOHANG) == 0) {
      if (steady_clock::now() > deadline) {
        kill(id_, SIGKILL);
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    id_ = -1;
    return {WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status),
            Contents("out"), Contents("err")};
  }

 private:
  std::string OutputFile(const char* name) const {
    return (folder_.path() / name).string();
  }
  static void Redirect(const std::string& path, int descriptor) {
    dup2(open(path.c_str(), O_CREAT | O_WRONLY, 0600), descriptor);
  }
  std::string Contents(const char* name) const {
    std::ostringstream text;
    text << std::ifstream(OutputFile(name)).rdbuf();
    return text.str();
  }

  storage::TemporaryDirectory folder_;
  pid_t id_{-1};
  int stdin_{-1};
};

/// Runs fdi-simulator to its end.
inline Ended RunProgram(std::vector<std::string> arguments) {
  Process process(std::move(arguments));
  process.CloseInput();
  return process.Wait();
}

/// Writes `text` to `path` and returns the path as text.
inline std::string WriteFile(const std::filesystem::path& path,
                             const std::string& text) {
  std::ofstream(path) << text;
  return path.string();
}

}  // namespace fdi::simulator
