#pragma once

#include <initializer_list>

namespace CLI {
class App;
}

namespace fdi::report {

/// Gives the program `root` and its verbs help that reads like a manual page:
///
///     -h, --help           Print this help and exit
///     --domain 0..232      DDS domain (default 0)
///     --record[=on|off]    Store the samples (without a value: on)
///
/// Accepted values, defaults and exclusions are taken from the parser. Call
/// once, after the last option was added.
void PrepareHelp(CLI::App& root);

/// Leaves options of a verb that few plants need to --help-all: --help says
/// that there is more. A name that the verb does not have, because a component
/// is left out, is ignored.
void ShowInHelpAll(CLI::App& verb, std::initializer_list<const char*> names);

/// Drops the requirement that files and folders named by options exist.
void AllowMissingFiles(CLI::App& root);

}  // namespace fdi::report
