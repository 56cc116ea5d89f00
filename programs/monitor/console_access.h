#pragma once

#include <string>

#include "monitor/console/console.h"
#include "monitor/http/tls.h"

namespace CLI {
class App;
}  // namespace CLI

namespace fdi::monitor {

/// Who may read and act on a page, and whether it is served by https: the same
/// options for that of a monitor and that of a plant.
struct ConsoleAccess {
  std::string users;
  std::string proxy_header;
  std::string proxy_address;
  TlsFiles tls;

  bool given() const;
  void ApplyTo(console::ConsoleOptions& options) const;
};

void AddConsoleAccess(CLI::App& verb, ConsoleAccess& access);

}  // namespace fdi::monitor
