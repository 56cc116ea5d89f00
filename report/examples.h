#pragma once

#include <string>
#include <vector>

namespace CLI {
class App;
}

namespace fdi::report {

/// A command and its purpose.
struct Example {
  std::string what;     ///< "What happened in the last two hours"
  std::string command;  ///< "fdi-store history list --from 2h"
};

/// The examples of a verb, a group or (empty name) the program.
struct VerbExamples {
  std::string verb;  ///< "history list"
  std::vector<Example> examples;
};

/// Appends the examples to the help of their verbs, from which the manual pages
/// are made. @throws std::logic_error for an unknown verb.
void SetExamples(CLI::App& root, const std::vector<VerbExamples>& examples);

/// Checks the examples of `root`: lists those that its parser rejects, and the
/// verbs and groups, including `root`, that have fewer than two. Files need not
/// exist. Runs nothing, but leaves the options of `root` modified.
std::vector<std::string> CheckExamples(
    CLI::App& root, const std::vector<VerbExamples>& examples);

}  // namespace fdi::report
