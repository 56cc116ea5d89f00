#include "simulator/record_segments.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <future>

namespace fdi::simulator {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

double CommandTravel(const RecordSegment& segment) {
  double travel = 0.0;
  for (std::size_t k = segment.first + 1; k < segment.last; ++k) {
    travel += std::abs((*segment.rows)[k].input.cv_pct -
                       (*segment.rows)[k - 1].input.cv_pct);
  }
  return travel;
}

MatrixXd Residuals(const ValveCandidate& candidate,
                   const RecordSegment& segment, std::size_t settle_rows,
                   bool has_flow) {
  const auto answers =
      SimulateRecord(candidate.parameters, *segment.rows, segment.first,
                     segment.last, candidate.drive);
  MatrixXd result(static_cast<Index>(segment.size() - settle_rows),
                  has_flow ? 2 : 1);
  for (std::size_t k = settle_rows; k < segment.size(); ++k) {
    const RecordRow& row = (*segment.rows)[segment.first + k];
    const auto at = static_cast<Index>(k - settle_rows);
    result(at, 0) = answers[k].x_pct - row.x_pct;
    if (has_flow) {
      result(at, 1) = answers[k].flow - row.flow;
    }
  }
  return result;
}

}  // namespace

std::vector<RecordSegment> LiveliestSegments(
    const std::vector<HealthyRecord>& records, std::size_t max_rows) {
  constexpr std::size_t kLongest = 600;
  constexpr std::size_t kShortest = 180;
  std::vector<RecordSegment> segments;
  for (const HealthyRecord& record : records) {
    const std::size_t count = record.rows.size();
    const std::size_t pieces = (count + kLongest - 1) / kLongest;
    for (std::size_t i = 0; i < pieces; ++i) {
      const RecordSegment piece{&record.rows, i * count / pieces,
                                (i + 1) * count / pieces};
      if (piece.size() >= kShortest) {
        segments.push_back(piece);
      }
    }
  }
  std::stable_sort(segments.begin(), segments.end(),
                   [](const RecordSegment& a, const RecordSegment& b) {
                     return CommandTravel(a) > CommandTravel(b);
                   });
  std::size_t rows = 0;
  std::size_t taken = 0;
  while (taken < segments.size() &&
         (taken == 0 || rows + segments[taken].size() <= max_rows)) {
    rows += segments[taken++].size();
  }
  segments.resize(taken);
  return segments;
}

std::vector<MatrixXd> SegmentResiduals(
    const std::vector<ValveCandidate>& candidates,
    const std::vector<RecordSegment>& segments, std::size_t settle_rows,
    bool has_flow, int threads) {
  std::vector<MatrixXd> parts(candidates.size() * segments.size());
  std::atomic<std::size_t> next{0};
  const auto work = [&] {
    for (std::size_t i = next++; i < parts.size(); i = next++) {
      parts[i] =
          Residuals(candidates[i / segments.size()],
                    segments[i % segments.size()], settle_rows, has_flow);
    }
  };
  std::vector<std::future<void>> helpers;
  for (int t = 1; t < threads; ++t) {
    helpers.push_back(std::async(std::launch::async, work));
  }
  work();
  for (std::future<void>& helper : helpers) {
    helper.get();
  }
  std::vector<MatrixXd> result;
  for (std::size_t c = 0; c < candidates.size(); ++c) {
    const auto* part = &parts[c * segments.size()];
    Index rows = 0;
    for (std::size_t s = 0; s < segments.size(); ++s) {
      rows += part[s].rows();
    }
    MatrixXd whole(rows, has_flow ? 2 : 1);
    Index at = 0;
    for (std::size_t s = 0; s < segments.size(); ++s) {
      whole.middleRows(at, part[s].rows()) = part[s];
      at += part[s].rows();
    }
    result.push_back(std::move(whole));
  }
  return result;
}

}  // namespace fdi::simulator
