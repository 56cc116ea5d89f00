#pragma once

#include <filesystem>
#include <string>

#include "base/log.h"

namespace CLI {
class App;
}

namespace fdi::report {

/// Options that may precede or follow the verb. Bus options apply only to the
/// programs that use them.
struct GlobalOptions {
  std::filesystem::path data_dir{"./fdi-data"};  ///< --data, env FDI_DATA
  int domain{0};                                 ///< --domain 0..232
  std::string interface { "127.0.0.1" };  ///< --interface ADDR[,ADDR]|all
  /// --transport udp|shm|default (both). Shared memory starts more slowly, and
  /// a killed peer blocks the next one for seconds.
  std::string transport{"udp"};
  std::string partition;  ///< --partition NAME[,NAME] of samples, or empty
  std::filesystem::path qos_file;  ///< --qos FILE.xml, or empty
  std::filesystem::path security;  ///< --security DIR, or empty
  LogLevel log_level{LogLevel::kInfo};
  bool json{false};
  bool utc{false};  ///< Times for people in UTC instead of the local zone.
};

/// Adds --help --version --data --config --json --utc --log-level to the root
/// `app`; `options` must outlive it.
void AddGlobalOptions(CLI::App& app, GlobalOptions& options);
/// Adds --domain --interface --transport --partition --security --qos.
void AddBusOptions(CLI::App& app, GlobalOptions& options);

/// Version of the project and git revision: "0.1.0+438d5bd". Stored with each
/// run and model set.
std::string SoftwareVersion();

}  // namespace fdi::report
