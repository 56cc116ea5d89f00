#include "storage/history/health.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <utility>

#include "base/error.h"
#include "base/time_units.h"
#include "diagnosis/model/fault_catalogue.h"
#include "diagnosis/model/model_set.h"
#include "diagnosis/records/valve_glob.h"
#include "storage/database/bytes.h"
#include "storage/history/sql.h"

namespace fdi::storage {
namespace sql = history_sql;

// The bytes of an hour, format 2, and 3 with stroke tests:
//
//   hour     = head seen alarm open shut live_samples normal_factor travel
//              reversals  counts  channels channel*  filled bin*  strength* 0
//              [tests test*]
//   head     = uint8: the format, with 0x80 if flow is in t/h
//   counts   = present number*: bit i of `present` is set if number i of
//              loop::ValveCounts follows; that of the time in automatic is
//              what it lacks of `seen`
//   channel  = uint8 signal, int8 exponent
//   filled   = uint16: bit b is set if bin b has samples
//   bin      = for each channel: samples [residual square output]
//   strength = fault samples strength
//   test     = start [ns], period, stroke, 0 or 1 stroke and start of the last
//   stroke   = samples, ends of CV and X, for CV rising and then falling: moves
//              unanswered, the figures; those of the signature. In figures, bit
//              i of a number says whether value i follows
//
// Values of stroke tests are in 10^-4 of their unit.
// Numbers without a type are zigzag-coded LEB128; the three sums of a channel
// are omitted if it has no samples.
namespace {

constexpr std::uint8_t kFormat = 2;
constexpr std::uint8_t kWithStrokes = 3;  // As sql::stroke_hours knows.
constexpr std::uint8_t kTonnes = 0x80;    // beside the format: flow in t/h

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

constexpr double kStrokeQuantum = 1e-4;

void PutValue(ByteWriter& out, double value) {
  constexpr double kMost = 1e12;
  PutNumber(out,
            std::llround(std::clamp(value, -kMost, kMost) / kStrokeQuantum));
}

double GetValue(ByteReader& in) {
  return static_cast<double>(GetNumber(in)) * kStrokeQuantum;
}

template <std::size_t N>
void PutFigures(ByteWriter& out,
                const std::array<std::optional<double>, N>& figures) {
  std::int64_t present = 0;
  for (std::size_t i = 0; i < N; ++i) {
    present |= figures[i] ? std::int64_t{1} << i : 0;
  }
  PutNumber(out, present);
  for (const auto& figure : figures) {
    if (figure) {
      PutValue(out, *figure);
    }
  }
}

template <std::size_t N>
std::array<std::optional<double>, N> GetFigures(ByteReader& in) {
  const std::size_t present =
      GetCount(in, (std::int64_t{1} << N) - 1, "figures of a stroke test");
  std::array<std::optional<double>, N> figures;
  for (std::size_t i = 0; i < N; ++i) {
    if ((present >> i & 1U) != 0) {
      figures[i] = GetValue(in);
    }
  }
  return figures;
}

void PutStroke(ByteWriter& out, const loop::Stroke& stroke) {
  PutNumber(out, static_cast<std::int64_t>(stroke.end - stroke.begin));
  for (const double end :
       {stroke.cv_low, stroke.cv_high, stroke.x_low, stroke.x_high}) {
    PutValue(out, end);
  }
  for (const loop::StrokeWay* way : {&stroke.rising, &stroke.falling}) {
    PutNumber(out, way->moves);
    PutNumber(out, way->unanswered);
    PutFigures(out, std::array{way->delay_s, way->t63_s, way->t86_s,
                               way->overshoot_pct, way->breakaway_pct,
                               way->breakaway_kpa});
  }
  std::array<std::optional<double>, 4> signature;
  if (const auto& s = stroke.signature) {
    signature = {s->friction_kpa, s->spring_kpa_per_pct, s->at_0_kpa,
                 s->at_100_kpa};
  }
  PutFigures(out, signature);
}

loop::Stroke GetStroke(ByteReader& in) {
  constexpr std::int64_t kMost = 1'000'000'000;
  loop::Stroke stroke;
  stroke.end = GetCount(in, kMost, "samples of a stroke test");
  for (double* end :
       {&stroke.cv_low, &stroke.cv_high, &stroke.x_low, &stroke.x_high}) {
    *end = GetValue(in);
  }
  for (loop::StrokeWay* way : {&stroke.rising, &stroke.falling}) {
    way->moves = static_cast<int>(GetCount(in, kMost, "moves"));
    way->unanswered = static_cast<int>(GetCount(in, kMost, "unanswered"));
    const auto figures = GetFigures<6>(in);
    way->delay_s = figures[0];
    way->t63_s = figures[1];
    way->t86_s = figures[2];
    way->overshoot_pct = figures[3];
    way->breakaway_pct = figures[4];
    way->breakaway_kpa = figures[5];
  }
  if (const auto signature = GetFigures<4>(in); signature[0]) {
    stroke.signature = {*signature[0], signature[1].value_or(0.0),
                        signature[2].value_or(0.0), signature[3].value_or(0.0)};
  }
  return stroke;
}

void PutStrokes(ByteWriter& out, const HealthHour& hour) {
  PutNumber(out, static_cast<std::int64_t>(hour.strokes.size()));
  for (const StrokeTest& test : hour.strokes) {
    PutNumber(out, test.start_ns);
    PutValue(out, test.period_s);
    PutStroke(out, test.stroke);
    PutNumber(out, test.last ? 1 : 0);
    if (test.last) {
      PutStroke(out, *test.last);
      PutNumber(out, test.last_ns);
    }
  }
}

void GetStrokes(ByteReader& in, HealthHour& hour) {
  const std::size_t tests =
      GetCount(in, HealthHour::kMaxStrokes, "stroke tests");
  for (std::size_t i = 0; i < tests; ++i) {
    StrokeTest test;
    test.start_ns = GetNumber(in);
    test.period_s = GetValue(in);
    test.stroke = GetStroke(in);
    if (GetCount(in, 1, "last stroke test") == 1) {
      test.last = GetStroke(in);
      test.last_ns = GetNumber(in);
    }
    hour.AddStroke(std::move(test));
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

HealthHour Unpacked(const Statement& row, int column, HealthHour hour) {
  hour.live_ms = row.Int64(column);
  UnpackHealth(row.Blob(column + 1), hour);
  return hour;
}

// An hour that was stored with other channels under the same hash cannot be
// added to: the newer part replaces it.
HealthHour Sum(const HealthHour& stored, const HealthHour& part) {
  if (stored.channels != part.channels) {
    return part;
  }
  HealthHour sum = stored;
  sum.Add(part);
  return sum;
}

// The latest test of `hour` before `test` that it can be compared with.
const StrokeTest* LastIn(const HealthHour& hour, const StrokeTest& test) {
  const StrokeTest* last = nullptr;
  for (const StrokeTest& other : hour.strokes) {
    if (other.start_ns < test.start_ns && AreAlike(other.stroke, test.stroke)) {
      last = &other;
    }
  }
  return last;
}

// Tests are rare, so a look at each hour of the valve with one is cheap enough
// without an index.
void CompareWithLast(Database& database, HealthHour& hour) {
  for (StrokeTest& test : hour.strokes) {
    std::optional<StrokeTest> newest;
    const auto take = [&](const HealthHour& other) {
      const StrokeTest* last = LastIn(other, test);
      if (last != nullptr && (!newest || newest->start_ns < last->start_ns)) {
        newest = *last;
      }
    };
    take(hour);
    Statement row = database.Prepare(sql::stroke_hours);
    row.Bind(hour.valve_id, hour.hour);
    std::int64_t found_in = std::numeric_limits<std::int64_t>::min();
    while (row.Step() && row.Int64(0) >= found_in) {
      HealthHour stored;
      stored.valve_id = hour.valve_id;
      row.Read(0, stored.hour, stored.model_hash, stored.epoch);
      const std::int64_t stored_hour = stored.hour;
      try {
        take(Unpacked(row, 3, std::move(stored)));
      } catch (const DataError&) {
        continue;  // A damaged hour does not keep this one from being stored.
      }
      found_in = newest ? stored_hour : found_in;
    }
    if (newest) {
      test.last = newest->stroke;
      test.last_ns = newest->start_ns;
    }
  }
}

}  // namespace

std::vector<std::byte> PackHealth(const HealthHour& hour) {
  ByteWriter out;
  out.Put(static_cast<std::uint8_t>(
      (hour.strokes.empty() ? kFormat : kWithStrokes) |
      (hour.flow_unit == FlowUnit::kTPerHour ? kTonnes : 0)));
  ForEachNumber(hour, [&out](std::int64_t value) { PutNumber(out, value); });
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
  if (!hour.strokes.empty()) {
    PutStrokes(out, hour);
  }
  return out.Take();
}

void UnpackHealth(std::span<const std::byte> bytes, HealthHour& hour) {
  ByteReader in(bytes, "health of " + hour.valve_id);
  const auto head = in.Get<std::uint8_t>();
  const int format = head & ~kTonnes;
  if (format < kFormat || format > kWithStrokes) {
    in.Refuse("format " + std::to_string(format) +
              " is not known to this program");
  }
  hour.flow_unit =
      (head & kTonnes) != 0 ? FlowUnit::kTPerHour : FlowUnit::kM3PerHour;
  ForEachNumber(hour, [&in](std::int64_t& value) { value = GetNumber(in); });
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
  hour.strokes.clear();
  if (format == kWithStrokes) {
    GetStrokes(in, hour);
  }
  in.ExpectEnd();
}

std::size_t StoreHealth(Database& database, std::span<const HealthHour> hours) {
  Statement old = database.Prepare(sql::health_hour);
  Statement row = database.Prepare(sql::put_health_hour);
  std::size_t worse = 0;
  for (HealthHour part : hours) {
    if (!part.strokes.empty()) {
      CompareWithLast(database, part);
      worse += static_cast<std::size_t>(std::ranges::count_if(
          part.strokes,
          [](const StrokeTest& test) { return !test.Worse().empty(); }));
    }
    HealthHour key;
    key.valve_id = part.valve_id;
    key.hour = part.hour;
    key.model_hash = part.model_hash;
    key.epoch = part.epoch;
    old.Bind(key.valve_id, key.hour, key.model_hash, key.epoch);
    const HealthHour sum =
        old.Step() ? Sum(Unpacked(old, 0, std::move(key)), part) : part;
    old.Reset();
    const std::vector<std::byte> bytes = PackHealth(sum);
    row.Bind(sum.valve_id, sum.hour, sum.model_hash, sum.epoch, sum.live_ms,
             std::span<const std::byte>(bytes))
        .Run();
  }
  return worse;
}

std::int64_t HourFrom(std::int64_t stamp_ns) {
  // ⌈stamp / 1 h⌉: division rounds towards zero, which is already up for a
  // negative stamp, whose remainder is not positive.
  return stamp_ns / kNsPerHour + (stamp_ns % kNsPerHour > 0 ? 1 : 0);
}

std::vector<HealthHour> ReadHealth(Database& database,
                                   const HealthFilter& filter) {
  Statement row = database.Prepare(sql::health_hours);
  row.Bind(filter.valve_id, HourFrom(filter.since_ns),
           HourFrom(filter.until_ns));
  std::vector<HealthHour> hours;
  while (row.Step()) {
    HealthHour hour;
    hour.valve_id = filter.valve_id;
    row.Read(0, hour.hour, hour.model_hash, hour.epoch);
    hours.push_back(Unpacked(row, 3, std::move(hour)));
  }
  return hours;
}

std::vector<std::string> HealthValves(Database& database,
                                      const std::string& glob) {
  Statement next = database.Prepare(sql::next_health_valve);
  std::vector<std::string> valves;
  std::string last;
  // Each step is one look into the primary key, so the costs grow with the
  // number of valves, not with that of their hours.
  while (next.Bind(last).Step() && !next.IsNull(0)) {
    last = next.Text(0);
    if (GlobMatches(glob, last)) {
      valves.push_back(last);
    }
  }
  return valves;
}

}  // namespace fdi::storage
