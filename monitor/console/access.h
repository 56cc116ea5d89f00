#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <map>
#include <mutex>
#include <string>
#include <string_view>
#include <utility>

#include "diagnosis/log.h"

namespace fdi::console {

inline constexpr std::size_t kMinTokenLength = 16;

/// A token: its file, made with a random one and mode 0600 if it is not there.
/// @returns the first line. @throws ConfigError if that is shorter than 16
///   characters or has blanks, or if others than the owner, root and the group
///   can read the file or others than the owner and root can change it;
///   DataError if the file cannot be used.
std::string LoadToken(const std::filesystem::path& path);

enum class Permission : std::uint8_t {
  kGranted,
  kReadOnly,
  kWrongToken,
  kTooMany
};

/// Slows guesses down: from an address that failed five times in a row one
/// attempt per second is looked at. In bounded memory; not thread safe.
class FailureLimit {
 public:
  using Clock = std::chrono::steady_clock;

  /// Whether to look at an attempt from there.
  bool Allows(const std::string& origin, Clock::time_point now);
  /// It was looked at, and failed.
  void Add(const std::string& origin, Clock::time_point now);
  void Forget(const std::string& origin) { failing_.erase(origin); }

 private:
  // Attempts that are left, which grow by one per second.
  struct Allowance {
    double attempts;
    Clock::time_point stamp;
  };
  Allowance& AllowanceOf(const std::string& origin, Clock::time_point now);

  std::map<std::string, Allowance> failing_;  // By origin, a bounded number.
};

/// Decides who may change something. What FailureLimit does not allow is not
/// looked at, the right token or not. Failures are counted and logged with
/// where they came from. Thread safe.
class TokenGuard {
 public:
  using Clock = FailureLimit::Clock;
  struct Counts {
    std::uint64_t wrong{0};
    std::uint64_t unread{0};  ///< Refused with kTooMany.
  };

  /// @param token empty: the console is read-only.
  TokenGuard(std::string token, LogSink log)
      : token_(std::move(token)), log_(std::move(log)) {}

  /// @param authorization the header, "Bearer TOKEN".
  /// @param origin the address that the request came from.
  Permission Check(std::string_view authorization, const std::string& origin,
                   Clock::time_point now = Clock::now());
  bool writable() const { return !token_.empty(); }
  Counts counts() const;

 private:
  const std::string token_;
  const LogSink log_;
  mutable std::mutex mutex_;
  FailureLimit failures_;
  Counts counts_;
};

}  // namespace fdi::console
