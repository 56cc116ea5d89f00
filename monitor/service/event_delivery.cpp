// Delivers the events of the monitor to a user's program.
#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <sstream>
#include <string_view>
#include <system_error>
#include <utility>

#include <poll.h>
#include <spawn.h>
#include <sys/eventfd.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/error.h"
#include "monitor/service/event_hook.h"

extern char** environ;

namespace fdi::monitor {
namespace {

constexpr const char* kStops = "the monitor stops";

class File {
 public:
  explicit File(int fd) : fd_(fd) {}
  ~File() {
    if (fd_ >= 0) {
      close(fd_);
    }
  }
  File(const File&) = delete;
  File& operator=(const File&) = delete;
  int get() const { return fd_; }

 private:
  int fd_;
};

std::string Reason(const char* operation, int code) {
  return std::string(operation) + ": " + std::strerror(code);
}

// An in-memory file, not a pipe: a program that never reads its input cannot
// block us.
int MakeInput(std::string_view text) {
  const int fd = memfd_create("fdi-event", MFD_CLOEXEC);
  if (fd >= 0 && (write(fd, text.data(), text.size()) !=
                      static_cast<ssize_t>(text.size()) ||
                  lseek(fd, 0, SEEK_SET) != 0)) {
    close(fd);
    return -1;
  }
  return fd;
}

// @returns the exit status of the child; waits for it to exit.
int Reap(pid_t pid) {
  int status = 0;
  while (waitpid(pid, &status, 0) < 0 && errno == EINTR) {
  }
  return status;
}

// Kills the whole process group.
// The child has not been reaped yet, so its pid cannot belong to anyone else.
void Kill(pid_t pid) {
  kill(-pid, SIGKILL);
  Reap(pid);
}

// Attributes of the child: `input` as standard input, our standard error as its
// output, no other open file, default signals, its own process group.
class SpawnPlan {
 public:
  // The child performs the file actions in this order: the input is duplicated
  // before all above standard error is closed. Ignored signals outlive exec(),
  // and the monitor ignores SIGXFSZ, so all are set to their defaults.
  explicit SpawnPlan(int input) {
    posix_spawn_file_actions_init(&files_);
    posix_spawn_file_actions_adddup2(&files_, input, STDIN_FILENO);
    posix_spawn_file_actions_adddup2(&files_, STDERR_FILENO, STDOUT_FILENO);
    posix_spawn_file_actions_addclosefrom_np(&files_, STDERR_FILENO + 1);
    sigset_t none;
    sigset_t all;
    sigemptyset(&none);
    sigfillset(&all);
    posix_spawnattr_init(&attributes_);
    posix_spawnattr_setsigmask(&attributes_, &none);
    posix_spawnattr_setsigdefault(&attributes_, &all);
    posix_spawnattr_setpgroup(&attributes_, 0);
    posix_spawnattr_setflags(&attributes_, POSIX_SPAWN_SETSIGMASK |
                                               POSIX_SPAWN_SETSIGDEF |
                                               POSIX_SPAWN_SETPGROUP);
  }
  ~SpawnPlan() {
    posix_spawn_file_actions_destroy(&files_);
    posix_spawnattr_destroy(&attributes_);
  }
  SpawnPlan(const SpawnPlan&) = delete;
  SpawnPlan& operator=(const SpawnPlan&) = delete;

  // @returns an error code, 0 for success.
  int Spawn(const std::vector<std::string>& words, pid_t& pid) const {
    std::vector<char*> arguments;
    for (const std::string& word : words) {
      arguments.push_back(const_cast<char*>(word.c_str()));
    }
    arguments.push_back(nullptr);
    return posix_spawnp(&pid, arguments[0], &files_, &attributes_,
                        arguments.data(), environ);
  }

 private:
  posix_spawn_file_actions_t files_;
  posix_spawnattr_t attributes_;
};

std::optional<std::string> StatusReason(int status) {
  if (WIFEXITED(status) && WEXITSTATUS(status) == 0) {
    return std::nullopt;
  }
  return WIFEXITED(status)
             ? "exit status " + std::to_string(WEXITSTATUS(status))
             : "signal " + std::to_string(WTERMSIG(status));
}

class ProgramDelivery : public EventDelivery {
 public:
  ProgramDelivery(std::vector<std::string> words,
                  std::chrono::milliseconds limit)
      : words_(std::move(words)),
        limit_(limit),
        stop_(eventfd(0, EFD_CLOEXEC)) {
    if (stop_.get() < 0) {
      throw std::system_error(errno, std::generic_category(), "eventfd");
    }
  }

