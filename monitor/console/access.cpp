#include "monitor/console/access.h"

#include <algorithm>
#include <cerrno>
#include <system_error>

#include <fcntl.h>
#include <unistd.h>

#include "base/error.h"
#include "monitor/console/users.h"
#include "monitor/http/private_file.h"

namespace fdi::console {
namespace {

constexpr double kAttempts = 5.0;
constexpr std::size_t kMaxOrigins = 256;

// Does nothing if the file exists.
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

}  // namespace

std::string LoadToken(const std::filesystem::path& path) {
  MakeTokenFile(path);
  std::string token = monitor::ReadPrivateFile(path, "--console-write");
  token.resize(std::min(token.find('\n'), token.size()));
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

bool FailureLimit::Allows(const std::string& origin, Clock::time_point now) {
  const bool known = failing_.contains(origin);
  const bool room =
      failing_.size() < kMaxOrigins || when_full_ == WhenFull::kReplaceOldest;
  return (!known && room) || AllowanceOf(origin, now).attempts >= 1.0;
}

void FailureLimit::Add(const std::string& origin, Clock::time_point now) {
  AllowanceOf(origin, now).attempts -= 1.0;
}

double FailureLimit::Refilled(const Allowance& allowance,
                              Clock::time_point now) {
  const std::chrono::duration<double> passed = now - allowance.stamp;
  return std::min(allowance.attempts + passed.count(), kAttempts);
}

void FailureLimit::MakeRoom(Clock::time_point now) {
  std::erase_if(failing_, [now](const auto& entry) {
    return Refilled(entry.second, now) >= kAttempts;
  });
  if (failing_.size() >= kMaxOrigins &&
      when_full_ == WhenFull::kReplaceOldest) {
    failing_.erase(std::min_element(failing_.begin(), failing_.end(),
                                    [](const auto& a, const auto& b) {
                                      return a.second.stamp < b.second.stamp;
                                    }));
  }
}

FailureLimit::Allowance& FailureLimit::AllowanceOf(const std::string& origin,
                                                   Clock::time_point now) {
  if (failing_.size() >= kMaxOrigins && !failing_.contains(origin)) {
    MakeRoom(now);
  }
  const bool shared =
      failing_.size() >= kMaxOrigins && !failing_.contains(origin);
  Allowance& allowance =
      failing_.try_emplace(shared ? "" : origin, Allowance{kAttempts, now})
          .first->second;
  allowance = {Refilled(allowance, now), now};
  return allowance;
}

Permission TokenGuard::Check(std::string_view token, const std::string& origin,
                             Clock::time_point now) {
  if (token_.empty()) {
    return Permission::kReadOnly;
  }
  if (SameSecret(token, token_)) {
    return Permission::kGranted;
  }
  const MutexLock lock(mutex_);
  if (!failures_.Allows(origin, now)) {
    ++counts_.unread;
    return Permission::kTooMany;
  }
  failures_.Add(origin, now);
  ++counts_.wrong;
  log_(LogLevel::kWarning,
       "console_token_refused origin=" + origin +
           " failures=" + std::to_string(counts_.wrong) +
           " not_looked_at=" + std::to_string(counts_.unread));
  return Permission::kWrongToken;
}

TokenGuard::Counts TokenGuard::counts() const {
  const MutexLock lock(mutex_);
  return counts_;
}

}  // namespace fdi::console
