#pragma once

namespace fdi::report {
class Program;
}

namespace fdi::monitor {

/// `run`: diagnoses the valves on the bus.
void AddRunVerb(report::Program& program);

/// `watch`: prints or counts what monitors publish.
void AddWatchVerb(report::Program& program);

/// `console`: the live page of all monitors; in a build without
/// console/ or plant/, left_out.cpp.
void AddConsoleVerb(report::Program& program);

}  // namespace fdi::monitor
