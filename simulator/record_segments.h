#pragma once

#include <vector>

#include <Eigen/Core>

#include "simulator/record_fit.h"

namespace fdi::simulator {

/// Rows of a healthy valve without a gap.
struct HealthyRecord {
  std::vector<RecordRow> rows;
};

/// Rows [first, last) of a record that outlives it.
struct RecordSegment {
  const std::vector<RecordRow>* rows;
  std::size_t first;
  std::size_t last;

  std::size_t size() const { return last - first; }
};

/// Cuts the records into equal pieces of at most 600 rows and takes those on
/// which the command travels most, at most `max_rows` in total but at least
/// one, the liveliest first. Pieces below 180 rows are not used.
std::vector<RecordSegment> LiveliestSegments(
    const std::vector<HealthyRecord>& records, std::size_t max_rows);

/// A candidate for the valve.
struct ValveCandidate {
  ValveParameters parameters;
  RecordDrive drive;
};

/// Differences simulation - record of each candidate: one row per instant,
/// columns X [%] and, if `has_flow`, F; the first `settle_rows` of every
/// segment are left out. Simulates on `threads` threads.
/// @throws as SimulateRecord().
std::vector<Eigen::MatrixXd> SegmentResiduals(
    const std::vector<ValveCandidate>& candidates,
    const std::vector<RecordSegment>& segments, std::size_t settle_rows,
    bool has_flow, int threads);

}  // namespace fdi::simulator
