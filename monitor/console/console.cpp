#include "monitor/console/console.h"

#include <random>

#include <httplib.h>

#include "cli/shared_files.h"
#include "diagnosis/error.h"
#include "monitor/console/access.h"

namespace fdi::console {
namespace {

// Streams take a thread each; what is left answers all the rest.
constexpr std::size_t kAnsweringThreads = 4;
constexpr std::size_t kMaxBody = 16 * 1024;
constexpr const char* kPolicy =
    "default-src 'self'; img-src 'self' data:; base-uri 'none'; "
    "form-action 'none'; frame-ancestors 'none'";

std::string NewInstance() {
  std::random_device random;
  char text[17];
  std::snprintf(text, sizeof text, "%08x%08x", random(), random());
  return text;
}

std::string Reason(int status) {
  switch (status) {
    case 404:
      return "there is no such page";
    case 413:
      return "the body has more than " + std::to_string(kMaxBody) + " bytes";
    default:
      return "this request cannot be answered";
  }
}

}  // namespace

// Shows events that went to the bus.
class Console::Events : public monitor::EventSink {
 public:
  Events(monitor::EventSink& bus, Console& console)
      : bus_(bus), console_(console) {}

  bool Publish(const FaultEvent& event, bool persisted) override {
    const bool sent = bus_.Publish(event, persisted);
    console_.board_.Mark(event);
    if (persisted) {
      console_.stream_.Wake();
    } else {
      console_.stream_.AddUnstored(event);
    }
    return sent;
  }

 private:
  monitor::EventSink& bus_;
  Console& console_;
};

std::filesystem::path FindConsoleFiles(const std::filesystem::path& asked) {
  const std::filesystem::path folder =
      asked.empty() ? cli::SharedFile("console") : asked;
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
                 const cli::GlobalOptions& global, LogSink log)
    : server_(std::make_unique<monitor::HttpServer>(monitor::HttpServerOptions{
          options.address, "--console",
          StreamOptions{}.max_clients + kAnsweringThreads, kMaxBody})),
      files_(FindConsoleFiles(options.files)),
      token_(options.token_file ? LoadToken(*options.token_file) : ""),
      texts_(cli::LoadFaultTexts(global)),
      log_(std::move(log)) {
  if (options.token_file) {
    log_(LogLevel::kInfo, "console_token file=" + options.token_file->string());
  }
}

Console::~Console() {
  Close();
}

monitor::EventSink& Console::Before(monitor::EventSink& bus) {
  events_ = std::make_unique<Events>(bus, *this);
  return *events_;
}

void Console::Start(ConsoleSources sources) {
  models_ = std::make_unique<StoredModels>(sources.models);
  alarms_ = std::make_unique<AlarmBook>(sources.history, texts_);
  api_ = std::make_unique<Api>(Api{std::move(sources), board_, stream_,
                                   *alarms_, *models_, work_list_, texts_,
                                   token_, NewInstance()});
  SetRulesOfEveryAnswer();
  httplib::Server& routes = server_->routes();
  for (const auto group : {LiveRoutes(), HistoryRoutes(), PlannerRoutes()}) {
    AddRoutes(routes, *api_, group);
  }
  AddStreamRoute(routes, *api_);
  AddActionRoutes(routes, *api_);
  routes.set_mount_point("/", files_.string(), {{"Cache-Control", "no-cache"}});
  stream_.Start({board_, *alarms_, texts_, api_->sources.utc_now_ns, log_});
  server_->Start();
  const std::string& host = server_->address().host;
  log_(IsLoopback(host) ? LogLevel::kInfo : LogLevel::kWarning,
       "console_listening address=" + ToString(server_->address()) +
           " write=" + (token_.empty() ? "off" : "on") +
           (IsLoopback(host) ? "" : " open_to_network=yes"));
}

void Console::Stop() {
  stream_.Close();
  if (server_) {
    server_->Stop();
  }
}

void Console::Close() {
  // HTTP threads that write to a stream wait for its end, so that comes first.
  Stop();
  server_.reset();
  stream_.Stop();
}

void Console::SetRulesOfEveryAnswer() {
  httplib::Server& routes = server_->routes();
  routes.set_tcp_nodelay(true);
  routes.set_default_headers({{"Content-Security-Policy", kPolicy},
                              {"X-Content-Type-Options", "nosniff"},
                              {"Referrer-Policy", "no-referrer"}});
  routes.set_pre_routing_handler([host = server_->address().host](
                                     const httplib::Request& request,
                                     httplib::Response& response) {
    if (HostAllowed(request.get_header_value("Host"), host)) {
      return httplib::Server::HandlerResponse::Unhandled;
    }
    SendError(response, 403, "Host: expected localhost or a loopback address");
    return httplib::Server::HandlerResponse::Handled;
  });
  routes.set_error_handler(httplib::Server::HandlerWithResponse(
      [](const httplib::Request& request, httplib::Response& response) {
        if (response.body.empty()) {
          SendError(response, response.status,
                    request.path + ": " + Reason(response.status));
        }
        return httplib::Server::HandlerResponse::Handled;
      }));
}

}  // namespace fdi::console
