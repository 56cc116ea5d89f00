#pragma once

#include <string>

namespace fdi {

/// The valves that a monitor takes, as published on the topic MonitorShare. At
/// most one monitor should take a valve.
struct MonitorShare {
  std::string monitor;     ///< Unique name of the process, e.g. host:pid.
  std::string valves;      ///< Glob of ids.
  std::string partitions;  ///< Where it takes samples, as in --partition.
};

}  // namespace fdi
