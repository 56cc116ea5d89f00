#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <mutex>
#include <vector>

#include "monitor/console/live_board.h"

namespace fdi::console {

/// What LiveBoard keeps of one valve. All but `models` under `mutex`.
struct LiveSlot {
  const ModelSet* models{nullptr};  ///< Of the diagnosis thread alone.

  mutable std::mutex mutex;
  ValveState now;
  std::uint64_t pushed{0};  ///< Instants so far.
  std::deque<Mark> marks;
  std::deque<monitor::DataGap> gaps;

  void Describe(const Verdict& verdict);
  void AddSpark(const Verdict& verdict);
  void Push(const Sample& sample, const Verdict& verdict, int channels,
            int faults);
  void ClearTrend();

  /// With the newest points of the sparkline.
  ValveState Now(std::size_t spark_points) const;
  /// The newest `count` instants, oldest first.
  std::vector<monitor::TracePoint> Points(std::size_t count) const;
  std::size_t trend_bytes() const;

 private:
  static monitor::Trace EmptyTrace();
  std::vector<double> Spark(std::size_t count) const;

  std::array<float, kSparkPoints> spark_{};
  std::size_t spark_count_{0};
  std::int64_t spark_stamp_ns_{0};
  monitor::Trace trace_{EmptyTrace()};
  std::deque<monitor::Trace> earlier_;  // Of sources before, oldest first.
};

}  // namespace fdi::console
