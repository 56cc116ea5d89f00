#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "diagnosis/model/model_set.h"
#include "diagnosis/model/verdict.h"
#include "diagnosis/records/strength_point.h"

namespace fdi {

/// Says whether the strengths of an open episode are due.
enum class StrengthDue : std::uint8_t {
  kNothing,
  kMinute,  ///< Another minute of readings is complete.
  kPoint,   ///< It is time to note how strong its faults are.
};

/// Says when it is time to note how strong the faults of an open episode are:
/// 450 s after its detection, then at 1.5 times the age each, but an hour later
/// at most. Gives the estimates of the observers.
class EpisodeStrengths {
 public:
  /// The next verdict of the engine, and the faults that the episode is named
  /// after. @param observed the observers tell how strong they are.
  StrengthDue Step(const Verdict& engine, FaultSet named, bool observed);

  /// For the faults that the observers have isolated for three minutes or more,
  /// the mean of their estimates in the last seven. Estimates of neighbouring
  /// samples hang together: the interval is that of the means of minutes, of
  /// which the one that has just begun is none.
  /// @param models that the verdicts are of.
  std::vector<StrengthPoint> Observed(const ModelSet& models) const;

 private:
  struct Minute {
    std::int64_t first_ns;
    double sum{0.0};
    int samples{0};
  };
  // One isolated fault, by index.
  struct Track {
    std::size_t bit;
    std::vector<Minute> minutes{};  // Seven at most.
  };

  bool UpdateTracks(const Verdict& engine, FaultSet named);

  std::optional<std::int64_t> detection_ns_{};  // When an episode is open.
  std::int64_t next_age_ns_{0};
  std::int64_t stamp_ns_{0};
  std::vector<Track> tracks_{};
};

}  // namespace fdi
