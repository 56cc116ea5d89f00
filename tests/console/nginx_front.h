#pragma once

#include <chrono>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include "tests/system/monitor_process.h"

namespace fdi::monitor {

/// A port of 127.0.0.1 that nobody uses at the moment.
inline int FreePort() {
  const int file = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof address;
  auto* const plain = reinterpret_cast<sockaddr*>(&address);
  EXPECT_EQ(bind(file, plain, size), 0);
  EXPECT_EQ(getsockname(file, plain, &size), 0);
  close(file);
  return ntohs(address.sin_port);
}

/// True if something listens there.
inline bool Listens(int port) {
  const int file = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  const bool yes = connect(file, reinterpret_cast<const sockaddr*>(&address),
                           sizeof address) == 0;
  close(file);
  return yes;
}

inline bool HasNginx() {
  return std::filesystem::exists("/usr/sbin/nginx") ||
         std::filesystem::exists("/usr/bin/nginx");
}

/// Writes the secret by which nginx proves itself into `folder`.
/// @returns the file, for --console-proxy.
inline std::string WriteProxySecret(const std::filesystem::path& folder) {
  std::filesystem::create_directories(folder);
  const auto file = folder / "proxy-secret";
  std::ofstream(file) << "0123456789abcdef0123456789abcdef\n";
  std::filesystem::permissions(file, std::filesystem::perms(0640));
  return file;
}

/// nginx with the configuration that we ship in front of a page and /metrics;
/// tests/console/nginx.sh says who its users are.
class NginxFront {
 public:
  /// @param folder of WriteProxySecret().
  NginxFront(const std::filesystem::path& folder, int page_port,
             int metrics_port)
      : nginx_({FDI_NGINX_SCRIPT, folder.string(), std::to_string(https_),
                std::to_string(http_), std::to_string(page_port),
                std::to_string(metrics_port)}) {
    const auto end =
        std::chrono::steady_clock::now() + std::chrono::seconds(30);
    while (!Listens(http_) && std::chrono::steady_clock::now() < end) {
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    nginx_.AwaitLine("nothing", std::chrono::seconds(0));
    EXPECT_TRUE(Listens(http_)) << nginx_.errors();
  }
  int https() const { return https_; }
  int http() const { return http_; }

 private:
  const int https_{FreePort()};
  const int http_{FreePort()};
  ChildProcess nginx_;
};

}  // namespace fdi::monitor
