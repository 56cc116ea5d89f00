#pragma once

#include <filesystem>
#include <string>

namespace CLI {
class App;
}

namespace fdi::cli {

/// The manual page of a program, group or verb in man(7), section 1: what
/// --help knows, so that neither drifts from the other. A footer of the parser
/// becomes the section EXAMPLES.
std::string ManualPage(const CLI::App& app);

/// "fdi-store-history-list": the name of the page of `app`.
std::string ManualPageName(const CLI::App& app);

/// Writes FOLDER/NAME.1 for the program `root`, each group and each verb.
/// @throws DataError naming the file that cannot be written.
void WriteManualPages(const CLI::App& root,
                      const std::filesystem::path& folder);

}  // namespace fdi::cli
