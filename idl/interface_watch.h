#pragma once

#include <map>
#include <stop_token>
#include <string>
#include <thread>

#include "base/log.h"

namespace fdi::idl {

/// IPv4 addresses of this machine that are up, each with the index of its
/// interface. @throws PassingError if they cannot be listed.
std::map<std::string, unsigned> LocalAddresses();

/// Keeps the sockets of the DDS library on the interfaces of a participant.
///
/// The kernel ties a multicast membership, and the interface that multicast is
/// sent from, to the number of an interface, which changes when the interface
/// is removed and made anew (VPN, container, driver). Its address may be the
/// same; the library, which opened its sockets before, hears nothing any more.
/// A thread compares the numbers once a second and sets both anew.
class InterfaceWatch {
 public:
  /// @param interfaces as DdsOptions::interfaces. Loopback alone never changes,
  ///   so it is not watched.
  InterfaceWatch(std::string interfaces, LogSink log);
  ~InterfaceWatch();
  InterfaceWatch(const InterfaceWatch&) = delete;
  InterfaceWatch& operator=(const InterfaceWatch&) = delete;

 private:
  void Run(const std::stop_token& stop);
  void Look();

  const std::string interfaces_;
  const LogSink log_;
  std::map<std::string, unsigned> present_;
  std::string missing_;
  std::jthread thread_;
};

/// Addresses of this process's participants that the machine does not have now,
/// "10.1.2.3,10.1.2.4". Thread safe.
std::string MissingInterfaces();

}  // namespace fdi::idl
