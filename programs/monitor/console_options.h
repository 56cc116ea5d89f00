#pragma once

#include <string>

namespace CLI {
class App;
}  // namespace CLI

namespace fdi::console {
struct ConsoleOptions;
}

namespace fdi::report {
class Program;
}

namespace fdi::monitor {

/// --console-proxy, of the page of a monitor and that of a plant.
void AddConsoleProxyOption(CLI::App& verb, console::ConsoleOptions& options);

/// What the page of `verb` had of users and TLS; nginx has it now.
void AddRemovedConsoleOptions(report::Program& program,
                              const std::string& verb);

}  // namespace fdi::monitor
