#include "import/assembler.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

#include "base/text.h"
#include "base/time_units.h"

// Time is that of the stamps. The clock of a source that is silent goes on with
// the steady clock of the caller:
//
//   clock(source) = newest stamp + (now - last word),
//
// so that the instants after its last word become due, and are written without
// its readings. A reading waits in its slot until its instant is written.
namespace fdi::importer {
namespace {

using NoteKind = AssemblyNote::Kind;

// 2000-01-01: a device without a set clock begins at 1970 or 1980.
constexpr std::int64_t kFirstStampNs = 946'684'800 * kNsPerSecond;
// A clock may be set wrong, to another zone at worst by one hour in summer.
// Beyond that no reading is later than its arrival.
constexpr std::int64_t kAheadNs = 3600 * kNsPerSecond;
// A source that goes on by this without a word, while no such time has passed,
// has set its clock: a keep-alive comes more often than once a minute.
constexpr std::int64_t kLeapNs = 60 * kNsPerSecond;
// In a stream that is read faster than it was measured no time tells that a
// clock runs back; so many readings in a row do.
constexpr int kBackReadings = 1000;
constexpr int kToldEmpty = 3;
// In which no valve goes from open to shut.
constexpr std::int64_t kFewSeconds = 2 * kNsPerSecond;
// Words that come at random are twelve mean deviations late once in 15 000
// times (exponential steps: exp(-1 - 12 * 2/e)).
constexpr double kLate = 12.0;
constexpr double kRhythmGain = 1.0 / 16.0;  // per word

// Words of controllers beside those of the row.
std::optional<ValveMode> ModeOf(const LiveValve& valve,
                                const TagReading& reading) {
  const std::string word = reading.word.empty() && reading.value
                               ? NumberText(*reading.value)
                               : std::string(reading.word);
  for (const auto& [known, mode] : valve.map.mode_words) {
    if (SameName(known, word)) {
      return mode;
    }
  }
  return ModeOfWord(word);
}

}  // namespace

std::optional<double> Converted(const ColumnMapping& mapping, double reading) {
  if (!std::isfinite(reading) || reading < mapping.lowest ||
      reading > mapping.highest) {
    return std::nullopt;
  }
  if (mapping.root) {
    const auto [low, high] = *mapping.root;
    const double share = std::max((reading - low) / (high - low), 0.0);
    reading = low + (high - low) * std::sqrt(share);
  }
  // The identity is left out, because 0 + 1 * value would lose the sign of -0.
  double value = mapping.scale != 1.0 || mapping.offset != 0.0
                     ? mapping.offset + mapping.scale * reading
                     : reading;
  if (mapping.clamped) {
    value = std::clamp(value, 0.0, 100.0);
  }
  return mapping.sense == Sense::kOpening ? 100.0 - value : value;
}

Assembler::Assembler(const AssemblerOptions& options,
                     std::vector<LiveValve> valves, Notes notes)
    : options_(options), notes_(std::move(notes)) {
  Replace(std::move(valves));
}

void Assembler::Replace(std::vector<LiveValve> valves) {
  std::vector<Valve> former = std::exchange(valves_, {});
  std::unordered_map<std::string, Valve*> by_id;
  for (Valve& valve : former) {
    by_id[valve.valve.id] = &valve;
  }
  const auto former_tags = std::exchange(tags_, {});
  for (LiveValve& given : valves) {
    Valve& valve = valves_.emplace_back();
    valve.valve = std::move(given);
    const auto add = [&](const std::string& tag,
                         std::optional<ColumnMapping> mapping) {
      Slot& slot = valve.slots.emplace_back();
      slot.mapping = std::move(mapping);
      slot.tag = tag;
      const auto [found, added] = tags_.try_emplace(tag);
      if (const auto old = former_tags.find(tag);
          added && old != former_tags.end()) {
        found->second.counts = old->second.counts;
      }
      slot.counts = &found->second.counts;
      found->second.slots.emplace_back(valves_.size() - 1,
                                       valve.slots.size() - 1);
    };
    for (const ColumnMapping& mapping : valve.valve.map.columns) {
      add(mapping.column, mapping);
    }
    if (!valve.valve.map.mode_column.empty()) {
      add(valve.valve.map.mode_column, std::nullopt);
    }
    const auto old = by_id.find(valve.valve.id);
    if (old == by_id.end()) {
      continue;
    }
    const Progress& before = *old->second;
    static_cast<Progress&>(valve) = before;
    for (Slot& slot : valve.slots) {
      const auto same =
          std::ranges::find_if(old->second->slots, [&](const Slot& other) {
            return other.tag == slot.tag &&
                   other.mapping.has_value() == slot.mapping.has_value();
          });
      if (same != old->second->slots.end()) {
        slot.source = same->source;
        slot.held = same->held;
        slot.pending = same->pending;
      }
    }
  }
}

Taken Assembler::Take(const TagReading& reading, const ArrivalTime& now) {
  const auto found = tags_.find(reading.tag);
  if (found == tags_.end()) {
    return Taken::kUnknownTag;
  }
  Tag& tag = found->second;
  ++tag.counts.readings;
  const std::int64_t stamp_ns = reading.stamp_ns.value_or(now.utc_ns);
  if (stamp_ns < kFirstStampNs || stamp_ns > now.utc_ns + kAheadNs) {
    ++tag.counts.bad;
    return Taken::kBadStamp;
  }
  NamedSource& source = SourceOf(reading.source);
  Speak(source, stamp_ns, now);
  tag.counts.stamp_ns = std::max(tag.counts.stamp_ns, stamp_ns);
  if (std::exchange(tag.counts.silent, false) &&
      valves_[tag.slots.front().first].valve.report == Reporting::kPeriodic) {
    Note(NoteKind::kTagBack, found->first, 0);
  }
  bool usable = reading.quality == SignalQuality::kBad;
  bool late = false;
  for (const auto& [v, s] : tag.slots) {
    Valve& valve = valves_[v];
    Slot& slot = valve.slots[s];
    std::optional<Held> held = HeldOf(valve, slot, reading);
    usable = usable || held;
    if (!held) {
      held = Held{.quality = SignalQuality::kBad};
    }
    held->stamp_ns = stamp_ns;
    held->connection = source.second.connection;
    slot.source = &source;
    if (valve.begun && stamp_ns <= valve.next_ns - options_.period_ns) {
      late = true;
      if (slot.held && stamp_ns < slot.held->stamp_ns) {
        continue;
      }
    }
    Keep(slot, *held);
  }
  tag.counts.late += late ? 1U : 0U;
  if (!usable || reading.quality == SignalQuality::kBad) {
    ++tag.counts.bad;
  }
  return !usable ? Taken::kBadValue : late ? Taken::kLate : Taken::kTaken;
}

// The value is kept as it is in the unit of its signal; nothing if it cannot be
// used.
std::optional<Assembler::Held> Assembler::HeldOf(
    const Valve& valve, const Slot& slot, const TagReading& reading) const {
  if (reading.quality == SignalQuality::kBad) {
    return std::nullopt;
  }
  Held held;
  held.quality = reading.quality;
  if (slot.mapping) {
    const auto value =
        reading.value ? Converted(*slot.mapping, *reading.value) : std::nullopt;
    held.value = value.value_or(0.0);
    return value ? std::optional(held) : std::nullopt;
  }
  const auto mode = ModeOf(valve.valve, reading);
  held.value = mode ? static_cast<double>(*mode) : 0.0;
  return mode ? std::optional(held) : std::nullopt;
}

// Keeps readings by stamp. Only the newest one of an instant counts, which
// bounds the number that wait, however many come.
void Assembler::Keep(Slot& slot, const Held& held) const {
  auto at = slot.pending.end();
  while (at != slot.pending.begin() &&
         std::prev(at)->stamp_ns > held.stamp_ns) {
    --at;
  }
  if (at != slot.pending.begin() &&
      InstantFrom(std::prev(at)->stamp_ns) == InstantFrom(held.stamp_ns)) {
    *std::prev(at) = held;
  } else if (at == slot.pending.end() ||
             InstantFrom(at->stamp_ns) != InstantFrom(held.stamp_ns)) {
    slot.pending.insert(at, held);
  }
}

void Assembler::Alive(std::string_view source,
                      std::optional<std::int64_t> stamp_ns,
                      const ArrivalTime& now) {
  const std::int64_t stamp = stamp_ns.value_or(now.utc_ns);
  if (stamp >= kFirstStampNs && stamp <= now.utc_ns + kAheadNs) {
    NamedSource& found = SourceOf(source);
    found.second.beats = true;
    Speak(found, stamp, now);
  }
}

void Assembler::End(std::string_view name) {
  const auto found = sources_.find(name);
  if (found != sources_.end() && !found->second.ended) {
    Source& source = found->second;
    source.ended = true;
    source.cut_ns = source.newest_ns;
    ++source.connection;
  }
}

Assembler::NamedSource& Assembler::SourceOf(std::string_view name) {
  const auto found = sources_.find(name);
  return found != sources_.end()
             ? *found
             : *sources_.try_emplace(std::string(name)).first;
}

void Assembler::Speak(NamedSource& named, std::int64_t stamp_ns,
                      const ArrivalTime& now) {
  auto& [name, source] = named;
  const std::int64_t since_ns = now.steady_ns - source.heard_ns;
  if (std::exchange(source.silent, false)) {
    Note(NoteKind::kSourceBack, name, since_ns);
  }
  if (source.newest_ns == 0) {
    source.newest_ns = stamp_ns;
  }
  const std::int64_t step_ns = stamp_ns - source.newest_ns;
  // After a lost connection a step is no leap, because time has passed.
  const std::int64_t leap_ns = std::max(kLeapNs, 10 * options_.period_ns);
  if (step_ns > leap_ns && step_ns > 2 * since_ns) {
    Note(NoteKind::kClockLeaps, name, step_ns);
    BeginGap(named, source.newest_ns, stamp_ns);
  }
  if (step_ns >= -options_.lateness_ns) {
    source.behind = 0;
    source.behind_since_ns.reset();
  } else {
    ++source.behind;
    source.behind_since_ns = source.behind_since_ns.value_or(now.steady_ns);
    if (source.behind >= kBackReadings ||
        now.steady_ns - *source.behind_since_ns >= options_.lateness_ns) {
      Note(NoteKind::kClockBack, name, step_ns);
      RunBack(named, stamp_ns);
    }
  }
  if (step_ns > 0) {
    const double step = static_cast<double>(std::min(step_ns, kLeapNs));
    source.step_ns = source.step_ns == 0.0 ? step : source.step_ns;
    source.spread_ns +=
        kRhythmGain * (std::abs(step - source.step_ns) - source.spread_ns);
    source.step_ns += kRhythmGain * (step - source.step_ns);
  }
  source.ended = false;
  source.newest_ns = std::max(source.newest_ns, stamp_ns);
  source.heard_ns = now.steady_ns;
}

void Assembler::BeginGap(const NamedSource& source, std::int64_t from_ns,
                         std::int64_t to_ns) {
  for (Valve& valve : valves_) {
    if (std::ranges::any_of(valve.slots, [&](const Slot& slot) {
          return slot.source == &source;
        })) {
      valve.gap_from_ns = from_ns;
      valve.gap_to_ns = to_ns;
    }
  }
}

// The clock of the source was set back. Its earlier readings have stamps that
// are yet to come, so the valves start again with its present readings.
void Assembler::RunBack(NamedSource& named, std::int64_t stamp_ns) {
  Source& source = named.second;
  source.newest_ns = stamp_ns;
  source.settled_ns = stamp_ns;
  source.cut_ns = stamp_ns;
  source.behind = 0;
  source.behind_since_ns.reset();
  for (Valve& valve : valves_) {
    bool concerned = false;
    for (Slot& slot : valve.slots) {
      if (slot.source == &named) {
        concerned = true;
        std::erase_if(slot.pending, [&](const Held& held) {
          return held.stamp_ns > stamp_ns;
        });
        if (slot.held && slot.held->stamp_ns > stamp_ns) {
          // By exception the value still stands; its stamp does not.
          slot.held->stamp_ns = stamp_ns;
        }
      }
    }
    if (concerned && valve.begun) {
      valve.next_ns = InstantFrom(stamp_ns);
      valve.gap_to_ns = 0;
    }
  }
}

void Assembler::Advance(const ArrivalTime& now, const Sink& sink) {
  Settle(now);
  for (Valve& valve : valves_) {
    std::int64_t trail_ns = std::numeric_limits<std::int64_t>::max();
    std::int64_t clock_ns = std::numeric_limits<std::int64_t>::min();
    for (const Slot& slot : valve.slots) {
      if (slot.source != nullptr) {
        const Source& source = slot.source->second;
        if (!source.ended) {
          trail_ns = std::min(trail_ns, source.settled_ns);
        }
        clock_ns = std::max(clock_ns,
                            source.newest_ns + now.steady_ns - source.heard_ns);
      }
    }
    if (clock_ns == std::numeric_limits<std::int64_t>::min()) {
      continue;  // Nobody has spoken of it.
    }
    const std::int64_t known_ns =
        trail_ns == std::numeric_limits<std::int64_t>::max()
            ? std::numeric_limits<std::int64_t>::min()
            : trail_ns - 1;
    WriteUpTo(std::max(known_ns, clock_ns - options_.lateness_ns), valve, sink);
  }
  for (auto& [name, source] : sources_) {
    source.settled_ns = source.newest_ns;
  }
}

// A source that falls silent is said, and forgotten unless a tag waits for its
// next word: whoever makes up names must not fill the memory.
void Assembler::Settle(const ArrivalTime& now) {
  for (auto& [name, source] : sources_) {
    source.read = false;
  }
  for (const Valve& valve : valves_) {
    for (const Slot& slot : valve.slots) {
      if (slot.source != nullptr) {
        slot.source->second.read = true;
      }
    }
  }
  for (auto at = sources_.begin(); at != sources_.end();) {
    auto& [name, source] = *at;
    const std::int64_t since_ns = now.steady_ns - source.heard_ns;
    const bool silent = source.ended || since_ns > Silence(source);
    if (silent && source.read && !source.silent) {
      Note(NoteKind::kSourceSilent, name, since_ns);
    }
    source.silent = source.silent || silent;
    at = source.silent && !source.read ? sources_.erase(at) : std::next(at);
  }
}

void Assembler::Finish(const Sink& sink) {
  for (Valve& valve : valves_) {
    std::int64_t lead_ns = std::numeric_limits<std::int64_t>::min();
    for (const Slot& slot : valve.slots) {
      if (slot.source != nullptr) {
        lead_ns = std::max(lead_ns, slot.source->second.newest_ns);
      }
    }
    WriteUpTo(lead_ns, valve, sink);
  }
}

// A valve begins with its first command: without one no sample is judged.
void Assembler::Begin(Valve& valve) const {
  for (const Slot& slot : valve.slots) {
    if (slot.mapping && slot.mapping->signal == Signal::kCv &&
        !slot.pending.empty()) {
      valve.begun = true;
      valve.next_ns = InstantFrom(slot.pending.front().stamp_ns);
    }
  }
}

void Assembler::WriteUpTo(std::int64_t limit_ns, Valve& valve,
                          const Sink& sink) {
  if (!valve.begun) {
    Begin(valve);
  }
  while (valve.begun && valve.next_ns <= limit_ns) {
    if (valve.next_ns > valve.gap_from_ns && valve.next_ns < valve.gap_to_ns) {
      valve.next_ns = InstantFrom(valve.gap_to_ns);
      continue;
    }
    Sample sample = SampleAt(valve.next_ns, valve);
    valve.empty = sample.present == 0 ? valve.empty + 1 : 0;
    if (valve.empty <= kToldEmpty) {
      sample.seq = valve.seq++;
      sink(valve.valve, sample);
      valve.next_ns += options_.period_ns;
      continue;
    }
    // Nothing is written before the next reading.
    std::int64_t next_ns = limit_ns + 1;
    for (const Slot& slot : valve.slots) {
      if (!slot.pending.empty()) {
        next_ns = std::min(next_ns, slot.pending.front().stamp_ns);
      }
    }
    valve.next_ns =
        std::max(valve.next_ns + options_.period_ns, InstantFrom(next_ns));
  }
}

Sample Assembler::SampleAt(std::int64_t instant_ns, Valve& valve) {
  Sample sample;
  sample.stamp_ns = instant_ns;
  sample.flow_unit = valve.valve.map.flow_unit.value_or(FlowUnit::kM3PerHour);
  bool has_pv = false;
  for (Slot& slot : valve.slots) {
    const auto held = Current(instant_ns, valve, slot);
    if (!slot.mapping) {
      // Where the mode is not known, the last one stands.
      valve.mode = held ? static_cast<ValveMode>(held->value) : valve.mode;
      continue;
    }
    const Signal signal = slot.mapping->signal;
    has_pv = has_pv || signal == Signal::kPv;
    if (held) {
      sample.Set(signal, held->value);
      sample.quality[Index(signal)] = held->quality;
    } else if (slot.held) {
      sample.quality[Index(signal)] = SignalQuality::kBad;
    }
  }
  sample.mode = valve.mode;
  if (sample.present != 0) {
    const bool zeros = IsAllZero(sample, valve.valve.map.columns);
    const bool jumps = options_.period_ns <= kFewSeconds && valve.open;
    valve.zeros = zeros && (valve.zeros || jumps);
    valve.open = IsOpen(sample);
  }
  if (valve.zeros) {
    sample.present = 0;
    sample.values.fill(0.0);
    sample.quality.fill(SignalQuality::kBad);
  }
  DropLoneSetPoint(has_pv ? MaskOf(Signal::kPv) : SignalMask{0}, sample);
  return sample;
}

// The reading that stands for an instant; nothing if none does.
std::optional<Assembler::Held> Assembler::Current(std::int64_t instant_ns,
                                                  const Valve& valve,
                                                  Slot& slot) {
  while (!slot.pending.empty() && slot.pending.front().stamp_ns <= instant_ns) {
    slot.held = slot.pending.front();
    slot.pending.pop_front();
  }
  if (!slot.held || slot.held->quality == SignalQuality::kBad) {
    return std::nullopt;
  }
  Held held = *slot.held;
  const std::int64_t age_ns = instant_ns - held.stamp_ns;
  slot.counts->held += age_ns >= options_.period_ns ? 1U : 0U;
  if (valve.valve.report == Reporting::kPeriodic) {
    if (age_ns > valve.valve.max_age_ns) {
      if (!std::exchange(slot.counts->silent, true)) {
        Note(NoteKind::kTagSilent, slot.tag, age_ns);
      }
      return std::nullopt;
    }
    if (2 * age_ns > 3 * options_.period_ns) {
      held.quality = SignalQuality::kUncertain;
    }
    return held;
  }
  const Source& source = slot.source->second;
  const std::int64_t until_ns = held.connection == source.connection
                                    ? source.newest_ns + Silence(source)
                                    : source.cut_ns;
  slot.counts->silent = instant_ns > until_ns;
  return instant_ns <= until_ns ? std::optional(held) : std::nullopt;
}

std::map<std::string, TagCounts> Assembler::tags() const {
  std::map<std::string, TagCounts> tags;
  for (const auto& [name, tag] : tags_) {
    tags[name] = tag.counts;
  }
  return tags;
}

std::pair<std::size_t, std::size_t> Assembler::sources() const {
  const auto alive = std::ranges::count_if(
      sources_, [](const auto& source) { return !source.second.silent; });
  return {static_cast<std::size_t>(alive), sources_.size()};
}

std::int64_t Assembler::InstantFrom(std::int64_t stamp_ns) const {
  const std::int64_t rest = stamp_ns % options_.period_ns;
  return rest > 0 ? stamp_ns + options_.period_ns - rest : stamp_ns - rest;
}

// A source is taken to live for this long after its last word.
std::int64_t Assembler::Silence(const Source& source) const {
  const std::int64_t least =
      std::max(options_.lateness_ns, 2 * options_.period_ns);
  const auto own = std::llround(source.step_ns + kLate * source.spread_ns);
  return source.beats ? least
                      : std::max(least, std::min<std::int64_t>(own, kLeapNs));
}

void Assembler::Note(NoteKind kind, const std::string& name,
                     std::int64_t by_ns) const {
  if (notes_) {
    notes_({kind, name, by_ns});
  }
}

}  // namespace fdi::importer
