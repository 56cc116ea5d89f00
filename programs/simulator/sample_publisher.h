#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "base/log.h"
#include "diagnosis/model/sample.h"
#include "idl/endpoint.h"
#include "idl/participant.h"
#include "report/program.h"
#include "report/stop_signals.h"

namespace fdi::simulator {

/// There is no reader. Exit code 4.
class NoReaderError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Settings of SamplePublisher.
struct SamplePublisherOptions {
  bool lossless{false};          ///< The reader paces the writer.
  bool needs_reader{false};      ///< Publish only while there is one.
  std::optional<double> wait_s;  ///< For a reader; see AwaitReader().
  bool keep_alive{false};        ///< Do not dispose the instances.
};

/// Publishes the samples of some valves and disposes them at the end. One
/// thread.
class SamplePublisher {
 public:
  /// @throws ConfigError, TransportError as idl::Participant.
  SamplePublisher(const SamplePublisherOptions& options,
                  std::vector<std::string> valve_ids,
                  const report::Context& context, report::StopSignals& signals);

  /// Waits for a reader: for wait_s or 30 s if one is required, else for wait_s
  /// or 2 s, so that a running reader gets the first sample.
  /// @throws NoReaderError naming domain and interface if one is required.
  void AwaitReader();

  /// If lossless, blocks until there is room. If a reader is required and none
  /// is left, waits for another.
  /// @returns false if a stop was requested before the sample was sent.
  /// @throws NoReaderError, TransportError; PassingError as
  ///   idl::Participant::RequireInterfaces()
  bool Publish(std::size_t valve, const Sample& sample);

  /// Waits for acknowledgement, disposes the instances (unless keep_alive) and
  /// waits again; up to 60 s if lossless, else 2 s. After a stop it waits only
  /// briefly, and does not dispose instances with readers that are behind.
  /// @returns whether the readers have acknowledged everything.
  bool Finish();

  bool lossless() const { return options_.lossless; }
  /// Current number of readers.
  int readers() const { return writer_.status().matched; }

 private:
  bool AwaitAcknowledged();

  SamplePublisherOptions options_;
  std::vector<std::string> valve_ids_;
  LogSink log_;
  report::StopSignals& signals_;
  idl::Participant participant_;
  idl::Publisher<idl::ValveSampleMessage> writer_;
  idl::ValveSampleMessage message_;
};

/// DDS settings from the command line, for `valves` valves.
/// @throws ConfigError
idl::DdsOptions DdsOptionsOf(const report::GlobalOptions& options,
                             std::size_t valves);

}  // namespace fdi::simulator
