#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <map>
#include <mutex>
#include <string>
#include <string_view>
#include <utility>

#include "base/log.h"

namespace fdi::console {

inline constexpr std::size_t kMinTokenLength = 16;

/// Loads a token from its file, which is created with mode 0600 and a random
/// token if it does not exist.
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

/// Slows down guessing: after five failures in a row an address gets one
/// attempt per second. Bounded memory; not thread safe.
class FailureLimit {
 public:
  using Clock = std::chrono::steady_clock;

  /// Whether an attempt from `origin` is to be checked.
  bool Allows(const std::string& origin, Clock::time_point now);
  /// Records that a checked attempt failed.
  void Add(const std::string& origin, Clock::time_point now);
  void Reset(const std::string& origin) { failing_.erase(origin); }

 private:
  // Remaining attempts, refilled at one per second.
  struct Allowance {
    double attempts;
    Clock::time_point stamp;
  };
  Allowance& AllowanceOf(const std::string& origin, Clock::time_point now);

  std::map<std::string, Allowance> failing_;  // By origin; bounded.
};

/// Decides who may change something. An attempt that FailureLimit refuses is
/// not checked, even if its token is right. Failures are counted and logged
/// with their origin. Thread safe.
class TokenGuard {
 public:
  using Clock = FailureLimit::Clock;
  struct Counts {
    std::uint64_t wrong{0};
    std::uint64_t unread{0};  ///< Refused with kTooMany, unchecked.
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
