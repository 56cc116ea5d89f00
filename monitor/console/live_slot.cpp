#include "monitor/console/live_slot.h"

#include <algorithm>
#include <numeric>

namespace fdi::console {
namespace {

constexpr std::size_t kEarlierSources = 3;
constexpr std::int64_t kDayNs = 86'400'000'000'000;
constexpr std::int64_t kSparkStepNs = 1'000'000'000;

std::size_t SizeOf(const std::deque<monitor::Trace>& pieces) {
  return std::accumulate(pieces.begin(), pieces.end(), std::size_t{0},
                         [](std::size_t sum, const monitor::Trace& piece) {
                           return sum + piece.size();
                         });
}

}  // namespace

void LiveSlot::Describe(const Verdict& verdict) {
  now.state = verdict.state;
  now.quality = verdict.quality;
  now.silence = monitor::Silence::kNone;
  now.reasons = verdict.uncovered;
  now.isolated = verdict.isolated;
  now.d0 = verdict.normal_factor;
  now.stamp_ns = verdict.stamp_ns;
  now.factor = 0.0;
  now.strength = 0.0;
  for (std::size_t f = 0; f < kMaxFaults; ++f) {
    if ((verdict.isolated >> f & 1U) != 0 &&
        verdict.fault_factors[f] >= now.factor) {
      now.factor = verdict.fault_factors[f];
      now.strength = verdict.strengths[f];
    }
  }
}

void LiveSlot::AddSpark(const Verdict& verdict) {
  // A clock that was set back begins a new line.
  if (verdict.stamp_ns < spark_stamp_ns_) {
    spark_count_ = 0;
  } else if (spark_count_ > 0 &&
             verdict.stamp_ns - spark_stamp_ns_ < kSparkStepNs) {
    return;
  }
  spark_stamp_ns_ = verdict.stamp_ns;
  spark_[spark_count_++ % kSparkPoints] =
      static_cast<float>(1.0 - verdict.normal_factor);
}

std::vector<double> LiveSlot::Spark(std::size_t count) const {
  const std::size_t there = std::min({count, spark_count_, kSparkPoints});
  std::vector<double> line;
  line.reserve(there);
  for (std::size_t i = spark_count_ - there; i < spark_count_; ++i) {
    line.push_back(static_cast<double>(spark_[i % kSparkPoints]));
  }
  return line;
}

ValveState LiveSlot::Now(std::size_t spark_points) const {
  ValveState state = now;
  state.spark = Spark(spark_points);
  return state;
}

void LiveSlot::Push(const Sample& sample, const Verdict& verdict, int channels,
                    int faults) {
  if (trace_.size() > 0 &&
      !trace_.Continues(sample, verdict, channels, faults)) {
    earlier_.push_back(trace_.Take());
    while (earlier_.size() > kEarlierSources ||
           SizeOf(earlier_) - earlier_.front().size() >= kTrendInstants) {
      earlier_.pop_front();
    }
  } else if (trace_.size() >= kTrendInstants) {
    earlier_.clear();
  }
  trace_.Push(sample, verdict, channels, faults);
  ++pushed;
}

monitor::Trace LiveSlot::EmptyTrace() {
  return {kTrendInstants, kDayNs, /*keeps_isolated=*/false};
}

void LiveSlot::ClearTrend() {
  trace_ = EmptyTrace();
  earlier_.clear();
}

std::vector<monitor::TracePoint> LiveSlot::Points(std::size_t count) const {
  std::vector<monitor::TracePoint> points;
  std::size_t behind = SizeOf(earlier_) + trace_.size();
  const auto add = [&](const monitor::Trace& piece) {
    behind -= piece.size();
    if (count > behind) {
      const auto some = piece.Unpack(count - behind);
      points.insert(points.end(), some.begin(), some.end());
    }
  };
  std::for_each(earlier_.begin(), earlier_.end(), add);
  add(trace_);
  return points;
}

std::size_t LiveSlot::trend_bytes() const {
  std::size_t bytes = trace_.bytes();
  for (const monitor::Trace& piece : earlier_) {
    bytes += piece.bytes();
  }
  return bytes;
}

}  // namespace fdi::console
