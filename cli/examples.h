#pragma once

#include <string>
#include <vector>

namespace CLI {
class App;
}

namespace fdi::cli {

/// A command and what it is for.
struct Example {
  std::string what;     ///< "What happened in the last two hours"
  std::string command;  ///< "fdi-store history list --since 2h"
};

/// The examples of a verb, group, or (empty) the program.
struct VerbExamples {
  std::string verb;  ///< "history list"
  std::vector<Example> examples;
};

/// Puts the examples below the help of their verbs; the manual pages have them
/// from there. @throws std::logic_error for a verb that is not there.
void SetExamples(CLI::App& root, const std::vector<VerbExamples>& examples);

/// What is wrong with the examples of `root`: those that its parser refuses,
/// and its verbs and groups, itself among them, with fewer than two. Files need
/// not be there. Runs nothing, but leaves the options of `root` changed.
std::vector<std::string> CheckExamples(
    CLI::App& root, const std::vector<VerbExamples>& examples);

}  // namespace fdi::cli
