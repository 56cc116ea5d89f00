#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <utility>

#include "base/log.h"
#include "base/mutex.h"

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

/// Slows down guessing: after five failures in a row an origin gets one attempt
/// per second. Bounded memory; not thread safe.
class FailureLimit {
 public:
  using Clock = std::chrono::steady_clock;
  /// What a new origin gets once 256 others are failing: an allowance that all
  /// further ones share, or the place of the one that failed longest ago. The
  /// latter is for origins that cost whoever invents them more than a second
  /// for each 5 attempts that it wins.
  enum class WhenFull : std::uint8_t { kShare, kReplaceOldest };

  explicit FailureLimit(WhenFull when_full) : when_full_(when_full) {}

  /// Whether an attempt from `origin` is to be checked.
  bool Allows(const std::string& origin, Clock::time_point now);
  /// Records that a checked attempt failed.
  void Add(const std::string& origin, Clock::time_point now);

 private:
  // Remaining attempts, refilled at one per second.
  struct Allowance {
    double attempts;
    Clock::time_point stamp;
  };
  Allowance& AllowanceOf(const std::string& origin, Clock::time_point now);
  static double Refilled(const Allowance& allowance, Clock::time_point now);
  void MakeRoom(Clock::time_point now);

  WhenFull when_full_;
  std::map<std::string, Allowance> failing_;  // By origin; bounded.
};

/// Decides who may change something. The right token is granted always: many
/// may share an address, as behind a proxy, and one of them must not lock the
/// others out. Wrong ones are counted and logged with their origin, beyond
/// FailureLimit only counted. Its length protects the token.
/// Thread safe.
class TokenGuard {
 public:
  using Clock = FailureLimit::Clock;
  struct Counts {
    std::uint64_t wrong{0};
    std::uint64_t unread{0};  ///< Wrong ones that were refused with kTooMany.
  };

  /// @param token empty: the console is read-only.
  TokenGuard(std::string token, LogSink log)
      : token_(std::move(token)), log_(std::move(log)) {}

  /// @param token as sent; empty: none.
  /// @param origin the address that the request came from.
  Permission Check(std::string_view token, const std::string& origin,
                   Clock::time_point now = Clock::now());
  bool writable() const { return !token_.empty(); }
  Counts counts() const;

 private:
  const std::string token_;
  const LogSink log_;
  mutable Mutex mutex_;
  FailureLimit failures_ GUARDED_BY(mutex_){FailureLimit::WhenFull::kShare};
  Counts counts_ GUARDED_BY(mutex_);
};

}  // namespace fdi::console
