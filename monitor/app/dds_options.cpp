#include "monitor/app/dds_options.h"

namespace fdi::monitor {

idl::DdsOptions DdsOptionsOf(const cli::GlobalOptions& options,
                             int max_valves) {
  idl::DdsOptions dds;
  dds.domain = options.domain;
  dds.interfaces = options.interface;
  dds.transport = options.transport;
  dds.qos_file = options.qos_file.string();
  dds.max_valves = max_valves;
  return dds;
}

}  // namespace fdi::monitor
