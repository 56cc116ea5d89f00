#pragma once

#include <string>

namespace CLI {
class App;
}  // namespace CLI

namespace fdi::monitor {

/// Adds NAME[=[ADDRESS:]PORT], whose value is "off" unless it is given, and
/// `usual` if it is given bare.
void AddHttpOption(CLI::App& verb, const std::string& name,
                   std::string& address, const std::string& usual,
                   const std::string& help);

}  // namespace fdi::monitor
