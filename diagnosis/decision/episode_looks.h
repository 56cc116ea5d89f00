#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

#include "diagnosis/decision/look.h"
#include "diagnosis/model/sample.h"
#include "diagnosis/model/verdict.h"

namespace fdi {

/// Period of the samples of a valve [ns].
std::int64_t LookPeriodNs(const LookSimulation& simulation);

/// Follows the samples and verdicts of one valve and says when the physics
/// should look at an episode that is open: 20 (early), 40, 150 and 300 s after
/// its detection, then at twice the age each time. While there is none, or
/// one that a routine look opened, a routine look is due every 300 s, at the
/// same stamps whenever a program was started; it skips samples outside the
/// commands and pressures that the set was taught. A second fault, on top of
/// that of the episode, is looked at 40, 150 and 300 s after it was detected,
/// with the first fault as it stood before. SlownessOf() the period lengthens
/// all of these times. Keeps the last 420 samples.
class EpisodeLooks {
 public:
  /// `simulation` must outlive it.
  /// @param at_position see LookWindow.
  explicit EpisodeLooks(const LookSimulation& simulation,
                        bool at_position = false);

  /// The next sample and what the engine said about it.
  /// @param suspected a routine look found the valve abnormal.
  std::optional<LookTask> Step(const Sample& sample, const Verdict& verdict,
                               bool suspected = false);

  /// A look at how strong the faults of the open episode are after the last
  /// sample. Nothing if there is no episode, or too little was measured.
  std::optional<LookTask> GrowthTask(std::vector<Explanation> known) const;

 private:
  struct Row {
    std::int64_t stamp_ns;
    RecordRow row;
    bool covered{false};  // Where the model set was taught.
  };

  void AddRow(const Sample& sample);
  void BeginRows(std::int64_t stamp_ns);
  double FlowShare(bool last) const;
  std::optional<LookTask> Task(std::int64_t detection_ns) const;
  std::optional<LookTask> SecondTask(const Verdict& verdict);
  std::optional<LookTask> RoutineTask(bool suspected) const;

  const LookSimulation& simulation_;
  std::int64_t period_ns_;
  std::int64_t slowness_;
  bool at_position_;
  SignalMask signals_{0};
  std::deque<Row> rows_{};
  // The last time that the rows started over: when, if nothing was read for
  // five minutes or more before; and the last stamp and FlowShare() before it.
  std::int64_t outage_end_ns_{0};
  std::int64_t before_ns_{0};
  std::optional<double> share_before_{};
  std::optional<std::int64_t> detection_ns_{};
  std::int64_t next_age_ns_{0};
  std::int64_t set_back_ns_{0};    // See LookTask.
  bool by_routine_{false};         // The open episode.
  std::int64_t second_ns_{0};      // Detection of the second fault.
  std::int64_t second_age_ns_{0};  // At which the next look at it is due.
  std::size_t judged_{0};  // Rows in a row that a routine look may hold.
  std::int64_t slot_{0};   // Five minutes that the last sample was in.
};

}  // namespace fdi