  std::optional<std::string> Deliver(const std::string& json) override {
    const File input(MakeInput(json));
    if (input.get() < 0) {
      return Reason("memfd_create", errno);
    }
    pid_t pid = 0;
    if (const int code = SpawnPlan(input.get()).Spawn(words_, pid); code != 0) {
      return Reason(words_.front().c_str(), code);
    }
    return Await(pid);
  }

  // Nobody reads the descriptor: it stays readable and aborts later deliveries,
  // too.
  void Interrupt() override { eventfd_write(stop_.get(), 1); }

 private:
  std::optional<std::string> Await(pid_t pid) const {
    // A descriptor, because poll() awaits it together with stop_ and a timeout,
    // which waitpid() cannot.
    // The header of glibc 2.36 declares pidfd_open() for C only.
    const File process(static_cast<int>(syscall(SYS_pidfd_open, pid, 0)));
    if (process.get() < 0) {
      // Without it the end of the process would go unnoticed until the timeout.
      const int code = errno;
      Kill(pid);
      return Reason("pidfd_open", code);
    }
    pollfd wanted[2] = {{process.get(), POLLIN, 0}, {stop_.get(), POLLIN, 0}};
    const auto end = std::chrono::steady_clock::now() + limit_;
    int ready = 0;
    do {
      const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(
          end - std::chrono::steady_clock::now());
      ready = poll(wanted, 2,
                   static_cast<int>(std::max<std::int64_t>(0, left.count())));
    } while (ready < 0 && errno == EINTR);
    // A program that has ended counts by its status, even if the monitor stops
    // now.
    const bool ended = ready > 0 && wanted[0].revents != 0;
    if (ended) {
      return StatusReason(Reap(pid));
    }
    Kill(pid);
    return ready > 0 ? kStops
                     : "killed after " + std::to_string(limit_.count()) + " ms";
  }

  std::vector<std::string> words_;
  std::chrono::milliseconds limit_;
  File stop_;
};

[[noreturn]] void Refuse(const std::string& target, const std::string& why) {
  throw ConfigError("--on-event '" + target + "': " + why +
                    "; expected a command with its arguments");
}

// Words are separated by blanks; within '...' or "..." a blank belongs to the
// word. There are no other special characters and no escapes.
std::vector<std::string> SplitWords(const std::string& text) {
  std::vector<std::string> words;
  bool in_word = false;
  char quote = '\0';
  for (const char c : text) {
    if (quote == '\0' && (c == ' ' || c == '\t')) {
      in_word = false;
      continue;
    }
    if (!std::exchange(in_word, true)) {
      words.emplace_back();
    }
    if (c == quote) {
      quote = '\0';
    } else if (quote == '\0' && (c == '\'' || c == '"')) {
      quote = c;
    } else {
      words.back() += c;
    }
  }
  if (quote != '\0') {
    Refuse(text, "a quote is not closed");
  }
  return words;
}

bool CanRun(const std::string& path) {
  std::error_code error;  // A folder that may not be read has no program.
  return std::filesystem::is_regular_file(path, error) &&
         access(path.c_str(), X_OK) == 0;
}

// As execvp(3) looks for it.
void RequireProgram(const std::string& target, const std::string& name) {
  bool found = CanRun(name);
  if (name.find('/') == std::string::npos) {
    const char* path = std::getenv("PATH");
    std::istringstream folders(path == nullptr ? "/bin:/usr/bin" : path);
    found = false;
    for (std::string folder; !found && std::getline(folders, folder, ':');) {
      found = CanRun((folder.empty() ? "." : folder) + "/" + name);
    }
  }
  if (!found) {
    Refuse(target, "no program '" + name +
                       "' that can be run (is it in the PATH, or its path "
                       "right, and is it executable?)");
  }
}

}  // namespace

std::unique_ptr<EventDelivery> DeliverToProgram(
    std::vector<std::string> words, std::chrono::milliseconds limit) {
  return std::make_unique<ProgramDelivery>(std::move(words), limit);
}

std::unique_ptr<EventDelivery> MakeEventDelivery(
    const std::string& target, std::chrono::milliseconds limit) {
  // In the first word this is a URL. In a later word it is an argument of the
  // command, such as the address given to curl.
  if (target.find("://") != std::string::npos &&
      target.find("://") < target.find(' ')) {
    Refuse(target,
           "a command posts to it: curl -sSf -H 'Content-Type: "
           "application/json' --data-binary @- URL");
  }
  std::vector<std::string> words = SplitWords(target);
  if (words.empty()) {
    Refuse(target, "nothing to run");
  }
  RequireProgram(target, words.front());
  return DeliverToProgram(std::move(words), limit);
}

}  // namespace fdi::monitor
