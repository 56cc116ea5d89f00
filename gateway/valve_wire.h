#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include "diagnosis/model/sample.h"
#include "idl/endpoint.h"
#include "idl/participant.h"
#include "import/assembler.h"
#include "report/program.h"
#include "report/stop_signals.h"
#include "simulator/valve_equations.h"

namespace fdi::gateway {

struct ValveWireOptions {
  std::size_t valves{0};  ///< Number in the first table.
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

  /// Takes the valves of a table, at most room(). Readers of one that is gone,
  /// or in another partition, learn that no more will come. The writers of
  /// groups without a valve go once readers have that, after 2 s at most. Looks
  /// up the units of the model sets again.
  void Use(const std::vector<importer::LiveValve>& valves);
  /// Waits up to 5 s for a reader, so that one that runs gets the first sample.
  void AwaitReader();
  /// @param valve_id is one of the table.
  /// @throws DataError for an id or a value that the wire does not take;
  ///   PassingError, TransportError.
  void Publish(const std::string& valve_id, const Sample& sample);
  /// Waits up to 2 s for the readers to have what was sent.
  void Finish() { AwaitAcknowledged(writers_); }
  /// @throws PassingError as idl::Participant::RequireInterfaces()
  void RequireInterfaces() const { participant_.RequireInterfaces(); }

  std::uint64_t sent() const { return sent_; }
  std::uint64_t not_sent() const { return not_sent_; }
  int readers() const;
  /// A table that is read again may have more rows than the first one.
  std::size_t room() const { return 2 * options_.valves + 100; }

 private:
  using Writer = idl::Publisher<idl::ValveSampleMessage>;
  using Writers = std::map<std::string, std::unique_ptr<Writer>>;
  Writer& WriterOf(const std::string& group);
  static void AwaitAcknowledged(const Writers& writers);
  void ConvertFlow(const std::string& valve_id, Sample& sample);

  ValveWireOptions options_;
  const report::Context& context_;
  report::StopSignals& signals_;
  idl::Participant participant_;
  Writers writers_;  // By partition.
  struct Valve {
    Writer* writer{nullptr};
    std::uint64_t source_id{0};
  };
  std::unordered_map<std::string, Valve> valves_;
  std::unordered_map<std::string, std::optional<simulator::FlowConversion>>
      flows_;
  idl::ValveSampleMessage message_;
  std::uint64_t sent_{0};
  std::uint64_t not_sent_{0};
};

}  // namespace fdi::gateway
