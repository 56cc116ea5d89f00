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

/// Says if a datagram is passed to the DDS library, and if not, why.
enum class DatagramVerdict : std::uint8_t {
  kSound,
  kHeader,   ///< Not RTPS 2: magic, version, or too short.
  kLength,   ///< A submessage is too long, or too short for its kind.
  kKind,     ///< A kind of submessage that is not in the standard.
  kContent,  ///< Invalid numbers or lengths inside.
  kPace,     ///< Sequence numbers that its writer cannot have reached yet.
};
inline constexpr std::size_t kDatagramVerdictCount = 6;

/// "sound", "header", ...
std::string_view DatagramVerdictName(DatagramVerdict verdict);

struct CheckedDatagram {
  DatagramVerdict verdict{DatagramVerdict::kSound};
  /// Bytes to pass on, from the front: all except vendor submessages at the
  /// end. Every Fast DDS participant appends one with statistics.
  std::size_t bytes{0};
  /// Offsets of the flags of disposes that contain nothing but a serialized
  /// key, as Cyclone DDS sends them: see Amend().
  std::vector<std::size_t> bare_keys{};
  /// Acknowledgement counts to overwrite: offset and bytes.
  std::vector<std::pair<std::size_t, std::array<std::uint8_t, 4>>> counts{};

  bool as_it_is() const { return bare_keys.empty() && counts.empty(); }
};

/// Checks the framing of an RTPS message [OMG formal/2022-04-01, 9.4.5], which
/// Fast DDS 2.9.1 trusts: it aborts on a statistics submessage that is not the
/// last, on sequence numbers at the end of their range, and on a message that
/// comes both whole and in fragments; it reads beyond a submessage that is
/// shorter than its parameters, allocates up to 4 GB for a fragment, and
/// iterates over every number that a heartbeat or gap skips.
/// @param pace state of the writers heard so far; updated.
/// @param acks state of the readers heard so far; null: counts are not changed.
CheckedDatagram CheckDatagram(std::span<const std::uint8_t> datagram,
                              WriterPace& pace,
                              WriterPace::Clock::time_point now,
                              AckCounts* acks = nullptr);

/// Applies the changes. Fast DDS 2.9.1 and 3.1.2 take a bare key of at most 16
/// bytes for a hash, drop a longer one, and then dispose the instance that they
/// read last. Declared as data, it is read as a message that is truncated after
/// its key. Counts are changed as described in AckCounts.
void Amend(const CheckedDatagram& checked, std::span<std::uint8_t> datagram);

/// Number of datagrams by verdict, since the participant was created.
using DatagramCounts = std::array<std::uint64_t, kDatagramVerdictCount>;

}  // namespace fdi::idl
