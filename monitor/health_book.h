#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "diagnosis/loop/valve_counters.h"
#include "diagnosis/model/model_set.h"
#include "diagnosis/model/verdict.h"
#include "diagnosis/records/health_hour.h"
#include "monitor/sinks.h"

namespace fdi::monitor {

/// Travel of a stem and its changes of direction. A turn counts once it is as
/// long as the dead band, so that noise does not; what goes on in the same
/// direction counts as it comes.
class StrokeCount {
 public:
  static constexpr double kDeadBand = 1.0;  ///< [% of stroke]

  struct Step {
    double travel{0.0};  ///< [% of stroke]
    bool reversal{false};
  };

  /// @param position [%]
  Step Push(double position);
  /// The next position is not compared with those before.
  void Restart() { started_ = false; }

 private:
  bool started_{false};
  int direction_{0};  // 0: not yet known
  double extreme_{0.0};
};

/// Gathers the health of one valve by hours until it is taken.
///
/// One thread at a time.
class HealthBook {
 public:
  /// @param models null while the valve is UNASSIGNED.
  /// @param period_s the time that the sample stands for.
  void Add(const Sample& sample, const Verdict& verdict, const ModelSet* models,
           double period_s);

  /// Appends what was added since the last call.
  void DrainInto(const std::string& valve_id, std::vector<HealthHour>& hours);
  std::size_t rows() const { return hours_.size(); }

 private:
  HealthHour& At(const HealthHour& key, const Sample& sample,
                 const ModelSet* models, bool may_open);
  void AddStroke(const Sample& sample, std::int64_t period_ms,
                 HealthHour& hour);

  void AddCounts(const Sample& sample, double period_s, HealthHour& hour);

  std::vector<HealthHour> hours_;
  StrokeCount stroke_;
  loop::ValveCounters counters_;
  std::int64_t stamp_ns_{0};
  std::uint64_t source_id_{0};
  bool by_command_{false};  // The position is CV for want of X.
};

/// Gathers the health of all valves.
class HealthBooks : public ValveListener {
 public:
  /// @param counters take the totals of all valves; outlives this.
  explicit HealthBooks(Counters& counters) : counters_(counters) {}

  std::string_view name() const override { return "health"; }
  void OnVerdict(const std::string& valve_id, const Sample& sample,
                 const ValveOutcome& outcome) override;
  void OnRemoved(const std::string& valve_id, Checkpoint& last) override;
  void TakeCheckpoint(Checkpoint& checkpoint, bool urgent) override;

 private:
  void Drain(const std::string& valve_id, HealthBook& book,
             std::vector<HealthHour>& hours);

  Counters& counters_;
  std::int64_t travel_{0};  // Not yet a whole stroke [HealthHour::kTravel].
  std::unordered_map<std::string, HealthBook> books_;
};

}  // namespace fdi::monitor
