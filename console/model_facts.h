#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "base/mutex.h"
#include "diagnosis/model/model_set.h"
#include "diagnosis/records/trace_point.h"
#include "storage/history/episode.h"

namespace fdi::console {

/// Facts that a reader needs on a model set to interpret its results.
struct ModelFacts {
  struct Channel {
    std::string name;  ///< "X", "F", ...
    Signal output{Signal::kX};
    std::string unit;
    double low{0.0};   ///< Normal residuals r = y − ŷ below this
    double high{0.0};  ///< or above this are abnormal [unit].
    std::vector<WindowLimits> windows{};
  };
  std::string model_set;  ///< NAME@VERSION
  std::uint64_t hash{0};
  std::vector<Channel> channels;
  std::vector<std::string> faults;  ///< "f19", ... by bit of a FaultSet.
  std::vector<std::string> undetectable{};  ///< Faults that look normal.
  double isolation_threshold{0.7};          ///< T
  int isolation_samples{20};                ///< t_k
  int detection_samples{2};                 ///< n_d
  double period_s{1.0};
  FlowUnit flow_unit{FlowUnit::kM3PerHour};
  SignalMask required{0};       ///< Signals that the set needs.
  Signal command{Signal::kCv};  ///< Signal read as the command.
};

std::shared_ptr<const ModelFacts> FactsOf(const ModelSet& models);

/// The facts of the model sets behind the episodes in the history, from
/// models.db or from the bus. Thread safe; caches 32 sets.
class StoredModels {
 public:
  /// @param models empty: there is no models.db.
  explicit StoredModels(std::filesystem::path models)
      : path_(std::move(models)) {}

  /// Facts of the set that produced the episode. If that set no longer exists,
  /// the names recorded in the episode, without thresholds (NaN).
  std::shared_ptr<const ModelFacts> For(const storage::Episode& episode);
  /// Adds a set that then need not be loaded from models.db.
  void Add(std::shared_ptr<const ModelFacts> facts);

 private:
  void Cache(std::shared_ptr<const ModelFacts> facts) REQUIRES(mutex_);

  std::filesystem::path path_;
  Mutex mutex_;
  std::map<std::string, std::shared_ptr<const ModelFacts>> known_
      GUARDED_BY(mutex_);
};

/// A window of a normal residual that is beyond its limits (WindowLimits).
struct WindowBeyond {
  std::size_t channel{0};
  int length{0};          ///< [samples]
  bool deviation{false};  ///< Deviation of the residual; else its mean.
  double value{0.0};      ///< [unit]
  double low{0.0};        ///< [unit]; 0 for a deviation.
  double high{0.0};       ///< [unit]
};

/// The windows at the last of `points`, which reach back as far as known. They
/// raise alarms of slow and small faults, while each single residual is within
/// its thresholds. None where the limits of the set are not known.
std::vector<WindowBeyond> WindowsBeyond(const ModelFacts& models,
                                        const std::vector<TracePoint>& points);

/// Returns the plain name of a fault such as "f19".
using FaultNamer = std::function<std::string(std::string_view)>;

/// Explains in words what the observers say about an instant:
///
///     "flow 12 m3/h above what the normal model expects; fits: flow
///      transmitter wrong, plug eroded"
///
/// The channel shown has the normal residual farthest beyond its threshold,
/// relative to it; the faults listed have a factor of at least T/2, best first.
/// If no channel is beyond its threshold, the text says so. While the valve is
/// normal no fault is listed: observers of faults that change nothing then
/// explain normal data, too.
std::string Explain(const ModelFacts& models, const TracePoint& point,
                    const FaultNamer& name);

/// 12.34 as "12", 0.01234 as "0.012": two significant digits.
std::string TwoDigits(double value);

}  // namespace fdi::console
