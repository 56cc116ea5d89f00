#include "monitor/app/service_manager.h"

#include <cstdint>

#include <systemd/sd-daemon.h>

namespace fdi::monitor {
namespace {

// A manager that does not listen is none of our worries.
void Notify(const std::string& state) {
  sd_notify(0, state.c_str());
}

std::string MonotonicMicroseconds() {
  return std::to_string(std::chrono::duration_cast<std::chrono::microseconds>(
                            std::chrono::steady_clock::now().time_since_epoch())
                            .count());
}

}  // namespace

ServiceManager::ServiceManager() {
  std::uint64_t limit_us = 0;
  if (sd_watchdog_enabled(0, &limit_us) > 0) {
    watchdog_limit_ = std::chrono::microseconds(limit_us);
  }
}

void ServiceManager::Ready() {
  Notify("READY=1");
}

void ServiceManager::Reloading() {
  Notify("RELOADING=1\nMONOTONIC_USEC=" + MonotonicMicroseconds());
}

void ServiceManager::Stopping() {
  Notify("STOPPING=1");
}

void ServiceManager::Status(const std::string& text) {
  if (text != status_) {
    status_ = text;
    Notify("STATUS=" + text);
  }
}

void ServiceManager::Alive() {
  Notify("WATCHDOG=1");
}

}  // namespace fdi::monitor
