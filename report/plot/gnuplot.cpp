#include "report/plot/gnuplot.h"

#include <array>
#include <cerrno>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iterator>
#include <sstream>
#include <stdexcept>
#include <system_error>
#include <thread>

#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

extern char** environ;

namespace fdi::plot {
namespace {

// A temporary folder that is removed with everything in it.
class ScratchFolder {
 public:
  ScratchFolder() {
    // mkdtemp() replaces the last six characters.
    std::string name =
        (std::filesystem::temp_directory_path() / "fdi-plot-XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) {
      throw std::system_error(errno, std::generic_category(), name);
    }
    path_ = name;
  }
  ~ScratchFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

// Spawns gnuplot in its own process group, so that it can be killed as a whole,
// and without the files and sockets of this process.
pid_t Spawn(const std::filesystem::path& script) {
  std::string name = "gnuplot";
  std::string argument = script.string();
  const std::array<char*, 3> arguments{name.data(), argument.data(), nullptr};
  posix_spawn_file_actions_t files;
  posix_spawn_file_actions_init(&files);
  posix_spawn_file_actions_addclosefrom_np(&files, STDERR_FILENO + 1);
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  posix_spawnattr_setpgroup(&attributes, 0);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
  pid_t child = 0;
  const int code = posix_spawnp(&child, "gnuplot", &files, &attributes,
                                arguments.data(), environ);
  posix_spawn_file_actions_destroy(&files);
  posix_spawnattr_destroy(&attributes);
  if (code != 0) {
    throw std::runtime_error(std::string("gnuplot cannot run: ") +
                             std::strerror(code) +
                             "; on Debian it is in gnuplot-nox");
  }
  return child;
}

void RunScript(const std::filesystem::path& script,
               const GnuplotLimits& limits) {
  using Clock = std::chrono::steady_clock;
  const pid_t child = Spawn(script);
  const Clock::time_point deadline = Clock::now() + limits.time;
  bool killed = false;
  int status = 0;
  while (waitpid(child, &status, WNOHANG) == 0) {
    if (!killed && (Clock::now() >= deadline || limits.stop.stop_requested())) {
      kill(-child, SIGKILL);
      killed = true;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  if (killed) {
    throw std::runtime_error("gnuplot was killed: it took longer than " +
                             std::to_string(limits.time.count()) +
                             " ms, or the program ends");
  }
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0) {
    throw std::runtime_error("gnuplot failed, see above");
  }
}

}  // namespace

bool HaveGnuplot() {
  const char* path = std::getenv("PATH");
  std::istringstream folders(path == nullptr ? "" : path);
  for (std::string folder; std::getline(folders, folder, ':');) {
    if (access((std::filesystem::path(folder) / "gnuplot").c_str(), X_OK) ==
        0) {
      return true;
    }
  }
  return false;
}

std::string RunGnuplot(
    const std::function<std::string(const std::filesystem::path& output)>&
        script_for,
    const GnuplotLimits& limits) {
  const ScratchFolder scratch;
  const std::filesystem::path script = scratch.path() / "plot.gp";
  const std::filesystem::path output = scratch.path() / "picture";
  std::ofstream out(script);
  out << script_for(output);
  out.close();
  if (!out) {
    throw std::runtime_error("cannot write " + script.string());
  }
  RunScript(script, limits);
  std::ifstream picture(output, std::ios::binary);
  if (!picture) {
    throw std::runtime_error("gnuplot drew nothing, see above");
  }
  return {std::istreambuf_iterator<char>(picture), {}};
}

// In single quotes a quote is doubled, but gnuplot 5.4 rejects such a pair at
// the beginning of a string. In double quotes gnuplot executes backquoted text
// as a command, so backquotes are written as octal escapes. gnuplot reads
// digits that follow as part of the escape, so they are escaped as well.
std::string GnuplotText(std::string_view text) {
  std::string result = "\"";
  bool after_number = false;
  for (const char c : text) {
    if (c == '`' || (after_number && c >= '0' && c <= '9')) {
      std::array<char, 8> octal{};
      std::snprintf(octal.data(), octal.size(), "\\%03o",
                    static_cast<unsigned>(c));
      result += octal.data();
      after_number = true;
      continue;
    }
    if (c == '"' || c == '\\') {
      result += '\\';
    }
    result += c >= '\0' && c < ' ' ? ' ' : c;
    after_number = false;
  }
  return result + '"';
}

std::string GnuplotNumber(double value) {
  if (!std::isfinite(value)) {
    return "NaN";
  }
  std::ostringstream text;
  text.precision(9);
  text << value;
  return text.str();
}

}  // namespace fdi::plot
