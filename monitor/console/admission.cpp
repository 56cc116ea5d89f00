#include "monitor/console/admission.h"

#include <utility>

#include <httplib.h>

#include "base/error.h"
#include "monitor/console/api.h"

namespace fdi::console {
namespace {

constexpr const char* kApi = "/api/";
constexpr const char* kLogIn = "/api/v1/login";
constexpr const char* kNoSession = "expected a session: POST /api/v1/login";
constexpr std::size_t kShownPath = 200;

// Quotes untrusted text as one word of a log line.
std::string Quoted(const std::string& text) {
  return Json(text).dump(-1, ' ', true, Json::error_handler_t::replace);
}

// "10.0.0.1" for "::ffff:10.0.0.1", the form used by dual-stack sockets.
std::string_view PlainAddress(std::string_view address) {
  constexpr std::string_view kMapped = "::ffff:";
  return address.starts_with(kMapped) ? address.substr(kMapped.size())
                                      : address;
}

}  // namespace

Admission::Admission(const AdmissionOptions& options, LogSink log)
    : options_(options), log_(std::move(log)) {
  Reload();
}

void Admission::Reload() {
  if (!options_.users_file) {
    return;
  }
  Users users = LoadUsers(*options_.users_file);
  log_(LogLevel::kInfo, "console_users file=" + options_.users_file->string() +
                            " users=" + std::to_string(users.size()));
  if (logins_) {
    logins_->Take(std::move(users));
  } else {
    logins_.emplace(std::move(users));
  }
}

void Admission::AddTo(httplib::Server& server, const std::string& cookie,
                      bool https) {
  // Without users nothing can be changed, so no page has to prove its origin.
  if (!logins_) {
    return;
  }
  cookie_ = cookie;
  https_ = https;
  using Handler = httplib::Server::HandlerResponse;
  server.set_pre_routing_handler(
      [this](const httplib::Request& request, httplib::Response& response) {
        return Admit(request, response) ? Handler::Unhandled : Handler::Handled;
      });
  server.Post(kLogIn, [this](const httplib::Request& request,
                             httplib::Response& response) {
    Guarded(response, [&] { LogIn(request, response); });
  });
  server.Post("/api/v1/logout", [this](const httplib::Request& request,
                                       httplib::Response& response) {
    Guarded(response, [&] { LogOut(request, response); });
  });
}

// The order of the checks: the header of a stranger is only logged, and the
// request then counts as one without it. The origin is checked before the
// exception for the login, because a foreign page could otherwise log its
// visitor in under another name. Only POST changes anything, so GET needs no
// origin.
bool Admission::Admit(const httplib::Request& request,
                      httplib::Response& response) {
  if (!UserHeader(request).empty() && !FromProxy(request)) {
    LogRefusal(request, "proxy_header", UserHeader(request));
  }
  if (request.method == "POST" && !IsSameOrigin(request)) {
    Refuse(request, response, 403, "origin",
           "Origin: expected the address of this page, " +
               request.get_header_value("Host") + ", with its https or http");
    return false;
  }
  if (!request.path.starts_with(kApi) || request.path == kLogIn ||
      Authenticate(request)) {
    return true;
  }
  if (FromProxy(request)) {
    Refuse(request, response, 403, "proxy_user",
           "the proxy names a user who is not in the file of --console-users");
  } else {
    Refuse(request, response, 401, "no_session", kNoSession);
  }
  return false;
}

// Whether a page of this server sent the request: browsers state the origin of
// each POST, and scripts cannot forge it. Where the browser uses https, to us
// or to a proxy that says so, a page of http is another one, which anybody on
// the way can fill. The HTTP server has checked Host before (HostAllowed()).
bool Admission::IsSameOrigin(const httplib::Request& request) const {
  const std::string origin = request.get_header_value("Origin");
  const std::string host = request.get_header_value("Host");
  const bool https =
      https_ || request.get_header_value("X-Forwarded-Proto") == "https";
  return origin == "https://" + host || (!https && origin == "http://" + host);
}

bool Admission::FromProxy(const httplib::Request& request) const {
  return !UserHeader(request).empty() &&
         PlainAddress(request.remote_addr) ==
             PlainAddress(options_.proxy_address);
}

std::string Admission::UserHeader(const httplib::Request& request) const {
  return options_.proxy_header.empty()
             ? std::string()
             : request.get_header_value(options_.proxy_header.c_str());
}

// "a=1; NAME=SECRET; b=2"
std::string Admission::SessionOf(const httplib::Request& request) const {
  // The separator in front makes the first cookie look like the others: a
  // cookie whose name only ends in ours is not found.
  const std::string cookies = "; " + request.get_header_value("Cookie");
  const std::size_t begin = cookies.find("; " + cookie_ + "=");
  if (begin == std::string::npos) {
    return {};
  }
  const std::size_t from = begin + cookie_.size() + 3;
  return cookies.substr(from, cookies.find(';', from) - from);
}

std::optional<Visitor> Admission::Authenticate(
    const httplib::Request& request) {
  if (!logins_) {
    return std::nullopt;
  }
  return FromProxy(request) ? logins_->OfName(UserHeader(request))
                            : logins_->OfSession(SessionOf(request));
}

std::function<bool()> Admission::AdmissionCheck(
    const httplib::Request& request) {
  if (!logins_) {
    return [] { return true; };
  }
  // By value: the function is called long after the request has gone.
  if (FromProxy(request)) {
    return [this, name = UserHeader(request)] {
      return logins_->OfName(name).has_value();
    };
  }
  return [this, session = SessionOf(request)] {
    return logins_->OfSession(session).has_value();
  };
}

bool Admission::HasSession(const httplib::Request& request) const {
  return logins_ && !FromProxy(request);
}

bool Admission::MayWrite(const httplib::Request& request) {
  const std::optional<Visitor> visitor = Authenticate(request);
  return visitor && visitor->role >= Role::kAcknowledge;
}

void Admission::LogIn(const httplib::Request& request,
                      httplib::Response& response) {
  const Json body = Json::parse(request.body, nullptr, false);
  const bool texts = body.is_object() && body.contains("user") &&
                     body["user"].is_string() && body.contains("password") &&
                     body["password"].is_string();
  if (!texts) {
    throw ConfigError(R"(the body: expected {"user": TEXT, "password": TEXT})");
  }
  const std::string name = body["user"];
  std::string session;
  switch (logins_->LogIn(name, body["password"].get<std::string>(),
                         request.remote_addr, session)) {
    case Logins::Outcome::kTooMany:
      response.set_header("Retry-After", "1");
      return Refuse(request, response, 429, "slowed",
                    "too many wrong passwords for this name came from this "
                    "address: one attempt per second is looked at");
    case Logins::Outcome::kWrong:
      LogRefusal(request, "password", name);
      return SendError(response, 401, "the name or the password is wrong");
    case Logins::Outcome::kAdmitted:
      break;
  }
  // A browser that logs in again replaces its cookie. Its old session would be
  // usable until it expires and take one of the places.
  logins_->LogOut(SessionOf(request));
  // https may end at a proxy that does not say so.
  const bool secure =
      request.get_header_value("Origin").starts_with("https://");
  response.set_header("Set-Cookie", cookie_ + "=" + session +
                                        "; Path=/; HttpOnly; SameSite=Strict" +
                                        (secure ? "; Secure" : ""));
  LogAction(request, "login", name, "");
  SendJson(response, {{"user", name}});
}

void Admission::LogOut(const httplib::Request& request,
                       httplib::Response& response) {
  const std::optional<Visitor> visitor = Authenticate(request);
  logins_->LogOut(SessionOf(request));
  LogAction(request, "logout", visitor ? visitor->name : "", "");
  response.set_header("Set-Cookie", cookie_ + "=; Path=/; Max-Age=0; HttpOnly");
  SendJson(response, Json::object());
}

bool Admission::Authorize(const httplib::Request& request,
                          httplib::Response& response, Role needed,
                          std::string& who) {
  if (const std::optional<Visitor> visitor = Authenticate(request)) {
    if (visitor->role < needed) {
      Refuse(request, response, 403, "role",
             visitor->name + " has the role " + RoleName(visitor->role) +
                 "; expected " + RoleName(needed));
      return false;
    }
    if (!who.empty() && who != visitor->name) {
      Refuse(request, response, 403, "name",
             "who: expected " + visitor->name + ", who is logged in");
      return false;
    }
    who = visitor->name;
    return true;
  }
  if (logins_) {  // The session has ended since Admit().
    Refuse(request, response, 401, "no_session", kNoSession);
  } else {
    Refuse(request, response, 403, "read_only",
           "this console is read-only: start the monitor with "
           "--console-users FILE");
  }
  return false;
}

// `action`, and `reason` below, are string literals: the counts keep views of
// them.
void Admission::LogAction(const httplib::Request& request, const char* action,
                          const std::string& who, const std::string& subject) {
  const auto visitor = logins_ ? logins_->OfName(who) : std::nullopt;
  std::string line = "console_action user=" + Quoted(who) + " role=";
  line.append(visitor ? RoleName(visitor->role) : "none")
      .append(" action=")
      .append(action)
      .append(subject.empty() ? "" : " ")
      .append(subject)
      .append(" from=")
      .append(request.remote_addr);
  log_(LogLevel::kInfo, line);
  const MutexLock lock(mutex_);
  ++counts_.actions[action];
}

void Admission::LogRefusal(const httplib::Request& request,
                           std::string_view reason, const std::string& user) {
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
      .append(Quoted(user.substr(0, kShownPath)))
      .append(" method=")
      .append(request.method)
      .append(" path=")
      .append(Quoted(request.path.substr(0, kShownPath)))
      .append(" from=")
      .append(request.remote_addr);
  if (not_shown > 0) {
    line.append(" not_shown=").append(std::to_string(not_shown));
  }
  log_(LogLevel::kWarning, line);
}

void Admission::Refuse(const httplib::Request& request,
                       httplib::Response& response, int status,
                       std::string_view reason, const std::string& what) {
  const std::optional<Visitor> visitor = Authenticate(request);
  LogRefusal(request, reason,
             visitor              ? visitor->name
             : FromProxy(request) ? UserHeader(request)
                                  : "");
  response.set_header("Cache-Control", "no-store");
  SendError(response, status, what);
}

AdmissionCounts Admission::counts() const {
  AdmissionCounts counts;
  {
    const MutexLock lock(mutex_);
    counts = counts_;
  }
  if (logins_) {
    counts.sessions = logins_->sessions();
  }
  return counts;
}

}  // namespace fdi::console
