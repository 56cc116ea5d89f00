#include "monitor/console/logins.h"

#include <algorithm>
#include <utility>

namespace fdi::console {
namespace {

constexpr std::chrono::minutes kIdleLimit{30};
constexpr std::size_t kMaxSessions = 64;

}  // namespace

Logins::Logins(Users users)
    : dummy_hash_(HashPassword(RandomToken())), users_(std::move(users)) {}

Logins::Outcome Logins::LogIn(const std::string& name,
                              const std::string& password,
                              const std::string& origin, std::string& session,
                              Clock::time_point now) {
  std::string hash = dummy_hash_;
  const std::string asked = origin + ' ' + name.substr(0, kMaxName);
  {
    const MutexLock lock(mutex_);
    if (!failures_.Allows(asked, now)) {
      return Outcome::kTooMany;
    }
    const auto user = users_.find(name);
    if (user != users_.end() && user->second.hash != "*") {
      hash = user->second.hash;
    }
  }
  const bool fits = PasswordFits(password, hash) && hash != dummy_hash_;
  const MutexLock lock(mutex_);
  const auto user = users_.find(name);  // May have changed during the hash.
  if (!fits || user == users_.end() || user->second.hash != hash) {
    failures_.Add(asked, now);
    return Outcome::kWrong;
  }
  if (sessions_.size() >= kMaxSessions) {
    sessions_.erase(std::min_element(
        sessions_.begin(), sessions_.end(),
        [](const Session& a, const Session& b) { return a.used < b.used; }));
  }
  session = RandomToken();
  sessions_.push_back({session, name, std::move(hash), now});
  return Outcome::kAdmitted;
}

void Logins::LogOut(std::string_view session) {
  const MutexLock lock(mutex_);
  std::erase_if(sessions_, [session](const Session& each) {
    return SameSecret(session, each.secret);
  });
}

std::optional<Visitor> Logins::OfSession(std::string_view session,
                                         Clock::time_point now) {
  const MutexLock lock(mutex_);
  std::erase_if(sessions_, [now](const Session& each) {
    return now - each.used >= kIdleLimit;
  });
  for (Session& each : sessions_) {
    if (SameSecret(session, each.secret)) {
      each.used = now;
      return Visitor{each.name, users_.find(each.name)->second.role};
    }
  }
  return std::nullopt;
}

std::optional<Visitor> Logins::OfName(std::string_view name) const {
  const MutexLock lock(mutex_);
  const auto user = users_.find(name);
  return user == users_.end()
             ? std::nullopt
             : std::optional(Visitor{user->first, user->second.role});
}

void Logins::Take(Users users) {
  const MutexLock lock(mutex_);
  users_ = std::move(users);
  std::erase_if(sessions_, [this](const Session& each) REQUIRES(mutex_) {
    const auto user = users_.find(each.name);
    return user == users_.end() || user->second.hash != each.hash;
  });
}

std::size_t Logins::sessions() const {
  const MutexLock lock(mutex_);
  return sessions_.size();
}

}  // namespace fdi::console
