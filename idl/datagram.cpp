// An RTPS message is a header and submessages:
//
//     message    = "RTPS" version(2) vendor(2) prefix(12) {submessage}
//     submessage = kind(1) flags(1) length(2) body(length) {pad to 4}
//
// Bit 0 of the flags: numbers are little endian. Length 0 means until the end
// of the message, except for PAD and INFO_TS.
#include "idl/datagram.h"

#include <algorithm>
#include <utility>
#include <vector>

namespace fdi::idl {
namespace {

using Bytes = std::span<const std::uint8_t>;

constexpr std::size_t kHeaderBytes = 20;
constexpr std::size_t kSubmessageHeaderBytes = 4;
constexpr std::uint8_t kPad = 0x01;
constexpr std::uint8_t kAckNack = 0x06;
constexpr std::uint8_t kHeartbeat = 0x07;
constexpr std::uint8_t kGap = 0x08;
constexpr std::uint8_t kInfoTs = 0x09;
constexpr std::uint8_t kInfoSrc = 0x0c;
constexpr std::uint8_t kNackFrag = 0x12;
constexpr std::uint8_t kHeartbeatFrag = 0x13;
constexpr std::uint8_t kData = 0x15;
constexpr std::uint8_t kDataFrag = 0x16;
constexpr std::uint8_t kFirstOfVendors = 0x80;
constexpr std::uint8_t kInlineQosFlag = 0x02;
constexpr std::uint8_t kDataFlag = 0x04;
constexpr std::uint8_t kKeyFlag = 0x08;
constexpr std::uint8_t kInvalidateFlag = 0x02;  // INFO_TS without a time.
constexpr std::uint16_t kSentinel = 1;          // Ends a parameter list.
constexpr std::uint16_t kKeyHash = 0x70;

// A writer of 20 000 messages a second gets here after 20 months. The library
// aborts at the end of the range, and iterates up to a new writer's current
// number.
constexpr std::int64_t kSequenceLimit = std::int64_t{1} << 40;
// The library allocates the sample size that a fragment claims. Our samples
// have a few kB.
constexpr std::int64_t kMaxSampleBytes = 65'536;

// Minimum size of a body; -1 for an unknown kind.
int MinBodySize(std::uint8_t kind, std::uint8_t flags) {
  switch (kind) {
    case kPad:
      return 0;
    case kAckNack:
      return 24;
    case kHeartbeat:
    case kGap:
    case kNackFrag:
      return 28;
    case kHeartbeatFrag:
      return 24;
    case kInfoTs:
      return (flags & kInvalidateFlag) != 0 ? 0 : 8;
    case kInfoSrc:
      return 20;
    case 0x0e:  // INFO_DST
      return 12;
    case 0x0d:  // INFO_REPLY_IP4
    case 0x0f:  // INFO_REPLY
      return 4;
    case kData:
      return 20;
    case kDataFrag:
      return 32;
    default:  // DDS Security: SEC_BODY to SRTPS_POSTFIX.
      return kind >= 0x30 && kind <= 0x34 ? 0 : -1;
  }
}

// A body and its byte order. Readers do not check bounds: callers must know
// that it is long enough.
struct Body {
  Bytes bytes;
  bool little_endian;

