#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "cli/program.h"
#include "cli/stop_signals.h"
#include "diagnosis/log.h"
#include "diagnosis/sample.h"
#include "idl/endpoint.h"
#include "idl/participant.h"

namespace fdi::simulator {

/// Nobody listens. Exit code 4.
class NoReaderError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Settings of SamplePublisher.
struct SamplePublisherOptions {
  bool lossless{false};          ///< The reader paces the writer.
  bool needs_reader{false};      ///< Without one, nothing leaves.
  std::optional<double> wait_s;  ///< For a reader; see AwaitReader().
  bool keep_alive{false};        ///< Do not end the streams.
};

/// Publishes the samples of some valves and ends their streams. One thread.
class SamplePublisher {
 public:
  /// @throws ConfigError, TransportError as idl::Participant.
  SamplePublisher(const SamplePublisherOptions& options,
                  std::vector<std::string> valve_ids,
                  const cli::Context& context, cli::StopSignals& signals);

  /// Waits until a reader is there: for wait_s or 30 s if one is needed, else
  /// for wait_s or 2 s, so that one which is up gets the first sample.
  /// @throws NoReaderError naming domain and interface if one is needed.
  void AwaitReader();

  /// Lossless: waits until there is room. Where a reader is needed and none is
  /// left: waits for another.
  /// @returns false if a stop was requested before the sample left.
  /// @throws NoReaderError, TransportError
  bool Publish(std::size_t valve, const Sample& sample);

  /// Waits until the readers have it all, ends the streams (unless keep_alive),
  /// waits again; for 60 s lossless, else for 2 s. After a stop it waits a
  /// moment only, and leaves streams open whose readers are behind.
  /// @returns whether the readers have it all.
  bool Finish();

  bool lossless() const { return options_.lossless; }
  /// How many there are now.
  int readers() const { return writer_.status().matched; }

 private:
  bool AwaitAcknowledged();

  SamplePublisherOptions options_;
  std::vector<std::string> valve_ids_;
  LogSink log_;
  cli::StopSignals& signals_;
  idl::Participant participant_;
  idl::Publisher<idl::ValveSampleMessage> writer_;
  idl::ValveSampleMessage message_;
};

/// The DDS settings of the command line, for `valves` valves.
/// @throws ConfigError
idl::DdsOptions DdsOptionsOf(const cli::GlobalOptions& options,
                             std::size_t valves);

}  // namespace fdi::simulator
