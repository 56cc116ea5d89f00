#pragma once

#include "cli/global_options.h"
#include "idl/participant.h"

namespace fdi::cli {
class Program;
}

namespace fdi::monitor {

/// DDS settings from the options of a program.
inline idl::DdsOptions DdsOptionsOf(const cli::GlobalOptions& options,
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

/// `run`: diagnoses the valves on the bus.
void AddRunVerb(cli::Program& program);

/// `console-user`: adds, changes or removes a user of the console.
void AddConsoleUserVerb(cli::Program& program);

/// `watch`: prints or counts what monitors publish.
void AddWatchVerb(cli::Program& program);

/// `console`: the live page of all monitors.
void AddConsoleVerb(cli::Program& program);

/// `top`: a live table of what they publish.
void AddTopVerb(cli::Program& program);

}  // namespace fdi::monitor
