#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "diagnosis/model/quality_count.h"
#include "diagnosis/model/verdict.h"

namespace fdi::monitor {

/// Counters of a monitor since its start. The table in counters.cpp describes
/// each of them.
enum class Counter : std::uint8_t {
  kReceived,
  kDiagnosed,
  kUnassigned,
  kRefusedSamples,
  kFilteredSamples,
  kBadIds,
  kOverShare,
  kDecisions,
  kDecisionsUnsent,
  kEvents,
  kEventsUnpersisted,
  kEventsUnsent,
  kEventsResent,
  kEventsLost,
  kPersistFailures,
  kTraceDropped,
  kRecorded,
  kRecordDropped,
  kRecordFailures,
  kGaps,
  kInitialisations,
  kStaleEvents,
  kEpisodes,
  kModelSwaps,
  kModelFailures,
  kLooks,
  kLooksDropped,
  kLooksFailed,
  kPartFailures,
  kEventsRefused,
  kRecordsSetAside,
  kStrokes,
  kReversals,
  kSlipJumps,
  kCount_
};
inline constexpr std::size_t kCounterCount =
    static_cast<std::size_t>(Counter::kCount_);

/// A reported number: on the bus by its name, on the metrics page as a value of
/// a family. Values of one family are adjacent and differ in a label.
struct Measure {
  enum class Type : std::uint8_t { kCounter, kGauge };
  std::string name;         ///< "received"; empty: not published on the bus.
  std::string_view family;  ///< "fdi_waiting"; empty: not on the page.
  Type type{Type::kCounter};
  std::string_view help;
  std::string_view label;  ///< Empty: the family has one value.
  std::string label_value;
  std::uint64_t value{0};
};

/// Totals: by Counter; samples by Intake; samples, or sample periods without
/// one (STALE), by Quality. Thread safe.
class Counters {
 public:
  template <typename What>
  void Add(What what, std::uint64_t n = 1) {
    totals_[Place(what)].fetch_add(n, std::memory_order_relaxed);
  }
  template <typename What>
  std::uint64_t operator[](What what) const {
    return totals_[Place(what)].load(std::memory_order_relaxed);
  }

  /// All current totals: counters, samples by verdict of the intake
  /// ("accepted", "range", ...), sample periods by quality ("samples_live",
  /// ...).
  std::vector<Measure> Measures() const;

 private:
  static std::size_t Place(Counter counter) {
    return static_cast<std::size_t>(counter);
  }
  static std::size_t Place(Intake intake) {
    return kCounterCount + static_cast<std::size_t>(intake);
  }
  static std::size_t Place(Quality quality) {
    return kCounterCount + kIntakeCount + static_cast<std::size_t>(quality);
  }

  std::array<std::atomic<std::uint64_t>,
             kCounterCount + kIntakeCount + kQualityCount>
      totals_{};
};

/// A metrics page in the Prometheus text format, version 0.0.4: for each family
/// `# HELP`, `# TYPE`, then its values. Names of counters end in _total and
/// carry the unit, e.g. fdi_database_wal_bytes.
class Exposition {
 public:
  using Type = Measure::Type;

  struct Label {
    std::string_view name;
    std::string_view value;
  };

  /// Begins a family. Call once per name.
  void Family(std::string_view name, Type type, std::string_view help);

  /// A value of the current family, with at most one label.
  void Value(double value, Label label = {});
  void Value(std::uint64_t value, Label label = {});

  /// Adds measures that have a family; those of one family must be adjacent.
  void Add(const std::vector<Measure>& measures);

  const std::string& text() const { return text_; }

 private:
  void Line(std::string_view value, Label label);

  std::string name_;
  std::string text_;
};

}  // namespace fdi::monitor
