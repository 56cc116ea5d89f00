#include "programs/monitor/console_options.h"

#include <CLI/CLI.hpp>

#include "monitor/console/console.h"
#include "report/program.h"

namespace fdi::monitor {

void AddConsoleProxyOption(CLI::App& verb, console::ConsoleOptions& options) {
  verb.add_option("--console-proxy", options.proxy_secret,
                  "File of the secret by which nginx in front proves itself; "
                  "it names users, who may then act")
      ->type_name("FILE");
}

void AddRemovedConsoleOptions(report::Program& program,
                              const std::string& verb) {
  const std::string page = " (docs/console.md, The page beyond this host)";
  const std::string users =
      "nginx asks for names and passwords, and proves itself by "
      "--console-proxy "
      "FILE" +
      page;
  program.AddRemoved(verb, "--console-users", users);
  program.AddRemoved(verb, "--console-proxy-user", users);
  program.AddRemoved(verb, "--console-proxy-from", users);
  program.AddRemoved(verb, "--console-write", users);
  const std::string tls = "nginx has the certificate" + page;
  program.AddRemoved(verb, "--console-tls", tls);
  program.AddRemoved(verb, "--console-key", tls);
  program.AddRemoved(verb, "--allow-host",
                     "nginx answers under other names" + page);
}

}  // namespace fdi::monitor
