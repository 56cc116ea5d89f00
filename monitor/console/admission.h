#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>

#include "diagnosis/log.h"
#include "monitor/console/access.h"
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
  /// Holds the token of who may act on alarms; none: read-only.
  std::optional<std::filesystem::path> token_file;
  /// Instead of the token: who may do what, see LoadUsers().
  std::optional<std::filesystem::path> users_file;
  /// The header by which a proxy at this address says which of those users
  /// asks; empty: none does.
  std::string proxy_header;
  std::string proxy_address;
};

/// What was refused by reason and done by action since the start.
struct AdmissionCounts {
  TokenGuard::Counts tokens;
  std::map<std::string_view, std::uint64_t> refused;
  std::map<std::string_view, std::uint64_t> actions;
  std::optional<std::size_t> sessions;  ///< With users.
};

/// Decides what may be asked for and done, by whom. Without users, everybody
/// may read, and the token acts. With users, one has to log in for all but the
/// files of the page. Every action and every refusal is one line in the log, of
/// refusals at most 10 for each reason in 10 s. Thread safe.
class Admission {
 public:
  /// @throws ConfigError, DataError: what the files are not.
  Admission(const AdmissionOptions& options, LogSink log);

  /// Before every route, and those to log in and out. Before the server's
  /// start; `cookie`: its name.
  void AddTo(httplib::Server& server, const std::string& cookie);

  /// Who sent the request; nothing without users, or without a login.
  std::optional<Visitor> WhoSent(const httplib::Request& request);
  /// For an answer that goes on: whether its visitor is still admitted, by
  /// any thread.
  std::function<bool()> StillAdmits(const httplib::Request& request);
  /// Whether the visitor of the request may do anything.
  bool MayWrite(const httplib::Request& request);
  /// Whether it comes with a session, which can be ended.
  bool HasSession(const httplib::Request& request) const;
  /// Whether that may be done, by `who`, as the request says (may be empty).
  /// If not, it is answered. @param who becomes the name of the visitor.
  bool MayAct(const httplib::Request& request, httplib::Response& response,
              Role needed, std::string& who);
  /// Puts an action on record. @param subject "episode=...".
  void Acted(const httplib::Request& request, const char* action,
             const std::string& who, const std::string& subject);

  /// Whether somebody can act at all.
  bool writable() const { return logins_ || token_.writable(); }
  /// "token", "users" or "off".
  const char* mode() const;
  AdmissionCounts counts() const;

  /// Reads the users anew. @throws as the constructor; the old ones stay.
  void Reload();

 private:
  bool Admit(const httplib::Request& request, httplib::Response& response);
  void LogIn(const httplib::Request& request, httplib::Response& response);
  void LogOut(const httplib::Request& request, httplib::Response& response);
  bool FromProxy(const httplib::Request& request) const;
  std::string UserHeader(const httplib::Request& request) const;
  std::string SessionOf(const httplib::Request& request) const;
  void Note(const httplib::Request& request, std::string_view reason,
            const std::string& user = "");
  void Refuse(const httplib::Request& request, httplib::Response& response,
              int status, std::string_view reason, const std::string& what);

  const AdmissionOptions options_;
  const LogSink log_;
  TokenGuard token_;
  std::optional<Logins> logins_;
  std::string cookie_;
  monitor::LogLimit refusals_{{10, std::chrono::milliseconds(10'000)}};
  mutable std::mutex mutex_;
  AdmissionCounts counts_;
};

}  // namespace fdi::console
