#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "diagnosis/model/quality_count.h"
#include "diagnosis/records/health_hour.h"
#include "diagnosis/records/service_records.h"

namespace fdi::monitor {

/// Merges `newer` into `older`: time and health add up, accumulators and
/// stretches that grew are replaced. Keeps at most 100 000 records of each
/// kind; more come while the disk is full.
Checkpoint Merged(Checkpoint older, Checkpoint newer);

/// The most days or hours that a valve accumulates between checkpoints.
inline constexpr std::size_t kMaxBookRows = 256;
/// A book with so many rows has to be emptied soon; the other half is for the
/// samples until then.
constexpr bool IsFilling(std::size_t rows) {
  return rows >= kMaxBookRows / 2;
}

/// The row of a book to which a sample is added: the one for which `is` holds,
/// else the last one if no row may be opened (`may_open` is false, or there are
/// too many).
/// @returns null if a new row is to be appended.
template <typename Row, typename Is>
Row* FindRow(std::vector<Row>& rows, Is is, bool may_open) {
  const auto own = std::find_if(rows.rbegin(), rows.rend(), is);
  if (own != rows.rend()) {
    return &*own;
  }
  const bool open = may_open && rows.size() < kMaxBookRows;
  return rows.empty() || open ? nullptr : &rows.back();
}

/// Time of one valve by quality and day, accumulated until the next checkpoint.
class CoverageBook {
 public:
  /// @param accepted if false, the sample's stamp does not open a new day.
  void Add(std::int64_t stamp_ns, Quality quality, std::uint64_t samples = 1,
           bool accepted = true);
  std::size_t rows() const { return days_.size(); }
  /// Appends all that was added since the last call.
  void DrainInto(const std::string& valve_id, double period_s,
                 std::vector<CoverageDay>& days);

 private:
  struct Day {
    std::int64_t day;
    QualityCount samples;
  };
  std::vector<Day> days_;  // Usually one.
};

}  // namespace fdi::monitor
