#include "console/console.h"

#include <cstdio>
#include <filesystem>
#include <random>

#include <httplib.h>

#include "base/error.h"
#include "report/shared_files.h"
#include "storage/history/history_reader.h"

namespace fdi::console {
namespace {

constexpr std::size_t kMaxBody = std::size_t{16} * 1024;
constexpr const char* kPolicy =
    "default-src 'self'; img-src 'self' data:; base-uri 'none'; "
    "form-action 'none'; frame-ancestors 'none'";

std::string NewInstance() {
  std::random_device random;
  char text[17];
  std::snprintf(text, sizeof text, "%08x%08x", random(), random());
  return text;
}

// One for each stream and one that tells further clients that all places are
// taken; the requests for which Api has places; and all others.
constexpr std::size_t kThreads =
    StreamOptions{}.max_clients + 1 + kHistoryPlaces + kPicturePlaces + 6;

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
    : server_(std::make_unique<monitor::HttpServer>(monitor::HttpServerOptions{
          options.address, "--console", kThreads, kMaxBody,
          [this](const httplib::Request& request, httplib::Response& response) {
            return access_.Admit(request, response);
          }})),
      files_(FindConsoleFiles(options.files)),
      more_routes_(options.routes),
      log_(std::move(log)),
      access_(options.proxy_secret, log_),
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
      texts_, sources.models);
  // An Api can be neither moved nor copied, and Clang 14 does not initialise an
  // aggregate in make_unique().
  // NOLINTNEXTLINE(modernize-make-unique)
  api_.reset(new Api{std::move(sources), board_, stream_, *alarms_, *models_,
                     texts_, access_, NewInstance(), stopping_.get_token()});
  SetDefaultResponses();
  httplib::Server& routes = server_->routes();
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
  log_(LogLevel::kInfo,
       "console_listening address=" + ToString(server_->address()) +
           " access=" + (access_.writable() ? "proxy" : "read_only"));
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
