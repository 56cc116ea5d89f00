#include "storage/cli/documentation_options.h"

#include <iostream>

#include <CLI/CLI.hpp>

#include "storage/cli/completion.h"
#include "storage/cli/manual.h"

namespace fdi::cli {

void AddDocumentationOptions(CLI::App& root) {
  root.add_option_function<std::string>(
          "--man-pages",
          [&root](const std::string& folder) {
            WriteManualPages(root, folder);
            throw CLI::Success();
          },
          "Write the manual pages of the program and its verbs")
      ->configurable(false)
      ->group("");
  root.add_flag_callback(
          "--completion",
          [&root] {
            PrintCompletion(root, std::cout);
            throw CLI::Success();
          },
          "Print what completes the program's command line in bash")
      ->configurable(false)
      ->group("");
}

}  // namespace fdi::cli
