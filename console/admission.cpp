#include "console/admission.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <fstream>
#include <utility>

#include <httplib.h>

#include "base/error.h"
#include "console/api.h"
#include "monitor/http/http_server.h"

namespace fdi::console {
namespace {

constexpr const char* kSecretHeader = "X-FDI-Secret";
constexpr std::array<const char*, 3> kRoles{"view", "acknowledge", "engineer"};
constexpr std::size_t kMaxName = 64;
constexpr std::size_t kMinSecret = 32;  // 128 bits in hexadecimal digits.
constexpr std::size_t kMaxSecret = 256;
constexpr std::size_t kShownPath = 200;

// Quotes untrusted text as one word of a log line.
std::string Quoted(const std::string& text) {
  return Json(text).dump(-1, ' ', true, Json::error_handler_t::replace);
}

std::string ReadSecret(const std::filesystem::path& path) {
  if (path.empty()) {
    return {};
  }
  const std::string name = "--console-proxy " + path.string();
  std::ifstream file(path);
  std::string secret;
  if (!std::getline(file, secret)) {
    throw DataError(name + ": cannot be read, or is empty");
  }
  using std::filesystem::perms;
  constexpr perms kOfOthers = perms::group_write | perms::others_all;
  if ((std::filesystem::status(path).permissions() & kOfOthers) !=
      perms::none) {
    throw ConfigError(name +
                      ": others can read or change it; expected a file "
                      "with mode 0640 or 0600");
  }
  if (secret.size() < kMinSecret || secret.size() > kMaxSecret ||
      !std::ranges::all_of(
          secret, [](unsigned char c) { return std::isalnum(c) != 0; })) {
    throw ConfigError(name +
                      ": expected one line of 32 to 256 letters and "
                      "digits, as openssl rand -hex 32 makes it");
  }
  return secret;
}

// In a time that does not tell how much of a guess is right.
bool SameSecret(const std::string& given, const std::string& secret) {
  unsigned differs = given.size() == secret.size() ? 0 : 1;
  for (std::size_t i = 0; i < given.size(); ++i) {
    differs |= static_cast<unsigned char>(given[i]) ^
               static_cast<unsigned char>(secret[i % secret.size()]);
  }
  return differs == 0;
}

// True if a page of this server sent the request: browsers state the origin of
// each POST, and scripts cannot forge it. Where the browser uses https, a page
// of http is another one, which anybody on the way can fill.
bool IsSameOrigin(const httplib::Request& request) {
  const std::string origin = request.get_header_value("Origin");
  const std::string host = request.get_header_value("Host");
  const bool https = request.get_header_value("X-Forwarded-Proto") == "https";
  return origin == "https://" + host || (!https && origin == "http://" + host);
}

}  // namespace

const char* RoleName(Role role) {
  return kRoles[static_cast<std::size_t>(role)];
}

Admission::Admission(const std::filesystem::path& secret_file, LogSink log)
    : secret_(ReadSecret(secret_file)), log_(std::move(log)) {}

// A proxy whose secret is wrong must not pass for a program of this machine:
// its requests are refused, not answered without a user.
bool Admission::Admit(const httplib::Request& request,
                      httplib::Response& response) {
  if (FromProxy(request)) {
    if (!VisitorOf(request)) {
      Refuse(request, response, "proxy_user",
             "the proxy names no user with a role of view, acknowledge or "
             "engineer");
      return false;
    }
    // Without the proxy nothing can be changed, whoever asks.
    if (request.method == "POST" && !IsSameOrigin(request)) {
      Refuse(request, response, "origin",
             "Origin: expected the address of this page, " +
                 request.get_header_value("Host") + ", with its https or http");
      return false;
    }
    return true;
  }
  if (request.has_header(kSecretHeader)) {
    Refuse(request, response, "proxy_secret",
           "X-FDI-Secret: expected the secret of --console-proxy");
    return false;
  }
  if (!monitor::IsLoopback(request.get_header_value("Host"))) {
    Refuse(request, response, "host",
           "Host: expected localhost or an address of loopback");
    return false;
  }
  return true;
}

bool Admission::FromProxy(const httplib::Request& request) const {
  return !secret_.empty() &&
         SameSecret(request.get_header_value(kSecretHeader), secret_);
}

std::optional<Visitor> Admission::VisitorOf(
    const httplib::Request& request) const {
  if (!FromProxy(request)) {
    return std::nullopt;
  }
  const std::string name = request.get_header_value("X-FDI-User");
  const auto* const role =
      std::ranges::find(kRoles, request.get_header_value("X-FDI-Role"));
  if (name.empty() || name.size() > kMaxName || role == kRoles.end()) {
    return std::nullopt;
  }
  return Visitor{name, static_cast<Role>(role - kRoles.begin())};
}

bool Admission::MayWrite(const httplib::Request& request) const {
  const std::optional<Visitor> visitor = VisitorOf(request);
  return visitor && visitor->role >= Role::kAcknowledge;
}

std::string Admission::AddressOf(const httplib::Request& request) const {
  const std::string behind = request.get_header_value("X-Real-IP");
  return FromProxy(request) && !behind.empty() &&
                 behind.find_first_not_of("0123456789abcdefABCDEF.:") ==
                     std::string::npos
             ? behind
             : request.remote_addr;
}

bool Admission::Authorize(const httplib::Request& request,
                          httplib::Response& response, Role needed,
                          std::string& who) {
  const std::optional<Visitor> visitor = VisitorOf(request);
  if (!visitor) {
    Refuse(request, response, "read_only",
           "this address is read-only: to act, come through the proxy "
           "(docs/console.md, The page beyond this host)");
    return false;
  }
  if (visitor->role < needed) {
    Refuse(request, response, "role",
           visitor->name + " has the role " + RoleName(visitor->role) +
               "; expected " + RoleName(needed));
    return false;
  }
  if (!who.empty() && who != visitor->name) {
    Refuse(request, response, "name",
           "who: expected " + visitor->name + ", who is logged in");
    return false;
  }
  who = visitor->name;
  return true;
}

// `action`, and `reason` below, are string literals: the counts keep views of
// them.
void Admission::LogAction(const httplib::Request& request, const char* action,
                          const std::string& subject) {
  const Visitor visitor = VisitorOf(request).value();
  std::string line = "console_action user=" + Quoted(visitor.name) + " role=";
  line.append(RoleName(visitor.role))
      .append(" action=")
      .append(action)
      .append(" ")
      .append(subject)
      .append(" from=")
      .append(AddressOf(request));
  log_(LogLevel::kInfo, line);
  const MutexLock lock(mutex_);
  ++counts_.actions[action];
}

void Admission::LogRefusal(const httplib::Request& request,
                           std::string_view reason) {
  {
    const MutexLock lock(mutex_);
    ++counts_.refused[reason];
  }
  // The limit is for lines only: every refusal has been counted.
  std::uint64_t not_shown = 0;
  if (!refusals_.Admit(reason, not_shown)) {
    return;
  }
  std::string line = "console_refused reason=";
  line.append(reason)
      .append(" user=")
      .append(
          Quoted(request.get_header_value("X-FDI-User").substr(0, kShownPath)))
      .append(" method=")
      .append(request.method)
      .append(" path=")
      .append(Quoted(request.path.substr(0, kShownPath)))
      .append(" from=")
      .append(AddressOf(request));
  if (not_shown > 0) {
    line.append(" not_shown=").append(std::to_string(not_shown));
  }
  log_(LogLevel::kWarning, line);
}

void Admission::Refuse(const httplib::Request& request,
                       httplib::Response& response, std::string_view reason,
                       const std::string& what) {
  LogRefusal(request, reason);
  response.set_header("Cache-Control", "no-store");
  SendError(response, 403, what);
}

AdmissionCounts Admission::counts() const {
  const MutexLock lock(mutex_);
  return counts_;
}

}  // namespace fdi::console
