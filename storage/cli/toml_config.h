#pragma once

#include <istream>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

namespace fdi::cli {

/// Lets CLI11 read --config as TOML 1.0 through toml++: a key stands for the
/// option of that name, a table for a verb.
class TomlConfig : public CLI::Config {
 public:
  std::vector<CLI::ConfigItem> from_config(std::istream& in) const override;
  /// What would run: each option that has a value, of the program and of the
  /// chosen verb. The other arguments are CLI11's and have no use here.
  std::string to_config(const CLI::App* app, bool default_also,
                        bool write_description,
                        std::string prefix) const override;
};

}  // namespace fdi::cli
