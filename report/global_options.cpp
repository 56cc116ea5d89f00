#include "report/global_options.h"

#include <map>
#include <memory>
#include <sstream>
#include <vector>

#include <CLI/CLI.hpp>
#include <toml++/toml.h>

#include "base/csv_cells.h"
#include "base/error.h"
#include "base/suggestion.h"
#include "base/text.h"
#include "base/toml_limits.h"
#include "fdi_version_config.h"
#include "report/removed_words.h"

namespace fdi::report {
namespace {

[[noreturn]] void Refuse(const toml::node& node, const std::string& message) {
  std::ostringstream text;
  text << "line " << node.source().begin.line << ": " << message;
  throw CLI::ConfigError(text.str());
}

// CLI11 converts values from text, as on the command line.
std::string TextOf(const toml::node& node, const std::string& key) {
  if (const auto text = node.value_exact<std::string>()) {
    return *text;
  }
  if (const auto flag = node.value_exact<bool>()) {
    return *flag ? "true" : "false";
  }
  if (const auto integer = node.value_exact<std::int64_t>()) {
    return std::to_string(*integer);
  }
  if (const auto number = node.value_exact<double>()) {
    return NumberText(*number);
  }
  Refuse(node, key + ": expected text, a number, true or false");
}

// "history.list."
std::string PathText(const std::vector<std::string>& parents) {
  std::string path;
  for (const std::string& parent : parents) {
    path += parent + '.';
  }
  return path;
}

bool IsKey(const CLI::Option& option) {
  return option.get_configurable() && !option.get_lnames().empty();
}

// Rejects a key that is neither an option nor a verb of `app`. CLI11 would,
// too, but without the line, and without the key that replaces it or that was
// probably meant.
void RefuseUnknown(const CLI::App& root, const CLI::App& app,
                   const toml::node& node,
                   const std::vector<std::string>& parents,
                   const std::string& key) {
  if (const auto removed =
          RemovedWord(root.get_name(), JoinText(parents, " "), "--" + key)) {
    Refuse(node, *removed);
  }
  std::vector<std::string> names;
  for (const CLI::Option* option : app.get_options()) {
    if (IsKey(*option)) {
      names.insert(names.end(), option->get_lnames().begin(),
                   option->get_lnames().end());
    }
  }
  for (const CLI::App* verb : app.get_subcommands({})) {
    names.push_back(verb->get_name());
  }
  const auto meant = Suggest(key, names);
  const std::string path = PathText(parents);
  Refuse(node, "unknown key '" + path + key + "'" +
                   (meant ? ": did you mean '" + path + *meant + "'?" : ""));
}

void Collect(const CLI::App& root, const CLI::App& app,
             const toml::table& table, std::vector<std::string>& parents,
             std::vector<CLI::ConfigItem>& items) {
  for (const auto& [toml_key, node] : table) {
    const std::string key(toml_key.str());
    const auto verbs = app.get_subcommands(
        [&key](const CLI::App* verb) { return verb->get_name() == key; });
    if (const toml::table* inner = node.as_table()) {
      if (verbs.empty()) {
        RefuseUnknown(root, app, node, parents, key);
      }
      parents.push_back(key);
      Collect(root, *verbs.front(), *inner, parents, items);
      parents.pop_back();
      continue;
    }
    const CLI::Option* option = app.get_option_no_throw("--" + key);
    if (option == nullptr && !verbs.empty()) {
      Refuse(node, key + " is a verb: expected a table [" + PathText(parents) +
                       key + "]");
    }
    if (option == nullptr || !IsKey(*option)) {
      RefuseUnknown(root, app, node, parents, key);
    }
    CLI::ConfigItem item;
    item.parents = parents;
    item.name = key;
    if (const toml::array* list = node.as_array()) {
      for (const toml::node& element : *list) {
        item.inputs.push_back(TextOf(element, key));
      }
    } else {
      item.inputs.push_back(TextOf(node, key));
    }
    items.push_back(std::move(item));
  }
}

// Makes CLI11 read --config as TOML 1.0 with toml++: a key is the option of
// that name, a table is a verb.
class TomlConfig : public CLI::Config {
 public:
  // @param root whose options and verbs the file may contain; outlives this.
  explicit TomlConfig(const CLI::App& root) : root_(root) {}

