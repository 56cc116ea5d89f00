#include "monitor/console/console.h"

#include <array>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <random>

#include <httplib.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/error.h"
#include "monitor/http/request_head.h"
#include "report/shared_files.h"
#include "storage/history/history_reader.h"

namespace fdi::console {
namespace {

constexpr int kDaysOfWarning = 30;
constexpr std::size_t kMaxBody = std::size_t{16} * 1024;
constexpr const char* kPolicy =
    "default-src 'self'; img-src 'self' data:; base-uri 'none'; "
    "form-action 'none'; frame-ancestors 'none'";

// Browsers send the cookies of a host to all its ports and paths, and behind a
// proxy the consoles of many machines may have one host name. The name is that
// of this console also after a restart: a browser does not collect cookies.
std::string CookieName(const monitor::HttpAddress& address,
                       const std::filesystem::path& models) {
  std::array<char, 256> machine{};
  gethostname(machine.data(), machine.size() - 1);
  // The page of a plant has no models.
  const std::filesystem::path folder =
      models.empty() ? models : std::filesystem::absolute(models).parent_path();
  struct stat data {};
  stat(folder.c_str(), &data);  // Of containers, the path may be the same.
  std::string console = machine.data();
  console.append(" ")
      .append(ToString(address))
      .append(" ")
      .append(folder.string())
      .append(" " + std::to_string(data.st_dev))
      .append(" " + std::to_string(data.st_ino));
  char text[24];
  std::snprintf(text, sizeof text, "fdi_%016zx",
                std::hash<std::string>()(console));
  return text;
}

std::string NewInstance() {
  std::random_device random;
  char text[17];
  std::snprintf(text, sizeof text, "%08x%08x", random(), random());
  return text;
}

// What comes from a history, which may be on another host that answers slowly.
bool NeedsHistory(std::string_view path) {
  for (const std::string_view of :
       {"/api/v1/alarms", "/api/v1/history", "/api/v1/statistics",
        "/api/v1/shelf", "/api/v1/causes", "/api/v1/episodes/",
        "/api/v1/worklist", "/api/v1/report"}) {
    if (path.starts_with(of)) {
      return true;
    }
  }
  return path.starts_with("/api/v1/valves/") && path.ends_with("/health");
}

// Each stream occupies a thread; one more tells further clients that all are
// taken. Pictures are drawn by a program that uses a whole processor for a
// second. Requests for the history hold up no others.
std::vector<monitor::HttpLane> Lanes() {
  return {{StreamOptions{}.max_clients + 1, 16,
           [](std::string_view path) { return path == "/api/v1/stream"; }},
          {1, 8,  // Hashing a password takes 20 ms of a processor.
           [](std::string_view path) { return path == "/api/v1/login"; }},
          {1, 2,
           [](std::string_view path) {
             return path.starts_with("/api/v1/episodes/") &&
                    (path.ends_with(".svg") || path.ends_with(".png") ||
                     path.ends_with(".html"));
           }},
          {4, 32, NeedsHistory},
          {2}};
}

monitor::HttpServerOptions ServerOptions(const ConsoleOptions& options) {
  monitor::HttpServerOptions server;
  server.address = options.address;
  server.option = "--console";
  server.lanes = Lanes();
  server.max_body = kMaxBody;
  server.names = options.names;
  server.tls = options.tls;
  server.user_header = options.admission.proxy_header;
  return server;
}

}  // namespace

void Console::OnCommitted(const FaultEvent& event, bool persisted) {
  board_.AddMark(event);
  if (persisted) {
    stream_.Wake();
  } else {
    stream_.AddUnstored(event);
  }
}

void Console::OnEvent(const FaultEvent& event) {
  board_.AddMark(event);
  if (alarms_->OnEvent(event)) {
    stream_.AddUnstored(event);
  }
}

std::filesystem::path FindConsoleFiles(const std::filesystem::path& asked) {
  std::filesystem::path folder =
      asked.empty() ? report::SharedFile("console") : asked;
  if (!std::filesystem::is_regular_file(folder / "index.html")) {
    const std::string what = folder.string() +
                             ": no index.html there; expected the folder of "
                             "the page, PREFIX/share/fdi/console";
    if (asked.empty()) {
      throw DataError("console files " + what);
    }
    throw ConfigError("--console-files " + what);
  }
  return folder;
}

Console::Console(const ConsoleOptions& options,
                 const report::GlobalOptions& global, LogSink log)
    : server_(std::make_unique<monitor::HttpServer>(ServerOptions(options))),
      files_(FindConsoleFiles(options.files)),
      more_routes_(options.routes),
      log_(std::move(log)),
      access_(options.admission, log_),
      texts_(report::LoadFaultTexts(global)) {}

Console::~Console() {
  Close();
}

void Console::Start(ConsoleSources sources) {
  models_ = std::make_unique<StoredModels>(sources.models);
  alarms_ = std::make_unique<AlarmBook>(
      sources.plant_history
          ? sources.plant_history
          : [path = sources.history]() -> std::unique_ptr<storage::History> {
        return std::make_unique<storage::HistoryReader>(path);
      },
      texts_);
  api_ = std::make_unique<Api>(Api{std::move(sources), board_, stream_,
                                   *alarms_, *models_, texts_, access_,
                                   NewInstance(), stopping_.get_token()});
  SetDefaultResponses();
  RenewTls();
  httplib::Server& routes = server_->routes();
  access_.AddTo(routes, CookieName(server_->address(), api_->sources.models),
                server_->has_tls());
  for (const auto& group : {LiveRoutes(), HistoryRoutes(), more_routes_}) {
    AddRoutes(routes, *api_, group);
  }
  AddStreamRoute(routes, *api_);
  AddActionRoutes(routes, *api_);
  routes.set_mount_point("/", files_.string(), {{"Cache-Control", "no-cache"}});
  FeedParts parts{board_, *alarms_, texts_, api_->sources.utc_now_ns, log_};
  if (api_->sources.monitors) {
    parts.plant = [this] { return PlantJson(*api_); };
  }
  stream_.Start(std::move(parts));
  server_->Start();
  LogListenAddress();
}

void Console::LogListenAddress() const {
  const bool local = monitor::IsLoopback(server_->address().host);
  log_(local ? LogLevel::kInfo : LogLevel::kWarning,
       "console_listening address=" + ToString(server_->address()) +
           " access=" + (access_.writable() ? "users" : "read_only") +
           " tls=" + (server_->has_tls() ? "on" : "off") +
           (local ? "" : " open_to_network=yes"));
  if (!local && !server_->has_tls() && access_.writable()) {
    log_(LogLevel::kWarning,
         "console_unencrypted reason=\"passwords can be read on the network: "
         "give --console-tls, or listen on 127.0.0.1 behind a proxy "
         "with TLS\"");
  }
}

void Console::RenewTls() {
  if (const std::optional<int> days = server_->RenewTls()) {
    log_(LogLevel::kInfo, "console_certificate days=" + std::to_string(*days));
    if (*days < kDaysOfWarning) {
      log_(LogLevel::kWarning,
           "console_certificate_expires days=" + std::to_string(*days));
    }
  }
}

void Console::Reload() {
  const auto attempt = [this](const auto& reload) {
    try {
      reload();
    } catch (const std::exception& error) {
      log_(LogLevel::kError, "console_reload_failed reason=\"" +
                                 std::string(error.what()) + "\"");
    }
  };
  attempt([this] { RenewTls(); });
  attempt([this] { access_.Reload(); });
}

void Console::Stop() {
  stopping_.request_stop();
  stream_.Close();
  if (server_) {
    server_->Stop();
  }
}

void Console::Close() {
  // HTTP threads that serve a stream wait for its end, so streams end first.
  Stop();
  server_.reset();
  stream_.Stop();
}

void Console::SetDefaultResponses() {
  httplib::Server& routes = server_->routes();
  routes.set_default_headers({{"Content-Security-Policy", kPolicy},
                              {"X-Content-Type-Options", "nosniff"},
                              {"Referrer-Policy", "no-referrer"}});
  routes.set_error_handler(httplib::Server::HandlerWithResponse(
      [](const httplib::Request& request, httplib::Response& response) {
        if (response.body.empty()) {
          SendError(response, response.status,
                    request.path + (response.status == 404
                                        ? ": there is no such page"
                                        : ": this request cannot be answered"));
        }
        return httplib::Server::HandlerResponse::Handled;
      }));
}

}  // namespace fdi::console
