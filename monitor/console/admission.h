#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "base/log.h"
#include "base/mutex.h"
#include "monitor/console/logins.h"
#include "monitor/throttled_log.h"

namespace httplib {
class Server;
struct Request;
struct Response;
}  // namespace httplib

namespace fdi::console {

/// Settings of Admission.
struct AdmissionOptions {
  /// File of users and roles, see LoadUsers(); none: read-only.
  std::optional<std::filesystem::path> users_file;
  /// Header in which the proxy at proxy_address names the user of a request;
  /// empty: no proxy.
  std::string proxy_header;
  std::string proxy_address;
};

/// Refusals by reason and actions by kind, since the start.
struct AdmissionCounts {
  std::map<std::string_view, std::uint64_t> refused;
  std::map<std::string_view, std::uint64_t> actions;
  std::optional<std::size_t> sessions;  ///< With users.
};

/// Decides who may read and who may act. Without users, everybody may read and
/// nobody may act. With users, everything except the files of the page requires
/// a login or a proxy that names the user. Each action and each refusal is
/// logged in one line; refusals are limited to 10 per reason in 10 s. Thread
/// safe.
class Admission {
 public:
  /// @throws ConfigError, DataError if a file is invalid.
  Admission(const AdmissionOptions& options, LogSink log);

  /// Installs a check before every route, and the login and logout routes. Call
  /// before the server starts.
  /// @param cookie name of the session cookie, another one for each console.
  /// @param https whether the server speaks nothing else.
  void AddTo(httplib::Server& server, const std::string& cookie, bool https);

  /// The sender of the request; nothing without users or without a login.
  std::optional<Visitor> Authenticate(const httplib::Request& request);
  /// For streaming responses: a function that tells whether the visitor is
  /// still admitted; callable from any thread.
  std::function<bool()> AdmissionCheck(const httplib::Request& request);
  /// Whether the visitor may perform any action at all.
  bool MayWrite(const httplib::Request& request);
  /// Whether the request carries a session, which can be logged out.
  bool HasSession(const httplib::Request& request) const;
  /// Whether `who`, as named in the request (may be empty), may perform the
  /// action; if not, an error response is sent. @param who is set to the
  /// visitor's name.
  bool Authorize(const httplib::Request& request, httplib::Response& response,
                 Role needed, std::string& who);
  /// Records an action in log and counters. @param subject "episode=...".
  void LogAction(const httplib::Request& request, const char* action,
                 const std::string& who, const std::string& subject);

  /// Whether anybody can act at all.
  bool writable() const { return logins_.has_value(); }
  AdmissionCounts counts() const;

  /// Reloads the users. @throws as the constructor; then the old ones stay.
  void Reload();

 private:
  bool Admit(const httplib::Request& request, httplib::Response& response);
  void LogIn(const httplib::Request& request, httplib::Response& response);
  void LogOut(const httplib::Request& request, httplib::Response& response);
  bool IsSameOrigin(const httplib::Request& request) const;
  bool FromProxy(const httplib::Request& request) const;
  std::string UserHeader(const httplib::Request& request) const;
  std::string SessionOf(const httplib::Request& request) const;
  void LogRefusal(const httplib::Request& request, std::string_view reason,
                  const std::string& user = "");
  void Refuse(const httplib::Request& request, httplib::Response& response,
              int status, std::string_view reason, const std::string& what);

  const AdmissionOptions options_;
  const LogSink log_;
  std::optional<Logins> logins_;
  std::string cookie_;
  bool https_{false};
  monitor::LogLimit refusals_{{10, std::chrono::milliseconds(10'000)}};
  mutable Mutex mutex_;
  AdmissionCounts counts_ GUARDED_BY(mutex_);
};

}  // namespace fdi::console