  // @throws CLI::ConfigError naming line and key: invalid TOML, an unknown
  //   key, a value that is neither text, number nor flag.
  std::vector<CLI::ConfigItem> from_config(std::istream& in) const override;
  // Unused: nothing prints the configuration.
  std::string to_config(const CLI::App*, bool, bool,
                        std::string) const override {
    return {};
  }

 private:
  const CLI::App& root_;
};

std::vector<CLI::ConfigItem> TomlConfig::from_config(std::istream& in) const {
  try {
    std::string text(kMaxTomlBytes + 1, '\0');
    in.read(text.data(), static_cast<std::streamsize>(text.size()));
    text.resize(static_cast<std::size_t>(in.gcount()));
    CheckTomlLimits(text, "");
    const toml::table table = toml::parse(text);
    std::vector<CLI::ConfigItem> result;
    std::vector<std::string> parents;
    Collect(root_, root_, table, parents, result);
    return result;
  } catch (const toml::parse_error& error) {
    std::ostringstream message;
    message << "line " << error.source().begin.line << ", column "
            << error.source().begin.column << ": " << error.description();
    throw CLI::ConfigError(message.str());
  } catch (const fdi::ConfigError& error) {
    throw CLI::ConfigError("line " + std::string(error.what()).substr(1));
  }
}

void AddLogLevel(CLI::App& app, GlobalOptions& options) {
  static const std::map<std::string, LogLevel> levels = {
      {"debug", LogLevel::kDebug},
      {"info", LogLevel::kInfo},
      {"warning", LogLevel::kWarning},
      {"error", LogLevel::kError}};
  app.add_option_function<std::string>(
         "--log-level",
         [&options](const std::string& name) {
           options.log_level = levels.at(name);
         },
         "Log messages of this level and above to standard error")
      ->check(CLI::IsMember({"debug", "info", "warning", "error"}))
      ->default_str("info")
      ->type_name("LEVEL");
}

// If an option is repeated, the last one wins, so that the options of a script
// can be overridden.
void SetTakeLastPolicy(CLI::App& app) {
  for (CLI::Option* option : app.get_options()) {
    option->take_last();
  }
}

}  // namespace

void AddGlobalOptions(CLI::App& app, GlobalOptions& options) {
  app.option_defaults()->always_capture_default();
  app.set_help_flag("-h,--help", "Print this help and exit");
  app.set_help_all_flag("--help-all",
                        "Print this help with all options and exit");
  app.set_version_flag("--version", app.get_name() + " " + SoftwareVersion(),
                       "Print the version and exit");
  app.add_option("--data", options.data_dir, "Data directory")
      ->envname("FDI_DATA")
      ->type_name("DIR");
  app.add_flag("--json", options.json, "Print the result as one JSON object");
  app.add_flag("--utc", options.utc,
               "Show times in UTC instead of the local time zone");
  AddLogLevel(app, options);
  SetTakeLastPolicy(app);
  app.config_formatter(std::make_shared<TomlConfig>(app));
  app.set_config("--config", "",
                 "Read options from a TOML file: KEY = VALUE for the option "
                 "--KEY, a table [VERB] for those of a verb")
      ->type_name("FILE.toml")
      ->configurable(false);
}

void AddBusOptions(CLI::App& app, GlobalOptions& options) {
  app.add_option("--domain", options.domain, "DDS domain")
      ->check(CLI::Range(0, 232));
  app.add_option("--interface", options.interface,
                 "Addresses of the network interfaces to use, or all")
      ->type_name("ADDR[,ADDR]|all");
  app.add_option("--transport", options.transport,
                 "Carry samples over UDP, over shared memory, or over both, "
                 "which is the default of Fast DDS")
      ->check(CLI::IsMember({"udp", "shm", "default"}))
      ->type_name("NAME");
  app.add_option("--partition", options.partition,
                 "Share of the plant that samples are published to or taken "
                 "from; a monitor may take several, 'hall-1,pumps-*'")
      ->type_name("NAME[,NAME]");
  app.add_option("--security", options.security,
                 "Folder of the key that fdi-keys has made for this program or "
                 "host; without one the bus is open to all")
      ->check(CLI::ExistingDirectory)
      ->type_name("DIR");
  app.add_option("--qos", options.qos_file,
                 "Fast DDS XML file whose QoS profiles override the built-in "
                 "ones")
      ->check(CLI::ExistingFile)
      ->type_name("FILE.xml");
  SetTakeLastPolicy(app);
}

std::string SoftwareVersion() {
  return FDI_VERSION "+" FDI_REVISION;
}

}  // namespace fdi::report
