#include "storage/cli/global_options.h"

#include <map>

#include <CLI/CLI.hpp>

#include "storage/cli/toml_config.h"
#include "storage/cli/version.h"

namespace fdi::cli {
namespace {

const std::map<std::string, LogLevel>& LogLevels() {
  static const std::map<std::string, LogLevel> levels = {
      {"debug", LogLevel::kDebug},
      {"info", LogLevel::kInfo},
      {"warning", LogLevel::kWarning},
      {"error", LogLevel::kError}};
  return levels;
}

void AddLogLevel(CLI::App& app, GlobalOptions& options) {
  app.add_option_function<std::string>(
         "--log-level",
         [&options](const std::string& name) {
           options.log_level = LogLevels().at(name);
         },
         "debug, info, warning or error")
      ->check(CLI::IsMember(LogLevels()))
      ->default_str("info")
      ->type_name("LEVEL");
}

void AddTransport(CLI::App& app, GlobalOptions& options) {
  app.add_option("--domain", options.domain, "DDS domain")
      ->check(CLI::Range(0, 232))
      ->type_name("0..232");
  app.add_option("--interface", options.interface,
                 "Network interfaces: ADDR[,ADDR] or all")
      ->type_name("ADDR");
  app.add_option("--transport", options.transport, "udp, shm or default (both)")
      ->check(CLI::IsMember({"udp", "shm", "default"}))
      ->type_name("NAME");
  app.add_option("--qos", options.qos_file, "XML file overriding QoS profiles")
      ->check(CLI::ExistingFile)
      ->type_name("FILE.xml");
}

}  // namespace

void AddGlobalOptions(CLI::App& app, GlobalOptions& options) {
  app.option_defaults()->always_capture_default();
  app.set_help_flag("-h,--help", "Print this help and exit");
  app.set_version_flag("--version", app.get_name() + " " + SoftwareVersion());
  app.add_option("--data", options.data_dir, "Data directory")
      ->envname("FDI_DATA")
      ->type_name("DIR");
  AddTransport(app, options);
  app.add_option("--fault-catalogue", options.fault_catalogue,
                 "TOML file with words for faults that differ from the "
                 "catalogue's; DATA/faults.toml alike")
      ->check(CLI::ExistingFile)
      ->type_name("FILE.toml");
  app.add_flag("--json", options.json, "One JSON object on stdout");
  app.add_flag("--utc", options.utc, "Times in UTC, not in the local zone");
  AddLogLevel(app, options);
  for (CLI::Option* option : app.get_options()) {
    option->take_last();  // So that a script's options can be overridden.
  }
  app.config_formatter(std::make_shared<TomlConfig>());
  app.allow_config_extras(CLI::config_extras_mode::error);
  app.set_config("--config", "", "TOML file: option = value, [verb] tables")
      ->type_name("FILE.toml")
      ->configurable(false);
  app.add_flag_callback(
         "--print-config", [] { throw PrintConfigRequest(); },
         "Print the effective configuration as TOML and exit")
      ->configurable(false);
}

}  // namespace fdi::cli
