#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "base/log.h"
#include "base/mutex.h"
#include "monitor/throttled_log.h"

namespace httplib {
struct Request;
struct Response;
}  // namespace httplib

namespace fdi::console {

/// Permissions of a user; each role includes the ones before it.
enum class Role : std::uint8_t {
  kView,         ///< Read everything.
  kAcknowledge,  ///< Acknowledge, shelve, take off the shelf.
  kEngineer,     ///< Label.
};

/// "view", "acknowledge", "engineer"
const char* RoleName(Role role);

/// Who sent a request, as the proxy says.
struct Visitor {
  std::string name;
  Role role{Role::kView};
};

/// Refusals by reason and actions by kind, since the start.
struct AdmissionCounts {
  std::map<std::string_view, std::uint64_t> refused;
  std::map<std::string_view, std::uint64_t> actions;
};

/// Decides who may act. Whoever reaches loopback reads everything and changes
/// nothing. A proxy in front proves itself by a secret in the header
/// X-FDI-Secret and names user, role and address in X-FDI-User, X-FDI-Role and
/// X-Real-IP. Each action and each refusal is logged in one line; refusals are
/// limited to 10 per reason in 10 s. Thread safe.
class Admission {
 public:
  /// @param secret_file holds 32 to 256 letters and digits; empty: no proxy.
  /// @throws ConfigError if the file holds anything else, or if others can read
  ///   it; DataError if it cannot be read.
  Admission(const std::filesystem::path& secret_file, LogSink log);

  /// True if a request may go on to its page; otherwise it is answered. A
  /// request to change something must come from this page itself.
  bool Admit(const httplib::Request& request, httplib::Response& response);

  /// Nothing where no proxy names one.
  std::optional<Visitor> VisitorOf(const httplib::Request& request) const;
  /// True if the visitor may perform any action at all.
  bool MayWrite(const httplib::Request& request) const;
  /// True if `who`, as named in the request (may be empty), may perform the
  /// action; if not, an error response is sent. @param who is set to the
  /// visitor's name.
  bool Authorize(const httplib::Request& request, httplib::Response& response,
                 Role needed, std::string& who);
  /// Records an action in log and counters. @param subject "episode=...".
  void LogAction(const httplib::Request& request, const char* action,
                 const std::string& subject);
  /// The address of the client, behind the proxy if there is one.
  std::string AddressOf(const httplib::Request& request) const;

  /// True if anybody can act at all.
  bool writable() const { return !secret_.empty(); }
  AdmissionCounts counts() const;

 private:
  bool FromProxy(const httplib::Request& request) const;
  void LogRefusal(const httplib::Request& request, std::string_view reason);
  void Refuse(const httplib::Request& request, httplib::Response& response,
              std::string_view reason, const std::string& what);

  const std::string secret_;
  const LogSink log_;
  monitor::LogLimit refusals_{{10, std::chrono::milliseconds(10'000)}};
  mutable Mutex mutex_;
  AdmissionCounts counts_ GUARDED_BY(mutex_);
};

}  // namespace fdi::console
