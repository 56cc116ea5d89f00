#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "diagnosis/followed_drift.h"
#include "diagnosis/observer_bank.h"
#include "diagnosis/residual_windows.h"

namespace fdi {

/// Detects a fault: equation (1) on the residuals of the normal observer, and
/// alike on their windows. Each test counts for itself, as its limits were
/// fitted: noise that passes one limit now and another one next is no
/// detection. What extrapolation put into a residual is taken away first.
///
/// A healthy valve drifts: with the season, its air supply, its wear. While
/// there is no alarm, AdaptLimits() moves the limits with the residual, slowly
/// and not far, see Drift. What is followed is taken from the residual before
/// it is compared: (r − mean)/scale, of the means of windows the mean alone.
class Detection {
 public:
  /// What a channel has drifted by since training, as far as it is followed:
  /// the mean of its longest window, and its deviation over the limit on it
  /// less the margin of 1.4 that training leaves. Each sample moves them by one
  /// step towards the window, so they go to its medians, the mean at most by
  /// its limit in 8 h, the deviation by a factor of 2; and both not beyond
  /// DriftLimits. In the first hour nothing moves: what is slow cannot be told
  /// from what is not.
  struct Drift {
    double mean{0.0};              ///< [unit]
    double log_scale{0.0};         ///< At least 0.
    std::int64_t mean_full_ns{0};  ///< As FollowedDrift has them.
    std::int64_t scale_full_ns{0};
  };

  /// `models` must outlive the detection.
  explicit Detection(const ModelSet& models);

  /// Runs and windows begin anew; the drift stays, it is the valve's.
  void Restart();

  /// Samples are missing: runs end, the windows stay.
  void Interrupt() { runs_.fill({}); }

  /// Takes one sample and its residuals. Returns whether a single residual is
  /// beyond its threshold.
  bool Push(const ObserverBank& bank, const Sample& sample);

  /// The last sample was that of a healthy valve: no episode is open.
  void AdaptLimits(std::int64_t stamp_ns);

  FollowedDrift followed_drift(std::size_t channel) const;

  void Save(SnapshotWriter& writer) const;
  /// @returns false, leaving it undefined, if there is nothing to be read.
  bool Restore(SnapshotReader& reader);

  /// True if some residual or window was beyond its limit, if only just.
  bool pending() const;

  /// First sample of the earliest run beyond a limit that is n_d long.
  std::optional<std::int64_t> stamp_ns() const;

 private:
  struct Run {  // samples beyond one limit, without a break
    int length{0};
    std::int64_t since_ns{0};
  };
  // Below and above of the residual; of each window below, above and energy.
  static constexpr std::size_t kTestsPerChannel = 2 + 3 * kMaxWindows;

  void Count(std::size_t test, bool beyond, std::int64_t stamp_ns);

  const ModelSet* models_;
  ResidualWindows windows_;
  std::array<Drift, kMaxChannels> drifts_{};
  double healthy_s_{0.0};  // that AdaptLimits() was called for
  std::array<Run, kTestsPerChannel * kMaxChannels> runs_{};
};

}  // namespace fdi
