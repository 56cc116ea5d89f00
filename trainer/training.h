#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "base/mutex.h"
#include "diagnosis/model/model_set.h"
#include "trainer/channel_training.h"
#include "trainer/dataset.h"

namespace fdi::trainer {

/// Told how far the training is: share in [0, 1] and what is being done. Called
/// from one thread at a time.
using Progress = std::function<void(double share, std::string_view stage)>;

/// Everything that decides what comes out of a training.
struct TrainingOptions {
  std::string name;    ///< Name of the model set.
  std::string preset;  ///< Name of the preset they came from.
  std::vector<ChannelPlan> channels;
  DecisionParameters decision;
  DatasetOptions dataset;
  FitOptions fit;
  double false_alarms_per_hour{kFalseAlarmsPerHour};
  int threads{0};              ///< 0: all of the machine.
  std::string software;        ///< Stored with the set.
  std::int64_t created_ns{0};  ///< Stored with the set.
  /// FloorLimits::flow_shape of a valve whose trim is known.
  std::vector<double> flow_shape{};
};

/// The options of a named preset. `paper`: two channels, X and F, each from the
/// inputs and its own past.
/// @throws ConfigError naming the presets if there is none of that name.
TrainingOptions PresetOptions(std::string_view preset);

/// Builds a model set: regressors per channel on normal operation, then one
/// observer per condition, memberships, thresholds, interpolation errors and
/// groups. The same runs and options give the same set, whatever the threads.
///
/// @throws DataError naming run, condition or channel if the runs do not
///   suffice (see BuildConditions, FitChannel).
ModelSet TrainModelSet(const std::vector<TrainingRun>& runs,
                       const TrainingOptions& options,
                       const Progress& progress = {});

/// Hands progress to its receiver one call at a time. Thread safe.
class Reporter {
 public:
  /// `progress` must outlive the reporter; it may be empty.
  explicit Reporter(const Progress& progress) : progress_(progress) {}

  void Report(double share, std::string_view stage) {
    const MutexLock lock(mutex_);
    if (progress_) {
      progress_(share, stage);
    }
  }

 private:
  const Progress& progress_;
  Mutex mutex_;
};

}  // namespace fdi::trainer
