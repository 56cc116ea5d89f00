#pragma once

namespace fdi::cli {
class Program;
}

namespace fdi::monitor {

/// `run`: diagnoses the valves on the bus.
void AddRunVerb(cli::Program& program);

/// `watch`: prints or counts what monitors publish.
void AddWatchVerb(cli::Program& program);

/// `top`: a live table of what they publish.
void AddTopVerb(cli::Program& program);

}  // namespace fdi::monitor
