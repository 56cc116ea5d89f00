#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "idl/writer_pace.h"

namespace fdi::idl {

/// Whether a datagram goes to the DDS library, or why not.
enum class DatagramVerdict : std::uint8_t {
  kSound,
  kHeader,   ///< Not RTPS 2: magic, version, or too short.
  kLength,   ///< A submessage does not fit into the datagram, or its kind.
  kKind,     ///< A kind of submessage that the standard does not have.
  kContent,  ///< Numbers and lengths inside that no writer has.
  kPace,     ///< Numbers that its writer cannot have reached yet.
};
inline constexpr std::size_t kDatagramVerdictCount = 6;

/// "sound", "header", ...
std::string_view DatagramVerdictName(DatagramVerdict verdict);

struct CheckedDatagram {
  DatagramVerdict verdict{DatagramVerdict::kSound};
  /// What to hand over from the front: all but vendors' own submessages at the
  /// end. Each participant of Fast DDS adds one, its statistics.
  std::size_t bytes{0};
  /// Places of the flags of ends of instances that carry nothing but the key
  /// itself, as Cyclone DDS sends them: see ShowKeys().
  std::vector<std::size_t> bare_keys{};
};

/// Checks the framing of an RTPS message [OMG formal/2022-04-01, 9.4.5], which
/// Fast DDS 2.9.1 believes: it aborts on a statistics submessage that is not
/// the last and on sequence numbers at the end of their range, reads beyond a
/// submessage that is shorter than its parameters, allocates up to 4 GB for a
/// fragment, aborts on a message that comes whole and in fragments, and counts
/// through what a heartbeat or a gap leaps over.
/// @param pace of the writers that were heard so far; takes their numbers.
CheckedDatagram CheckDatagram(std::span<const std::uint8_t> datagram,
                              WriterPace& pace,
                              WriterPace::Clock::time_point now);

/// Fast DDS 2.9.1 and 3.1.2 take a bare key of at most 16 bytes for a hash,
/// drop a longer one, and then end the instance of which they read last.
/// Declared as data it is read as a message that is cut behind its key.
void ShowKeys(const std::vector<std::size_t>& bare_keys,
              std::span<std::uint8_t> datagram);

/// Datagrams by verdict, since the participant exists.
using DatagramCounts = std::array<std::uint64_t, kDatagramVerdictCount>;

}  // namespace fdi::idl
