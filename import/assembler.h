#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <unordered_map>
#include <utility>
#include <vector>

#include "diagnosis/model/sample.h"
#include "import/csv.h"

namespace fdi::importer {

/// When a source says a value.
enum class Reporting : std::uint8_t {
  kException,  ///< When it changes: held while its source is alive.
  kPeriodic,   ///< Each period: held for LiveValve::max_age_ns.
};

/// A valve whose samples are assembled, and the tags that it is made of.
struct LiveValve {
  std::string id;
  std::string group;
  /// columns (ColumnMapping::column is the tag), mode_column, mode_words and
  /// flow_unit are used; ValveColumns() makes them.
  ColumnMap map;
  Reporting report{Reporting::kException};
  std::int64_t max_age_ns{0};  ///< With kPeriodic.
};

/// A reading of a tag by a source; with quality BAD there is no value.
struct TagReading {
  std::string_view tag;
  /// Who says it: a connection or a device with one clock.
  std::string_view source;
  std::optional<std::int64_t> stamp_ns;  ///< UTC; nothing: that of arrival.
  std::optional<double> value;
  std::string_view word;  ///< If it is no number: that of a mode.
  SignalQuality quality{SignalQuality::kGood};
};

/// The time of a call, from the caller: the assembler has no clock.
struct ArrivalTime {
  std::int64_t utc_ns{0};
  std::int64_t steady_ns{0};  ///< On a clock that never leaps.
};

struct AssemblerOptions {
  std::int64_t period_ns{1'000'000'000};
  /// Time that an instant waits for sources that have not spoken of it.
  std::int64_t lateness_ns{2'000'000'000};
};

enum class Taken : std::uint8_t {
  kTaken,
  kUnknownTag,
  kBadStamp,  ///< Before 2000, or more than an hour after its arrival.
  kLate,      ///< Older than what the samples already have.
  kBadValue,  ///< No number in range and, for a mode, no known word.
};

/// An event of a source or tag that is no sample.
struct AssemblyNote {
  enum class Kind : std::uint8_t {
    kSourceSilent,  ///< Its last readings are no longer held.
    kSourceBack,
    kClockLeaps,  ///< Its stamps leap ahead: a gap.
    kClockBack,   ///< Its stamps run back: a gap.
    kTagSilent,   ///< A periodic tag is older than its valve accepts.
    kTagBack,
  };
  Kind kind{};
  std::string name;       ///< Name of the source or tag.
  std::int64_t by_ns{0};  ///< Length of its silence, or of the clock's leap.
};

/// Counts of a tag's readings since the start.
struct TagCounts {
  std::uint64_t readings{0};
  std::uint64_t bad{0};      ///< Those without a usable value or stamp.
  std::uint64_t late{0};     ///< Those that came after their instant.
  std::uint64_t held{0};     ///< Instants for which an older reading stood.
  std::int64_t stamp_ns{0};  ///< Stamp of the newest reading; 0: none.
  bool silent{false};        ///< Nothing of it is held at present.
};

/// Makes samples of fixed period from readings that come by exception.
///
/// An instant is a multiple of the period. Its sample has the newest reading of
/// each tag with a stamp up to the instant. It is written by the second
/// Advance() after each source of the valve has spoken of a later time (what is
/// said of one instant may come in two messages), or `lateness_ns` after the
/// clock of the source that leads, which goes on with the steady clock while
/// the source is silent.
///
/// A reading that nothing newer follows is
/// - by exception as good as it was while its source is alive, and missing from
///   two periods or `lateness_ns` after its last word on. A source that never
///   says that it lives, and speaks at odd times, is given its own rhythm
///   (Silence()), a minute at most;
/// - periodic: good for one and a half periods, then UNCERTAIN, as values that
///   fill a file, and missing beyond `max_age_ns`.
///
/// A valve without any signal is written three times, so that whoever judges it
/// learns of it, and then not at all. One thread.
class Assembler {
 public:
  using Sink = std::function<void(const LiveValve&, const Sample&)>;
  using Notes = std::function<void(const AssemblyNote&)>;

  Assembler(const AssemblerOptions& options, std::vector<LiveValve> valves,
            Notes notes = {});

  /// Takes another set of valves. One with the id of a former valve goes on
  /// with its readings and sequence.
  void Replace(std::vector<LiveValve> valves);

  Taken Take(const TagReading& reading, const ArrivalTime& now);
  /// The source lives: tags not mentioned by it are unchanged up to the stamp.
  void Alive(std::string_view source, std::optional<std::int64_t> stamp_ns,
             const ArrivalTime& now);
  /// The connection of the source is lost. Its readings are not held any more,
  /// and have to be sent again afterwards.
  void End(std::string_view source);

  /// Writes the instants that are due.
  void Advance(const ArrivalTime& now, const Sink& sink);
  /// Writes all instants that a source has reached: nothing will follow.
  void Finish(const Sink& sink);

  /// True if a valve has this tag.
  bool Knows(std::string_view tag) const { return tags_.contains(tag); }
  std::map<std::string, TagCounts> tags() const;
  /// Sources that are alive, and those with others that a tag waits for.
  std::pair<std::size_t, std::size_t> sources() const;
  std::size_t valves() const { return valves_.size(); }

 private:
  struct Source {
    std::int64_t newest_ns{0};   // Stamp of its last word.
    std::int64_t settled_ns{0};  // The same at the last Advance().
    std::int64_t heard_ns{0};    // Steady time of it.
    std::int64_t cut_ns{0};      // Newest stamp when it ended.
    std::uint32_t connection{0};
    bool ended{false};
    bool silent{false};
    bool read{false};       // It was the last to speak of some tag.
    bool beats{false};      // It says that it lives.
    double step_ns{0.0};    // Between its words, the mean,
    double spread_ns{0.0};  // and the mean deviation from that.
    std::optional<std::int64_t> behind_since_ns;  // Steady.
    int behind{0};                                // Readings in a row.
  };
  using NamedSource = std::pair<const std::string, Source>;
  struct Held {
    std::int64_t stamp_ns{0};
    double value{0.0};  // For a mode, its number.
    SignalQuality quality{SignalQuality::kGood};
    std::uint32_t connection{0};
  };
  struct Tag {
    TagCounts counts;
    std::vector<std::pair<std::size_t, std::size_t>> slots;  // Valve, slot.
  };
  struct Slot {
    std::optional<ColumnMapping> mapping;  // Nothing: the mode.
    std::string tag;
    TagCounts* counts{nullptr};
    NamedSource* source{nullptr};
    std::optional<Held> held;
    std::deque<Held> pending;  // One for each instant that is not written.
  };
  struct Progress {
    bool begun{false};
    std::int64_t next_ns{0};
    std::uint64_t seq{0};
    int empty{0};
    ValveMode mode{ValveMode::kAuto};
    // Nothing is known of the time between, exclusive.
    std::int64_t gap_from_ns{0};
    std::int64_t gap_to_ns{0};
    bool open{false};   // IsOpen() in the last instant that had readings.
    bool zeros{false};  // Since an open valve, all its signals are 0.
  };
  struct Valve : Progress {
    LiveValve valve;
    std::vector<Slot> slots;
  };
  struct TextHash {
    using is_transparent = void;
    std::size_t operator()(std::string_view text) const {
      return std::hash<std::string_view>()(text);
    }
  };

  NamedSource& SourceOf(std::string_view name);
  void Speak(NamedSource& source, std::int64_t stamp_ns,
             const ArrivalTime& now);
  void RunBack(NamedSource& source, std::int64_t stamp_ns);
  void BeginGap(const NamedSource& source, std::int64_t from_ns,
                std::int64_t to_ns);
  void Settle(const ArrivalTime& now);
  std::optional<Held> HeldOf(const Valve& valve, const Slot& slot,
                             const TagReading& reading) const;
  void Keep(Slot& slot, const Held& held) const;
  void WriteUpTo(std::int64_t limit_ns, Valve& valve, const Sink& sink);
  Sample SampleAt(std::int64_t instant_ns, Valve& valve);
  std::optional<Held> Current(std::int64_t instant_ns, const Valve& valve,
                              Slot& slot);
  void Begin(Valve& valve) const;
  std::int64_t InstantFrom(std::int64_t stamp_ns) const;
  std::int64_t Silence(const Source& source) const;
  void Note(AssemblyNote::Kind kind, const std::string& name,
            std::int64_t by_ns) const;

  AssemblerOptions options_;
  Notes notes_;
  std::vector<Valve> valves_;
  std::unordered_map<std::string, Source, TextHash, std::equal_to<>> sources_;
  std::unordered_map<std::string, Tag, TextHash, std::equal_to<>> tags_;
};

/// The reading in the unit of its signal, by the map; nothing if it is beyond
/// what the map accepts.
std::optional<double> Converted(const ColumnMapping& mapping, double reading);

}  // namespace fdi::importer
