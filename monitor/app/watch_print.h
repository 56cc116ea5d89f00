#pragma once

#include <map>
#include <string>

#include "idl/wire.h"
#include "storage/cli/json_output.h"

namespace fdi::monitor {

/// Turns messages of the bus into lines for people or JSON objects. Learns
/// from ModelSetInfo what the arrays of decision vectors mean.
class WatchPrinter {
 public:
  /// @param utc times in UTC, not in the local zone.
  explicit WatchPrinter(bool utc) : utc_(utc) {}

  void Learn(const idl::ModelSetInfoMessage& info);

  std::string Line(const idl::DecisionMessage& message) const;
  std::string Line(const idl::FaultEventMessage& message) const;
  std::string Line(const idl::MonitorStatusMessage& message) const;
  std::string Line(const idl::ModelSetInfoMessage& message) const;

  cli::Json Object(const idl::DecisionMessage& message) const;
  cli::Json Object(const idl::FaultEventMessage& message) const;
  cli::Json Object(const idl::MonitorStatusMessage& message) const;
  cli::Json Object(const idl::ModelSetInfoMessage& message) const;

 private:
  const idl::ModelSetInfoMessage* InfoOf(std::uint64_t hash) const;
  std::string FaultAt(const idl::DecisionMessage& message,
                      std::size_t index) const;
  std::string ChannelAt(const idl::DecisionMessage& message,
                        std::size_t index) const;

  bool utc_;
  std::map<std::uint64_t, idl::ModelSetInfoMessage> infos_;
};

}  // namespace fdi::monitor
