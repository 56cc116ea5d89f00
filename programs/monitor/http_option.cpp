#include "programs/monitor/http_option.h"

#include <CLI/CLI.hpp>

namespace fdi::monitor {

// A flag with an optional value; TOML may give it as true or false.
void AddHttpOption(CLI::App& verb, const std::string& name,
                   std::string& address, const std::string& usual,
                   const std::string& help) {
  verb.add_option(name, address, help)
      ->expected(0, 1)
      ->default_str(usual)
      ->transform([usual](const std::string& word) {
        if (word == "true" || word == "on") {
          return usual;
        }
        return word == "false" ? std::string("off") : word;
      })
      ->type_name("[=[ADDRESS:]PORT]");
}

}  // namespace fdi::monitor
