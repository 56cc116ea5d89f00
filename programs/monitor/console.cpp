#include "programs/monitor/console.h"

#include <CLI/CLI.hpp>

#include "base/error.h"
#include "console/console_part.h"
#include "programs/monitor/http_option.h"
#include "programs/monitor/planner_page.h"

namespace fdi::monitor {

void AddPageOptions(report::Program& /*program*/, CLI::App& run,
                    PageOptions& options) {
  AddHttpOption(run, "--console", options.address, "127.0.0.1:8080",
                "Serve the live page and its API; port 0: any free one");
  AddPageFiles(run, options);
}

std::shared_ptr<ServicePart> MakePage(const PageOptions& options,
                                      const std::filesystem::path& groups,
                                      const std::string& valves,
                                      const report::Context& context) {
  if (options.address == "off") {
    if (!options.proxy_secret.empty() || !options.files.empty()) {
      throw ConfigError(
          "--console-proxy and --console-files need "
          "--console[=[ADDRESS:]PORT]");
    }
    return nullptr;
  }
  return std::make_shared<console::ConsolePart>(
      console::ConsoleOptions{ParseHttpAddress(options.address, "--console"),
                              options.files, options.proxy_secret,
                              PlannerRoutes(groups, context)},
      valves, context.options, context.log);
}

void AddPageFiles(CLI::App& verb, PageOptions& options) {
  verb.add_option("--console-files", options.files,
                  "Folder of the page instead of the installed one")
      ->type_name("DIR");
  verb.add_option("--console-proxy", options.proxy_secret,
                  "File of the secret by which nginx in front proves itself; "
                  "it names users, who may then act")
      ->type_name("FILE");
}

}  // namespace fdi::monitor
