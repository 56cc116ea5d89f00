#pragma once

#include <chrono>
#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/mutex.h"
#include "monitor/console/failure_limit.h"
#include "monitor/console/users.h"

namespace fdi::console {

/// The authenticated sender of a request.
struct Visitor {
  std::string name;
  Role role{Role::kView};
};

/// The users who are logged in. A session ends when its user logs out or is
/// idle for 30 minutes, when the password changes or the user is removed, and
/// when 64 others have been used more recently. Thread safe.
class Logins {
 public:
  using Clock = FailureLimit::Clock;
  enum class Outcome { kAdmitted, kWrong, kTooMany };

  explicit Logins(Users users);

  /// Takes the time of hashing a password even if the name is unknown. Wrong
  /// passwords slow down further ones for the same name from the same address,
  /// and nobody else: behind a proxy, all share its address.
  /// @param origin client address.
  /// @param session set on success: the secret that the client presents.
  Outcome LogIn(const std::string& name, const std::string& password,
                const std::string& origin, std::string& session,
                Clock::time_point now = Clock::now());
  void LogOut(std::string_view session);
  /// The user of the session; resets its idle time.
  std::optional<Visitor> OfSession(std::string_view session,
                                   Clock::time_point now = Clock::now());
  /// The user of that name, authenticated by a proxy.
  std::optional<Visitor> OfName(std::string_view name) const;

  /// Replaces the users; sessions of changed or removed ones end.
  void Take(Users users);
  std::size_t sessions() const;

 private:
  struct Session {
    std::string secret;
    std::string name;
    std::string hash;  // The hash that the password matched.
    Clock::time_point used;
  };

  const std::string dummy_hash_;  // Dummy hash for unknown names; equally slow.
  mutable Mutex mutex_;
  Users users_ GUARDED_BY(mutex_);
  std::vector<Session> sessions_ GUARDED_BY(mutex_);
  FailureLimit failures_ GUARDED_BY(mutex_);
};

}  // namespace fdi::console
