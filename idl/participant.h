#pragma once

#include <cstdint>
#include <memory>
#include <stdexcept>
#include <string>

#include "base/log.h"
#include "idl/datagram.h"

namespace fdi::idl {

/// A failed call of the DDS library. what() names the operation. Exit code 4.
class TransportError : public std::runtime_error {
 public:
  TransportError(const std::string& operation, int code);
  int code() const noexcept { return code_; }  ///< DDS return code.

 private:
  int code_;
};

struct DdsOptions {
  int domain{0};  ///< 0..232
  /// Addresses of the interfaces to use, separated by commas, or "all".
  std::string interfaces{"127.0.0.1"};
  std::string transport{"udp"};  ///< udp | shm | default (both).
  std::string qos_file;          ///< XML with profiles, see qos.h; or empty.
  /// Folder of a key made by fdi-keys; empty: the bus is not secured.
  std::string security;
  int max_valves{2000};  ///< 1..100000; further valves are refused.
};

/// @throws ConfigError naming the option, its value and the accepted ones;
///   PassingError if the machine does not have the address (yet).
void Validate(const DdsOptions& options);

/// A DDS participant; active from construction on, discovered by its peers
/// within some 100 ms. A peer that dies silently is noticed after 5 s.
///
/// Outlives its endpoints. Thread safe. The library's own log goes to `log`,
/// throttled, never to stdout.
class Participant {
 public:
  /// @param name shown by tools that list participants, e.g. "fdi-monitor".
  /// @throws ConfigError on bad options or a QoS file that is missing or wrong,
  ///   or a key that CheckKey() refuses; PassingError for an address that the
  ///   machine does not have, or a key that is not valid yet.
  /// @throws TransportError
  explicit Participant(const DdsOptions& options, LogSink log = {},
                       const std::string& name = "fdi");
  ~Participant();
  Participant(const Participant&) = delete;
  Participant& operator=(const Participant&) = delete;

  const DdsOptions& options() const;
  /// Datagrams received by all endpoints. Refused ones are dropped, with one
  /// log line per reason.
  DatagramCounts datagrams() const;
  /// Number of participants refused because they have no key of our authority;
  /// the first is logged.
  std::uint64_t refused_participants() const;
  /// Call about once a second: looks whether the interfaces are still those of
  /// the start. @throws PassingError if one is gone or was created again, after
  /// which this participant hears nothing there.
  void RequireInterfaces() const;

  class Impl;
  Impl& impl() { return *impl_; }

 private:
  std::unique_ptr<Impl> impl_;
};

}  // namespace fdi::idl
