#pragma once

#include <string>

namespace fdi {

/// Which valves a monitor of a plant takes: what the topic MonitorShare
/// carries. Of two monitors that are not a pair, at most one should take a
/// valve.
struct MonitorShare {
  std::string monitor;     ///< Unique name of the process, e.g. host:pid.
  std::string pair;        ///< Of --pair; empty: nobody stands in for it.
  std::string valves;      ///< Glob of ids.
  std::string partitions;  ///< Where it takes samples, as in --partition.
};

}  // namespace fdi
