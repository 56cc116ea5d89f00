#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "diagnosis/health_hour.h"
#include "diagnosis/quality_count.h"
#include "diagnosis/records/service_records.h"

namespace fdi::monitor {

/// `newer` on top of `older`: time and health add up, accumulators and
/// stretches that grew are replaced. Of each at most 100 000 records.
Checkpoint Merged(Checkpoint older, Checkpoint newer);

/// `newer` behind `older`; of the same stretch the newer one stands. What is
/// beyond 100 000, as while the disk is full, is left out: these are notes, no
/// evidence.
std::vector<ShadowDifference> Merged(std::vector<ShadowDifference> older,
                                     std::vector<ShadowDifference> newer);

/// The most days or hours that a valve keeps until they are taken.
inline constexpr std::size_t kMostBookRows = 256;

/// The row of a book that a sample is added to: the one that `is` its own, else
/// the last one if it `may_open` none or there are too many.
/// @returns null if a row is to be begun.
template <typename Row, typename Is>
Row* FindRow(std::vector<Row>& rows, Is is, bool may_open) {
  const auto own = std::find_if(rows.rbegin(), rows.rend(), is);
  if (own != rows.rend()) {
    return &*own;
  }
  const bool open = may_open && rows.size() < kMostBookRows;
  return rows.empty() || open ? nullptr : &rows.back();
}

/// The time of one valve by quality and day, until it is taken.
class CoverageBook {
 public:
  /// @param accepted false: a sample whose stamp does not begin a day.
  void Add(std::int64_t stamp_ns, Quality quality, std::uint64_t samples = 1,
           bool accepted = true);
  std::size_t rows() const { return days_.size(); }
  /// Appends all that was added since the last call.
  void TakeInto(const std::string& valve_id, double period_s,
                std::vector<CoverageDay>& days);

 private:
  struct Day {
    std::int64_t day;
    QualityCount samples;
  };
  std::vector<Day> days_;  // Mostly one.
};

}  // namespace fdi::monitor
