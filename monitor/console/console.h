#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "diagnosis/log.h"
#include "monitor/console/admission.h"
#include "monitor/console/api.h"
#include "monitor/http/http_server.h"
#include "monitor/sinks.h"

namespace fdi::console {

/// Settings of Console.
struct ConsoleOptions {
  monitor::HttpAddress address;
  /// Of the page; empty: those installed with the program.
  std::filesystem::path files;
  std::vector<std::string> names;  ///< See monitor::HostAllowed().
  AdmissionOptions admission;
  std::optional<monitor::TlsFiles> tls;
};

/// Folder with index.html. @throws ConfigError naming `asked`, or DataError if
///   nothing was asked for and none is installed.
std::filesystem::path FindConsoleFiles(const std::filesystem::path& asked);

/// The live page of a monitor and its API (docs/console.md): it shows what the
/// pipeline passes to live(), reads the history, and lets those act whom
/// Admission lets. Or that of a plant: it shows what was heard on the bus. It
/// has threads of its own; neither diagnosis nor bus waits for any of them.
class Console {
 public:
  /// Binds the address and finds its files; nothing is answered yet.
  /// @throws ConfigError, DataError, NotFoundError, std::runtime_error
  Console(const ConsoleOptions& options, const cli::GlobalOptions& global,
          LogSink log);
  /// As Close().
  ~Console();
  Console(const Console&) = delete;
  Console& operator=(const Console&) = delete;

  /// For the pipeline, or for who hears the monitors of a plant.
  LiveBoard& live() { return board_; }
  /// For the pipeline, in front of `bus`: an event is shown once it is on the
  /// bus, by which time it is in the history, unless that failed.
  monitor::EventSink& Before(monitor::EventSink& bus);

  /// Of a plant: a model set, or an event, that was heard; after Start().
  void Hear(std::shared_ptr<const ModelFacts> models) {
    models_->Learn(std::move(models));
  }
  void Hear(const FaultEvent& event);

  /// Answers from now on. Once, with a history, before the pipeline starts.
  /// What throws in here leaves no thread behind. The history of a plant may be
  /// away.
  void Start(ConsoleSources sources);
  /// Reads the certificate and the users anew. What is wrong with them is
  /// logged, and the old ones stay.
  void Reload();
  /// Ends all streams and takes no further connections. Does not wait.
  void Stop();
  /// Stops and waits for all threads: from here on `sources` are not called.
  void Close();

  StreamCounts streams() const { return stream_.counts(); }
  std::size_t board_bytes() const { return board_.bytes(); }
  monitor::HttpServer::Counts requests() const { return server_->counts(); }
  AdmissionCounts admissions() const { return access_.counts(); }

 private:
  class Events;
  void SetRulesOfEveryAnswer();
  void RenewTls();
  void SayWhereItListens() const;

  std::unique_ptr<monitor::HttpServer> server_;
  std::filesystem::path files_;
  LogSink log_;
  Admission access_;
  cli::FaultTexts texts_;
  LiveBoard board_;
  LiveStream stream_;
  WorkListCache work_list_;
  std::stop_source stopping_;
  std::unique_ptr<Events> events_;
  std::unique_ptr<StoredModels> models_;
  std::unique_ptr<AlarmBook> alarms_;
  std::unique_ptr<Api> api_;
};

}  // namespace fdi::console
