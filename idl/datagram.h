#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include "idl/ack_counts.h"
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
  /// itself, as Cyclone DDS sends them: see Amend().
  std::vector<std::size_t> bare_keys{};
  /// Counts of acknowledgements to be changed, as bytes at places.
  std::vector<std::pair<std::size_t, std::array<std::uint8_t, 4>>> counts{};

  bool as_it_is() const { return bare_keys.empty() && counts.empty(); }
};

/// Checks the framing of an RTPS message [OMG formal/2022-04-01, 9.4.5], which
/// Fast DDS 2.9.1 believes: it aborts on a statistics submessage that is not
/// the last and on sequence numbers at the end of their range, reads beyond a
/// submessage that is shorter than its parameters, allocates up to 4 GB for a
/// fragment, aborts on a message that comes whole and in fragments, and counts
/// through what a heartbeat or a gap leaps over.
/// @param pace of the writers that were heard so far; takes their numbers.
/// @param acks of the readers that were heard so far; null: counts stay.
CheckedDatagram CheckDatagram(std::span<const std::uint8_t> datagram,
                              WriterPace& pace,
                              WriterPace::Clock::time_point now,
                              AckCounts* acks = nullptr);

/// Fast DDS 2.9.1 and 3.1.2 take a bare key of at most 16 bytes for a hash,
/// drop a longer one, and then end the instance of which they read last.
/// Declared as data it is read as a message that is cut behind its key. Counts
/// are changed as AckCounts says.
void Amend(const CheckedDatagram& checked, std::span<std::uint8_t> datagram);

/// Datagrams by verdict, since the participant exists.
using DatagramCounts = std::array<std::uint64_t, kDatagramVerdictCount>;

}  // namespace fdi::idl
