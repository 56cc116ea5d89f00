#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "monitor/service/service_part.h"
#include "report/program.h"

/// The console's part in the verbs of this program; left_out.cpp stands in for
/// it if the build has no console.
namespace fdi::monitor {

struct PageOptions {
  std::string address{"off"};
  std::filesystem::path files;  ///< Empty: those installed.
  std::filesystem::path proxy_secret;
};

/// --console and what belongs to it, of `run`.
void AddPageOptions(report::Program& program, CLI::App& run,
                    PageOptions& options);

/// The page of a monitor, bound to its address; null if it is off.
/// @param groups as FollowCauses(). @param valves glob of those served.
/// @throws ConfigError, DataError, std::runtime_error
std::shared_ptr<ServicePart> MakePage(const PageOptions& options,
                                      const std::filesystem::path& groups,
                                      const std::string& valves,
                                      const report::Context& context);

/// --console-files and --console-proxy of `verb`.
void AddPageFiles(CLI::App& verb, PageOptions& options);

}  // namespace fdi::monitor
