#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <unordered_map>

#include "diagnosis/model/sample.h"
#include "idl/endpoint.h"
#include "idl/participant.h"
#include "report/program.h"
#include "report/stop_signals.h"
#include "simulator/valve_equations.h"

namespace fdi::gateway {

struct ValveWireOptions {
  std::size_t valves{0};  ///< Number in the table.
  /// A writer for each group, in the partition of its name; otherwise one in
  /// those of --partition.
  bool by_group{false};
  /// Readers that are behind hold up Publish(); otherwise they miss samples.
  bool lossless{false};
};

/// Publishes the samples of all valves by one participant, and converts a flow
/// to the unit of the valve's model set. One thread.
class ValveWire {
 public:
  /// @throws ConfigError, TransportError as idl::Participant.
  ValveWire(const ValveWireOptions& options, const report::Context& context,
            report::StopSignals& signals);

  /// Waits up to 5 s for a reader, so that one that runs gets the first sample.
  void AwaitReader();
  /// @returns whether it was sent. @throws DataError for an id or a value that
  ///   the wire does not take; PassingError, TransportError.
  bool Publish(const std::string& valve_id, const std::string& group,
               const Sample& sample);
  /// A valve of a former table: its readers learn that no more will come.
  void End(const std::string& valve_id);
  /// Looks up the units of the model sets again.
  void ForgetUnits() { flows_.clear(); }
  /// Waits up to 2 s for the readers to have what was sent.
  void Finish();
  /// @throws PassingError as idl::Participant::RequireInterfaces()
  void RequireInterfaces() const { participant_.RequireInterfaces(); }

  std::uint64_t sent() const { return sent_; }
  std::uint64_t not_sent() const { return not_sent_; }
  int readers() const;

 private:
  using Writer = idl::Publisher<idl::ValveSampleMessage>;
  Writer& WriterOf(const std::string& group);
  void ConvertFlow(const std::string& valve_id, Sample& sample);

  ValveWireOptions options_;
  const report::Context& context_;
  report::StopSignals& signals_;
  idl::Participant participant_;
  std::map<std::string, std::unique_ptr<Writer>> writers_;  // By partition.
  struct Valve {
    Writer* writer;
    std::uint64_t source_id;
  };
  std::unordered_map<std::string, Valve> valves_;
  std::unordered_map<std::string, std::optional<simulator::FlowConversion>>
      flows_;
  idl::ValveSampleMessage message_;
  std::uint64_t sent_{0};
  std::uint64_t not_sent_{0};
};

}  // namespace fdi::gateway
