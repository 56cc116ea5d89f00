#pragma once

#include <cstdint>
#include <memory>
#include <stdexcept>
#include <string>

#include "diagnosis/log.h"
#include "idl/datagram.h"

namespace fdi::idl {

/// A call of the DDS library failed. what() names the operation. Exit code 4.
class TransportError : public std::runtime_error {
 public:
  TransportError(const std::string& operation, int code);
  int code() const noexcept { return code_; }  ///< DDS return code.

 private:
  int code_;
};

struct DdsOptions {
  int domain{0};  ///< 0..232
  /// Addresses of the interfaces to speak on, separated by commas, or "all".
  std::string interfaces{"127.0.0.1"};
  std::string transport{"udp"};  ///< udp | shm | default (both).
  std::string qos_file;          ///< XML with profiles of qos.h; may be empty.
  /// Folder of a key as fdi-store keys makes it; without one the bus is open.
  std::string security;
  int max_valves{2000};  ///< 1..100000; what is beyond is not served.
};

/// @throws ConfigError naming the option, its value and the accepted ones.
void Validate(const DdsOptions& options);

/// A DDS participant; alive from construction on, found by its peers within
/// some 100 ms. A peer that dies without a word is noticed after 5 s.
///
/// Outlives its endpoints. Thread safe. What the library itself has to say goes
/// to `log`, throttled, never to stdout.
class Participant {
 public:
  /// @param name For tools that list participants, e.g. "fdi-monitor".
  /// @throws ConfigError on bad options or a QoS file that is missing or wrong,
  ///   or a key that CheckKey() refuses.
  /// @throws TransportError
  explicit Participant(const DdsOptions& options, LogSink log = {},
                       const std::string& name = "fdi");
  ~Participant();
  Participant(const Participant&) = delete;
  Participant& operator=(const Participant&) = delete;

  const DdsOptions& options() const;
  /// What came from the network, all endpoints together. What is refused is
  /// dropped, with one line in the log for each reason.
  DatagramCounts datagrams() const;
  /// Participants that were refused for want of a key of the authority; the
  /// first is in the log.
  std::uint64_t refused_participants() const;

  class Impl;
  Impl& impl() { return *impl_; }

 private:
  std::unique_ptr<Impl> impl_;
};

}  // namespace fdi::idl
