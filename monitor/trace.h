#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "diagnosis/model/model_set.h"
#include "diagnosis/model/sample.h"
#include "diagnosis/model/verdict.h"
#include "diagnosis/records/trace_point.h"

namespace fdi::monitor {

/// Past instants of one valve, packed: 100 bytes each for six signals, two
/// channels and five faults, so 180 kB for half an hour at 1 Hz. Holds at most
/// `capacity` instants, none older than `span_ns` before the newest; memory
/// grows with the content.
class Trace {
 public:
  /// @param keeps_isolated restart at a change of the isolated set; otherwise
  ///   points do not contain the set.
  Trace(std::size_t capacity, std::int64_t span_ns, bool keeps_isolated = true)
      : capacity_(capacity),
        span_ns_(span_ns),
        keeps_isolated_(keeps_isolated) {}

  /// Appends an instant. The trace restarts where Continues() is false.
  void Push(const Sample& sample, const Verdict& verdict, int channels,
            int faults);

  /// True if source, signals, model sizes and isolated set are unchanged.
  bool Continues(const Sample& sample, const Verdict& verdict, int channels,
                 int faults) const;

  /// The newest `count` instants, oldest first.
  std::vector<TracePoint> Unpack(std::size_t count = SIZE_MAX) const;

  /// Moves the content out and leaves the trace empty.
  Trace Take();

  void set_span_ns(std::int64_t span_ns) { span_ns_ = span_ns; }
  std::size_t size() const { return size_; }
  std::size_t bytes() const;

 private:
  struct Head {
    std::int64_t stamp_ns;
    std::uint64_t seq;
    std::uint32_t signal_quality;  // two bits each
    SignalMask present;
    Intake intake;
    Quality quality;
    State state;
    ValveMode mode;
    bool initialised;
  };
  // Properties shared by all instants of a trace.
  struct Layout {
    std::uint64_t source_id{0};
    std::uint32_t epoch{0};
    FlowUnit flow_unit{FlowUnit::kM3PerHour};
    SignalMask signals{0};
    FaultSet isolated{0};
    std::size_t signal_count{0};
    std::size_t channels{0};
    std::size_t faults{0};
  };

  void Begin(const Sample& sample, const Verdict& verdict, int channels,
             int faults);
  void MakeRoom(std::int64_t stamp_ns);
  void Grow();
  TracePoint PointAt(std::size_t row) const;
  std::size_t Row(std::size_t i) const { return (first_ + i) % heads_.size(); }

  std::size_t capacity_;
  std::int64_t span_ns_;
  bool keeps_isolated_;
  Layout layout_;
  std::size_t first_{0};
  std::size_t size_{0};
  std::vector<Head> heads_;
  std::vector<double> values_;
  std::vector<float> residuals_;
  std::vector<std::uint16_t> factors_;  // d_0, then faults
};

/// Evidence of an episode, in the order in which it was gathered.
struct EpisodeTrace {
  std::uint64_t episode_id{0};
  Trace trace;
  bool complete{false};  ///< No more will follow.
};

}  // namespace fdi::monitor
