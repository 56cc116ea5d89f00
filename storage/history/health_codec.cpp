#include <cstdint>
#include <string>

#include "diagnosis/model/fault_catalogue.h"
#include "diagnosis/model/model_set.h"
#include "storage/database/bytes.h"
#include "storage/history/health.h"

namespace fdi::storage {

// The bytes of an hour, format 3:
//
//   hour     = head seen alarm open shut live_samples normal_factor travel
//              reversals share  counts  channels channel*  filled bin*
//              strength* 0
//   head     = uint8: the format, with 0x80 if flow is in t/h
//   counts   = present number*: bit i of `present` is set if number i of
//              loop::ValveCounts follows; that of the time in automatic is
//              what it lacks of `seen`
//   channel  = uint8 signal, int8 exponent
//   filled   = uint16: bit b is set if bin b has samples
//   bin      = for each channel: samples [residual square output]
//   strength = fault samples strength
//
// Numbers without a type are zigzag-coded LEB128; the three sums of a channel
// are omitted if it has no samples.
namespace {

constexpr std::uint8_t kFormat = 3;
constexpr std::uint8_t kNoShare = 2;    // the format of before, without share
constexpr std::uint8_t kTonnes = 0x80;  // beside the format: flow in t/h

// LEB128 with zigzag coding: 0, -1, 1, -2, ... become 0, 1, 2, 3, ...
void PutNumber(ByteWriter& out, std::int64_t value) {
  auto rest = (static_cast<std::uint64_t>(value) << 1) ^
              static_cast<std::uint64_t>(value >> 63);
  while (rest >= 0x80) {
    out.Put(static_cast<std::uint8_t>(rest | 0x80));
    rest >>= 7;
  }
  out.Put(static_cast<std::uint8_t>(rest));
}

std::int64_t GetNumber(ByteReader& in) {
  std::uint64_t folded = 0;
  // 64 bits are at most ten groups of 7; the tenth has one bit.
  for (unsigned shift = 0; shift < 64; shift += 7) {
    const auto byte = in.Get<std::uint8_t>();
    folded |= static_cast<std::uint64_t>(byte & 0x7F) << shift;
    if (byte < 0x80) {
      return static_cast<std::int64_t>(folded >> 1) ^
             -static_cast<std::int64_t>(folded & 1);
    }
  }
  in.Refuse("a number has no end");
}

std::size_t GetCount(ByteReader& in, std::int64_t limit, const char* what) {
  const std::int64_t count = GetNumber(in);
  if (count < 0 || count > limit) {
    in.Refuse(std::string(what) + " " + std::to_string(count) +
              " is not in 0.." + std::to_string(limit));
  }
  return static_cast<std::size_t>(count);
}

void PutCounts(ByteWriter& out, const HealthHour& hour) {
  loop::ValveCounts counts = hour.counts;
  counts.auto_ms = hour.seen_ms - counts.auto_ms;  // Mostly 0.
  std::int64_t present = 0;
  for (std::size_t i = 0; i < loop::kValveCounts.size(); ++i) {
    const bool some = counts.*loop::kValveCounts[i] != 0;
    present |= some ? std::int64_t{1} << i : 0;
  }
  PutNumber(out, present);
  for (const auto count : loop::kValveCounts) {
    if (counts.*count != 0) {
      PutNumber(out, counts.*count);
    }
  }
}

// After the times.
void GetCounts(ByteReader& in, HealthHour& hour) {
  constexpr std::size_t kCounts = loop::kValveCounts.size();
  const std::size_t present =
      GetCount(in, (std::int64_t{1} << kCounts) - 1, "counts");
  for (std::size_t i = 0; i < kCounts; ++i) {
    hour.counts.*loop::kValveCounts[i] =
        (present >> i & 1U) != 0 ? GetNumber(in) : 0;
  }
  hour.counts.auto_ms = hour.seen_ms - hour.counts.auto_ms;
}

void PutBins(ByteWriter& out, const HealthHour& hour) {
  std::uint16_t filled = 0;
  for (std::size_t b = 0; b < hour.bins.size(); ++b) {
    filled = static_cast<std::uint16_t>(filled |
                                        (hour.bins[b].empty() ? 0U : 1U << b));
  }
  out.Put(filled);
  for (const auto& bin : hour.bins) {
    for (const ResidualSums& sums : bin) {
      PutNumber(out, sums.samples);
      if (sums.samples != 0) {
        PutNumber(out, sums.residual);
        PutNumber(out, sums.square);
        PutNumber(out, sums.output);
      }
    }
  }
}

void GetBins(ByteReader& in, HealthHour& hour) {
  const auto filled = in.Get<std::uint16_t>();
  for (std::size_t b = 0; b < hour.bins.size(); ++b) {
    if ((filled >> b & 1U) == 0) {
      continue;
    }
    hour.bins[b].resize(hour.channels.size());
    for (ResidualSums& sums : hour.bins[b]) {
      sums.samples = GetNumber(in);
      if (sums.samples != 0) {
        sums.residual = GetNumber(in);
        sums.square = GetNumber(in);
        sums.output = GetNumber(in);
      }
    }
  }
}

// Visits the fixed numbers of an hour in storage order.
template <typename Hour, typename Visit>
void ForEachNumber(Hour& hour, Visit visit) {
  // live_ms is not among them: it is a column of its own.
  visit(hour.seen_ms);
  visit(hour.alarm_ms);
  visit(hour.open_ms);
  visit(hour.shut_ms);
  visit(hour.live_samples);
  visit(hour.normal_factor);
  visit(hour.travel);
  visit(hour.reversals);
}

}  // namespace

std::vector<std::byte> PackHealth(const HealthHour& hour) {
  ByteWriter out;
  out.Put(static_cast<std::uint8_t>(
      kFormat | (hour.flow_unit == FlowUnit::kTPerHour ? kTonnes : 0)));
  ForEachNumber(hour, [&out](std::int64_t value) { PutNumber(out, value); });
  PutNumber(out, hour.share);
  PutCounts(out, hour);
  PutNumber(out, static_cast<std::int64_t>(hour.channels.size()));
  for (const HealthChannel& channel : hour.channels) {
    out.Put(static_cast<std::uint8_t>(channel.output));
    out.Put(static_cast<std::int8_t>(channel.exponent));
  }
  PutBins(out, hour);
  for (const StrengthSums& sums : hour.strengths) {
    PutNumber(out, sums.fault);
    PutNumber(out, sums.samples);
    PutNumber(out, sums.strength);
  }
  PutNumber(out, 0);  // no further fault
  return out.Take();
}

void UnpackHealth(std::span<const std::byte> bytes, HealthHour& hour) {
  ByteReader in(bytes, "health of " + hour.valve_id);
  const auto head = in.Get<std::uint8_t>();
  const int format = head & ~kTonnes;
  if (format != kFormat && format != kNoShare) {
    in.Refuse("format " + std::to_string(format) +
              " is not known to this program");
  }
  hour.flow_unit =
      (head & kTonnes) != 0 ? FlowUnit::kTPerHour : FlowUnit::kM3PerHour;
  ForEachNumber(hour, [&in](std::int64_t& value) { value = GetNumber(in); });
  hour.share = format == kFormat ? GetNumber(in) : 0;
  GetCounts(in, hour);
  hour.channels.resize(GetCount(in, kMaxChannels, "channels"));
  for (HealthChannel& channel : hour.channels) {
    const auto signal = in.Get<std::uint8_t>();
    if (signal >= kModelSignalCount) {
      in.Refuse("signal " + std::to_string(signal));
    }
    channel = {static_cast<Signal>(signal), in.Get<std::int8_t>()};
  }
  GetBins(in, hour);
  while (const std::size_t fault = GetCount(in, kLastFinding, "fault")) {
    // This is a statement of its own because the order in which the arguments
    // of a call are evaluated is not specified.
    const std::int64_t samples = GetNumber(in);
    hour.AddStrength(static_cast<int>(fault), samples, GetNumber(in));
  }
  in.ExpectEnd();
}

}  // namespace fdi::storage
