#include "storage/plot/gnuplot.h"

#include <cerrno>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <sstream>
#include <stdexcept>

#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include "storage/plot/scratch_folder.h"

extern char** environ;

namespace fdi::storage {
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

void RunGnuplot(const std::string& script) {
  const ScratchFolder scratch;
  const std::filesystem::path file = scratch.path() / "plot.gp";
  std::ofstream out(file);
  out << script;
  out.close();
  if (!out) {
    throw std::runtime_error("cannot write " + file.string());
  }
  std::string name = "gnuplot";
  std::string argument = file.string();
  char* arguments[] = {name.data(), argument.data(), nullptr};
  pid_t child = 0;
  const int code =
      posix_spawnp(&child, "gnuplot", nullptr, nullptr, arguments, environ);
  if (code != 0) {
    throw std::runtime_error(std::string("gnuplot cannot run: ") +
                             std::strerror(code) +
                             "; on Debian it is in gnuplot-nox");
  }
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0) {
    throw std::runtime_error("gnuplot failed, see above");
  }
}

std::string GnuplotText(const std::string& text) {
  std::string result = "'";
  for (const char c : text) {
    result += c == '\'' ? "''" : std::string(1, c == '\n' ? ' ' : c);
  }
  return result + "'";
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

}  // namespace fdi::storage
