#include "monitor/console/access.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <system_error>

#include <fcntl.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <unistd.h>

#include "diagnosis/error.h"

namespace fdi::console {
namespace {

constexpr std::size_t kRandomBytes = 24;
constexpr double kAttempts = 5.0;
constexpr std::size_t kMaxOrigins = 256;

std::string RandomToken() {
  std::array<unsigned char, kRandomBytes> bytes{};
  if (getrandom(bytes.data(), bytes.size(), 0) !=
      static_cast<ssize_t>(bytes.size())) {
    throw std::system_error(errno, std::generic_category(), "getrandom");
  }
  std::string token;
  for (const unsigned char byte : bytes) {
    token += "0123456789abcdef"[byte >> 4U];
    token += "0123456789abcdef"[byte & 15U];
  }
  return token;
}

// Does nothing if the file is there.
void MakeTokenFile(const std::filesystem::path& path) {
  const int file =
      open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
  if (file < 0) {
    if (errno == EEXIST) {
      return;
    }
    throw DataError("--console-write " + path.string() + ": cannot be made: " +
                    std::generic_category().message(errno));
  }
  const std::string line = RandomToken() + "\n";
  const ssize_t written = write(file, line.data(), line.size());
  const int failed = close(file);
  if (written != static_cast<ssize_t>(line.size()) || failed != 0) {
    unlink(path.c_str());
    throw DataError("--console-write " + path.string() + ": cannot be written");
  }
}

// The first line of the file, which may be 4 KB long.
std::string FirstLine(const std::filesystem::path& path) {
  const std::string option = "--console-write " + path.string();
  const int file = open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  struct stat facts {};
  std::array<char, 4096> text{};
  ssize_t size = -1;
  if (file >= 0 && fstat(file, &facts) == 0 && S_ISREG(facts.st_mode)) {
    size = read(file, text.data(), text.size());
  }
  close(file);
  if (size < 0) {
    throw DataError(option + ": cannot be read");
  }
  if ((facts.st_mode & 0027U) != 0 ||
      (facts.st_uid != geteuid() && facts.st_uid != 0)) {
    char mode[8];
    std::snprintf(mode, sizeof mode, "%04o", facts.st_mode & 07777U);
    throw ConfigError(option + ": mode " + mode +
                      " lets others read or change the token; expected a file "
                      "of the service's user or root with mode 0600 or 0640");
  }
  const std::string_view all(text.data(), static_cast<std::size_t>(size));
  return std::string(all.substr(0, all.find('\n')));
}

// Takes the same time wherever the texts differ.
bool SameSecret(std::string_view given, std::string_view secret) {
  unsigned difference = given.size() == secret.size() ? 0U : 1U;
  for (std::size_t i = 0; i < secret.size(); ++i) {
    const char c = i < given.size() ? given[i] : '\0';
    difference |= static_cast<unsigned>(static_cast<unsigned char>(c) ^
                                        static_cast<unsigned char>(secret[i]));
  }
  return difference == 0;
}

}  // namespace

std::string LoadToken(const std::filesystem::path& path) {
  MakeTokenFile(path);
  std::string token = FirstLine(path);
  if (token.ends_with('\r')) {
    token.pop_back();
  }
  const bool printable = std::all_of(
      token.begin(), token.end(), [](char c) { return c > ' ' && c <= '~'; });
  if (token.size() < kMinTokenLength || !printable) {
    throw ConfigError("--console-write " + path.string() +
                      ": the token, its first line, has " +
                      std::to_string(token.size()) +
                      " characters; expected 16 or more, without blanks "
                      "(delete the file to have one made)");
  }
  return token;
}

Permission TokenGuard::Check(std::string_view authorization,
                             const std::string& origin, Clock::time_point now) {
  if (token_.empty()) {
    return Permission::kReadOnly;
  }
  const std::lock_guard lock(mutex_);
  const bool known = failing_.contains(origin);
  if (known || failing_.size() >= kMaxOrigins) {
    if (AllowanceOf(origin, now).attempts < 1.0) {
      ++counts_.unread;
      return Permission::kTooMany;
    }
  }
  constexpr std::string_view kScheme = "Bearer ";
  if (authorization.starts_with(kScheme) &&
      SameSecret(authorization.substr(kScheme.size()), token_)) {
    failing_.erase(origin);
    return Permission::kGranted;
  }
  AllowanceOf(origin, now).attempts -= 1.0;
  ++counts_.wrong;
  log_(LogLevel::kWarning,
       "console_token_refused origin=" + origin +
           " failures=" + std::to_string(counts_.wrong) +
           " not_looked_at=" + std::to_string(counts_.unread));
  return Permission::kWrongToken;
}

// With the mutex locked. Once there are too many, all others share one.
TokenGuard::Allowance& TokenGuard::AllowanceOf(const std::string& origin,
                                               Clock::time_point now) {
  const auto refilled = [now](const Allowance& allowance) {
    const std::chrono::duration<double> passed = now - allowance.stamp;
    return std::min(allowance.attempts + passed.count(), kAttempts);
  };
  if (failing_.size() >= kMaxOrigins) {
    std::erase_if(failing_, [&](const auto& entry) {
      return refilled(entry.second) >= kAttempts;
    });
  }
  const bool shared =
      failing_.size() >= kMaxOrigins && !failing_.contains(origin);
  Allowance& allowance =
      failing_.try_emplace(shared ? "" : origin, Allowance{kAttempts, now})
          .first->second;
  allowance = {refilled(allowance), now};
  return allowance;
}

TokenGuard::Counts TokenGuard::counts() const {
  const std::lock_guard lock(mutex_);
  return counts_;
}

}  // namespace fdi::console
