#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "base/log.h"
#include "console/admission.h"
#include "console/api.h"
#include "monitor/http/http_server.h"
#include "monitor/sinks.h"

namespace fdi::console {

/// Settings of Console.
struct ConsoleOptions {
  monitor::HttpAddress address;
  /// Folder of the page; empty: the one installed with the program.
  std::filesystem::path files;
  std::filesystem::path proxy_secret{};  ///< See Admission.
  std::vector<Route> routes{};  ///< Beside its own: of optional components.
};

/// The folder with index.html. @throws ConfigError naming `asked`, or DataError
/// if nothing was asked for and nothing is installed.
std::filesystem::path FindConsoleFiles(const std::filesystem::path& asked);

/// The live page of a monitor and its API (docs/console.md): shows what the
/// pipeline passes to live(), reads the history, and performs the actions that
/// Admission permits. Alternatively the page of a plant, which shows what was
/// heard on the bus. Has threads of its own, for none of which diagnosis or bus
/// ever wait.
class Console {
 public:
  /// Binds the address and finds the page's files; nothing is served yet.
  /// @throws ConfigError, DataError, NotFoundError, std::runtime_error
  Console(const ConsoleOptions& options, const report::GlobalOptions& global,
          LogSink log);
  /// Calls Close().
  ~Console();
  Console(const Console&) = delete;
  Console& operator=(const Console&) = delete;

  /// Fed by the pipeline, or from the bus for a plant.
  LiveBoard& live() { return board_; }
  /// Shows an event, which is in the history if `persisted`.
  void OnCommitted(const FaultEvent& event, bool persisted);

  /// For a plant: a model set or an event from the bus; call after Start().
  void OnModels(std::shared_ptr<const ModelFacts> models) {
    models_->Add(std::move(models));
  }
  void OnEvent(const FaultEvent& event);

  /// Starts serving. Call once and, with a history, before the pipeline starts.
  /// If it throws, no thread is left behind. The history of a plant may be
  /// unavailable.
  void Start(ConsoleSources sources);
  /// Ends all streams and stops accepting connections. Does not block.
  void Stop();
  /// Stops, and waits for all threads: `sources` are not called any more.
  void Close();

  StreamCounts streams() const { return stream_.counts(); }
  std::size_t board_bytes() const { return board_.bytes(); }
  AdmissionCounts admissions() const { return access_.counts(); }

 private:
  void SetDefaultResponses();

  std::unique_ptr<monitor::HttpServer> server_;
  std::filesystem::path files_;
  std::vector<Route> more_routes_;
  LogSink log_;
  Admission access_;
  report::FaultTexts texts_;
  LiveBoard board_;
  LiveStream stream_;
  std::stop_source stopping_;
  std::unique_ptr<StoredModels> models_;
  std::unique_ptr<AlarmBook> alarms_;
  std::unique_ptr<Api> api_;
};

}  // namespace fdi::console
