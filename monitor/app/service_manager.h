#pragma once

#include <chrono>
#include <optional>
#include <string>

namespace fdi::monitor {

/// Tells the service manager (systemd, `Type=notify`) how the service is.
/// Without one that asks for it, NOTIFY_SOCKET, nothing happens.
class ServiceManager {
 public:
  ServiceManager();

  void Ready();
  void Reloading();
  void Stopping();
  /// One short line for `systemctl status`; sent if it is another one.
  void Status(const std::string& text);
  /// All is well; see watchdog_limit().
  void Alive();

  /// The manager ends the service if Alive() is not called for so long;
  /// nothing if it does not watch.
  std::optional<std::chrono::microseconds> watchdog_limit() const {
    return watchdog_limit_;
  }

 private:
  std::optional<std::chrono::microseconds> watchdog_limit_;
  std::string status_;
};

}  // namespace fdi::monitor
