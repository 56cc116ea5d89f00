#pragma once

#include <chrono>
#include <cstddef>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "monitor/console/access.h"
#include "monitor/console/users.h"

namespace fdi::console {

/// Who asks for something.
struct Visitor {
  std::string name;
  Role role{Role::kView};
};

/// Who is logged in. A session ends when its user logs out or does nothing for
/// 30 minutes, when the user's password changes or the user is removed, and
/// when 64 others were used later. Thread safe.
class Logins {
 public:
  using Clock = FailureLimit::Clock;
  enum class Outcome { kAdmitted, kWrong, kTooMany };

  explicit Logins(Users users);

  /// Takes the time that a password's hash takes, for an unknown name, too.
  /// @param origin the address: see FailureLimit.
  /// @param session is set if admitted: what the client has to show.
  Outcome LogIn(const std::string& name, const std::string& password,
                const std::string& origin, std::string& session,
                Clock::time_point now = Clock::now());
  void LogOut(std::string_view session);
  /// The user of the session, which is used by that.
  std::optional<Visitor> OfSession(std::string_view session,
                                   Clock::time_point now = Clock::now());
  /// The user of that name, whom somebody else has examined.
  std::optional<Visitor> OfName(std::string_view name) const;

  /// From now on these; the sessions of the others end.
  void Take(Users users);
  std::size_t sessions() const;

 private:
  struct Session {
    std::string secret;
    std::string name;
    std::string hash;  // That the password fitted.
    Clock::time_point used;
  };

  const std::string nobody_;  // A hash that takes as long as the others.
  mutable std::mutex mutex_;
  Users users_;
  std::vector<Session> sessions_;
  FailureLimit failures_;
};

}  // namespace fdi::console
