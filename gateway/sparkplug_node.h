#pragma once

#include <atomic>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "gateway/mqtt_client.h"
#include "gateway/sparkplug.pb.h"

namespace fdi::gateway {

/// Tells the states of valves as an edge node of Sparkplug B: a device for each
/// valve, with the metrics that the OPC UA server has as variables. A valve of
/// which no monitor tells is a device that is dead, CHECK_FUNCTION before.
///
/// One thread, but for Will().
class SparkplugNode {
 public:
  SparkplugNode(const std::string& group, const std::string& site);

  /// NDEATH, as the will of the next connection. Any thread.
  Outgoing Will();
  /// NDEATH of this connection, for an end in order.
  Outgoing Death() const;
  /// NBIRTH. The next state of each valve is a DBIRTH then.
  Outgoing Birth();
  /// The topic of commands to this node.
  std::string commands() const { return Topic("NCMD", ""); }
  /// True if the payload of a command asks for a rebirth.
  static bool AsksForBirth(const std::string& payload);
  /// Tells the news of a valve or of the monitor in a message of ValveStates.
  std::vector<Outgoing> Tell(const Outgoing& message);

 private:
  std::string Topic(const char* type, const std::string& device) const;
  Outgoing Next(const char* type, const std::string& device,
                sparkplug::Payload payload);

  std::string prefix_;
  std::string node_;
  std::atomic<std::uint64_t> bd_seq_;
  std::uint64_t seq_{0};
  struct Device {
    bool lives{false};
    std::vector<std::string> told;  // Its metrics; empty before a birth.
  };
  std::map<std::string, Device> devices_;  // "": the node.
};

}  // namespace fdi::gateway
