#pragma once

namespace CLI {
class App;
}

namespace fdi::cli {

/// Adds --man-pages FOLDER and --completion to the program `root`. They serve
/// the build, and --help does not list them.
void AddDocumentationOptions(CLI::App& root);

}  // namespace fdi::cli
