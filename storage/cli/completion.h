#pragma once

#include <iosfwd>

namespace CLI {
class App;
}

namespace fdi::cli {

/// Writes a bash script that completes the command line of the program `root`:
/// its verbs, the options of each verb, and values: words that are fixed, files
/// and folders, and, asked of fdi-store, valves, model sets, runs, episodes and
/// types, and the faults.
void PrintCompletion(const CLI::App& root, std::ostream& out);

}  // namespace fdi::cli
