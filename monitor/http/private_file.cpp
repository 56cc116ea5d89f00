#include "monitor/http/private_file.h"

#include <cerrno>
#include <cstdio>
#include <system_error>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/error.h"

namespace fdi::monitor {
namespace {

constexpr std::size_t kMaxSize = std::size_t{1} << 20U;

}  // namespace

std::string ReadPrivateFile(const std::filesystem::path& path,
                            const std::string& option) {
  const std::string name = option + " " + path.string();
  // O_NONBLOCK: opening a pipe must not wait.
  const int file = open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  struct stat facts {};
  std::string text(kMaxSize + 1, '\0');
  ssize_t size = -1;
  if (file >= 0 && fstat(file, &facts) == 0) {
    errno = EINVAL;
    size = S_ISREG(facts.st_mode) ? read(file, text.data(), text.size()) : -1;
  }
  if (size > static_cast<ssize_t>(kMaxSize)) {
    errno = EFBIG;
    size = -1;
  }
  const std::string reason = std::generic_category().message(errno);
  if (file >= 0) {
    close(file);
  }
  if (size < 0) {
    throw DataError(name + ": cannot be read: " + reason);
  }
  if ((facts.st_mode & 0027U) != 0 ||
      (facts.st_uid != geteuid() && facts.st_uid != 0)) {
    char mode[8];
    std::snprintf(mode, sizeof mode, "%04o", facts.st_mode & 07777U);
    throw ConfigError(name + ": mode " + mode +
                      " lets others read or change it; expected a file of the "
                      "service's user or root with mode 0600 or 0640");
  }
  text.resize(static_cast<std::size_t>(size));
  return text;
}

}  // namespace fdi::monitor