  std::uint16_t U16(std::size_t at) const {
    const std::uint16_t a = bytes[at];
    const std::uint16_t b = bytes[at + 1];
    return static_cast<std::uint16_t>(little_endian ? a | b << 8U
                                                    : a << 8U | b);
  }
  std::int64_t U32(std::size_t at) const {
    const std::int64_t a = U16(at);
    const std::int64_t b = U16(at + 2);
    return little_endian ? a | b << 16 : a << 16 | b;
  }
  // 64 bits, high half first; -1 if no writer can have reached it.
  std::int64_t Sequence(std::size_t at) const {
    const std::int64_t high = U32(at);
    return high < kSequenceLimit >> 32 ? high << 32 | U32(at + 4) : -1;
  }
};

// True if the parameter list of a data submessage, which begins at `at`, lies
// inside it. Calls see(id) for each parameter.
template <typename See>
bool ReadParameters(const Body& body, std::size_t at, See see) {
  for (bool ended = false; !ended;) {
    if (at + 4 > body.bytes.size()) {
      return false;
    }
    const std::uint16_t id = body.U16(at);
    see(id);
    ended = id == kSentinel;
    at += 4U + (ended ? 0U : (body.U16(at + 2) + 3U) & ~3U);
  }
  return at <= body.bytes.size();
}

// Position of the parameters; the offset counts from behind itself.
std::size_t ParametersOf(const Body& body) {
  return 4U + body.U16(2);
}

bool DataIsSound(const Body& body, std::uint8_t flags, std::size_t fixed) {
  const std::size_t at = ParametersOf(body);
  return body.Sequence(12) >= 1 && at >= fixed && at <= body.bytes.size() &&
         ((flags & kInlineQosFlag) == 0 ||
          ReadParameters(body, at, [](std::uint16_t) {}));
}

// True if valid data is a dispose with nothing but a serialized key.
bool IsBareKey(const Body& body, std::uint8_t flags) {
  constexpr std::uint8_t kEndOfInstance = kKeyFlag | kInlineQosFlag;
  if ((flags & (kEndOfInstance | kDataFlag)) != kEndOfInstance ||
      IsOfDiscovery(body.bytes[11])) {
    return false;
  }
  bool has_hash = false;
  ReadParameters(body, ParametersOf(body), [&](std::uint16_t id) {
    has_hash = has_hash || id == kKeyHash;
  });
  return !has_hash;
}

bool ContentIsSound(std::uint8_t kind, std::uint8_t flags, const Body& body) {
  switch (kind) {
    case kData:
      return DataIsSound(body, flags, 20);
    case kDataFrag:
      // Our messages need no fragments, and the library aborts on one that it
      // gets both whole and in fragments.
      return IsOfDiscovery(body.bytes[11]) && DataIsSound(body, flags, 32) &&
             body.U32(20) > 0 && body.U16(24) > 0 && body.U16(26) > 0 &&
             body.U32(28) <= kMaxSampleBytes;
    case kHeartbeat:
      return body.Sequence(8) > 0 && body.Sequence(16) >= 0;
    case kGap:
      return body.Sequence(8) > 0 && body.Sequence(16) > 0 &&
             body.U32(24) <= 256;
    case kAckNack:
      return body.Sequence(8) >= 0 && body.U32(16) <= 256;
    case kNackFrag:
      return body.Sequence(8) >= 0 && body.U32(20) <= 256;
    default:
      return true;
  }
}

// The sender: that of the header until an INFO_SRC changes it.
class Speaker {
 public:
  explicit Speaker(Bytes message) { SetPrefix(message.subspan(8)); }

  void SetPrefix(Bytes prefix) {
    std::copy_n(prefix.begin(), kPrefixBytes, guid_.begin());
  }

  const WriterGuid& Writer(Bytes entity) {
    std::copy_n(entity.begin(), 4, guid_.begin() + kPrefixBytes);
    return guid_;
  }

