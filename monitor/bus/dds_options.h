#pragma once

#include "idl/participant.h"
#include "report/global_options.h"

namespace fdi::monitor {

/// DDS settings from the options of a program.
inline idl::DdsOptions DdsOptionsOf(const report::GlobalOptions& options,
                                    int max_valves) {
  idl::DdsOptions dds;
  dds.domain = options.domain;
  dds.interfaces = options.interface;
  dds.transport = options.transport;
  dds.qos_file = options.qos_file.string();
  dds.security = options.security.string();
  dds.max_valves = max_valves;
  return dds;
}

}  // namespace fdi::monitor
