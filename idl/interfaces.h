#pragma once

#include <atomic>
#include <chrono>
#include <map>
#include <string>

namespace fdi::idl {

/// The IPv4 addresses of this machine, each with the index of its interface.
/// @throws PassingError if they cannot be listed.
std::map<std::string, unsigned> LocalAddresses();

/// The interfaces that a participant opened its sockets on.
///
/// The kernel ties a multicast membership, and the interface that multicast is
/// sent from, to the index of an interface, which changes when the interface is
/// removed and remade (VPN, container, driver). Its address may be the same,
/// and yet the library, which opened its sockets before, hears nothing any
/// more. It cannot open them again, so the program has to be started again.
class Interfaces {
 public:
  /// @param names as DdsOptions::interfaces. Loopback never changes, so it is
  ///   not looked at. @throws as LocalAddresses()
  explicit Interfaces(const std::string& names);

  /// Looks at most once a second; thread safe.
  /// @throws PassingError if an address is gone or on another interface; with
  ///   "all", if there is an interface that was not there.
  void Require() const;

 private:
  bool all_;
  std::map<std::string, unsigned> used_;  // As of the start.
  mutable std::atomic<std::chrono::steady_clock::time_point> next_look_;
};

}  // namespace fdi::idl