 private:
  static constexpr std::size_t kPrefixBytes = 12;
  WriterGuid guid_{};
};

// Numbers that the submessages of one datagram leave out, by writer.
using Gaps = std::vector<std::pair<WriterGuid, std::int64_t>>;

// True if a valid submessage contains only numbers that its writer can have
// reached. `gaps` takes those that it leaves out.
bool HasPlausibleNumbers(std::uint8_t kind, const Body& body, Speaker& speaker,
                         WriterPace& pace, WriterPace::Clock::time_point now,
                         Gaps& gaps) {
  switch (kind) {
    case kData:
    case kDataFrag:
      return pace.Admit(speaker.Writer(body.bytes.subspan(8)),
                        body.Sequence(12), 0, now);
    case kHeartbeat:
      return pace.Admit(speaker.Writer(body.bytes.subspan(4)),
                        std::max(body.Sequence(8), body.Sequence(16)), 0, now);
    case kGap: {
      const std::int64_t start = body.Sequence(8);
      const std::int64_t base = body.Sequence(16);
      const std::int64_t bits = body.U32(24);
      const std::int64_t left_out =
          std::max<std::int64_t>(0, base - start) + bits;
      const WriterGuid& writer = speaker.Writer(body.bytes.subspan(4));
      const bool admitted = pace.Admit(writer, base + bits, left_out, now);
      if (admitted) {
        gaps.emplace_back(writer, left_out);
      }
      return admitted;
    }
    case kInfoSrc:
      speaker.SetPrefix(body.bytes.subspan(8));
      return true;
    default:
      return true;
  }
}

// Processes a valid acknowledgement, whose body is at `begin` of the datagram:
// reader(4) writer(4) base(8) bits(4) bitmap count(4).
void TakeCount(const Body& body, std::size_t begin, Speaker& speaker,
               AckCounts& acks, CheckedDatagram& checked) {
  const auto bits = static_cast<std::size_t>(body.U32(16));
  const std::size_t at = 20 + (bits + 31) / 32 * 4;
  if (at + 4 > body.bytes.size()) {
    return;  // The library refuses it.
  }
  const auto count = static_cast<std::uint32_t>(body.U32(at));
  const Body entity{body.bytes.subspan(4, 4), true};
  const bool first_word = body.Sequence(8) == 0 && bits == 0;
  const std::uint32_t next =
      acks.Next(speaker.Writer(body.bytes),
                static_cast<std::uint32_t>(entity.U32(0)), count, first_word);
  if (next == count) {
    return;
  }
  std::array<std::uint8_t, 4> bytes{};
  for (std::size_t i = 0; i < 4; ++i) {
    const std::size_t shift = 8 * (body.little_endian ? i : 3 - i);
    bytes.at(i) = static_cast<std::uint8_t>(next >> shift);
  }
  checked.counts.emplace_back(begin + at, bytes);
}

}  // namespace

std::string_view DatagramVerdictName(DatagramVerdict verdict) {
  constexpr std::array<std::string_view, kDatagramVerdictCount> kNames{
      "sound", "header", "length", "kind", "content", "pace"};
  return kNames[static_cast<std::size_t>(verdict)];
}

CheckedDatagram CheckDatagram(Bytes datagram, WriterPace& pace,
                              WriterPace::Clock::time_point now,
                              AckCounts* acks) {
  const std::size_t size = datagram.size();
  if (size < kHeaderBytes || datagram[0] != 'R' || datagram[1] != 'T' ||
      datagram[2] != 'P' || datagram[3] != 'S' || datagram[4] != 2) {
    return {DatagramVerdict::kHeader, 0};
  }
  Speaker speaker(datagram);
  std::size_t sound = kHeaderBytes;  // Everything up to here is passed on.
  CheckedDatagram checked;
  Gaps gaps;
  for (std::size_t at = sound; at < size;) {
    if (size - at < kSubmessageHeaderBytes) {
      return {DatagramVerdict::kLength, 0};
    }
    const std::uint8_t kind = datagram[at];
    const std::uint8_t flags = datagram[at + 1];
    const Body header{datagram.subspan(at), (flags & 1U) != 0};
    const std::size_t begin = at + kSubmessageHeaderBytes;
    const std::size_t stated = header.U16(2);
    const bool to_end = stated == 0 && kind != kPad && kind != kInfoTs;
    const std::size_t length = to_end ? size - begin : stated;
    // When a datagram is full, the statistics that Fast DDS 2.9.1 appends
    // exceed what the receiver accepts by four bytes.
    if (length > size - begin && kind < kFirstOfVendors) {
      return {DatagramVerdict::kLength, 0};
    }
    const std::size_t end =
        begin + std::min((length + 3) & ~std::size_t{3}, size - begin);
    if (kind < kFirstOfVendors) {
      const int least = MinBodySize(kind, flags);
      if (least < 0 || at != sound) {  // Follows a vendor submessage.
        return {DatagramVerdict::kKind, 0};
      }
      if (length < static_cast<std::size_t>(least)) {
        return {DatagramVerdict::kLength, 0};
      }
      const Body body{datagram.subspan(begin, length), header.little_endian};
      if (!ContentIsSound(kind, flags, body)) {
        return {DatagramVerdict::kContent, 0};
      }
      if (!HasPlausibleNumbers(kind, body, speaker, pace, now, gaps)) {
        for (const auto& [writer, left_out] : gaps) {
          pace.Refund(writer, left_out);
        }
        return {DatagramVerdict::kPace, 0};
      }
      if (kind == kData && IsBareKey(body, flags)) {
        checked.bare_keys.push_back(at + 1);
      }
      if (kind == kAckNack && acks != nullptr) {
        TakeCount(body, begin, speaker, *acks, checked);
      }
      sound = end;
    }
    at = end;
  }
  checked.bytes = sound;
  return checked;
}

void Amend(const CheckedDatagram& checked, std::span<std::uint8_t> datagram) {
  for (const std::size_t at : checked.bare_keys) {
    datagram[at] ^= kKeyFlag | kDataFlag;
  }
  for (const auto& [at, bytes] : checked.counts) {
    std::ranges::copy(bytes,
                      datagram.begin() + static_cast<std::ptrdiff_t>(at));
  }
}

}  // namespace fdi::idl
