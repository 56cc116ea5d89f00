#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "diagnosis/model/sustained.h"
#include "diagnosis/observers/observer_bank.h"
#include "diagnosis/observers/residual_windows.h"

namespace fdi {

/// The residual of normal operation that remains after its extrapolation and
/// `margin` are subtracted.
double CertainResidual(const ObserverBank& bank, int channel,
                       double margin = 0.0);

/// Detects a fault: equation (1) on the residuals of the normal observer, and
/// alike on their windows. Each test counts for itself, as its limits were
/// fitted: noise that passes one limit now and another one next is no
/// detection. The share due to extrapolation is subtracted first.
///
/// Limits stay where training put them: a change over days is the growth of a
/// fault, or that of a transmitter, and counts like any other.
class Detection {
 public:
  /// `models` must outlive the detection.
  explicit Detection(const ModelSet& models);

  /// Runs and windows begin anew.
  void Restart();

  /// Samples are missing: runs end, the windows stay.
  void Interrupt();

  /// Takes one sample and its residuals. Returns whether a single residual is
  /// beyond its threshold.
  /// @param margins that residuals of each channel may have anyway; empty: 0.
  /// @param held residuals of readings that are held out (LoneReadings), by
  ///   channel, else NaN: they count against thresholds and enter no window.
  bool Push(const ObserverBank& bank, const Sample& sample,
            std::span<const double> margins = {},
            std::span<const double> held = {});

  void Save(SnapshotWriter& writer) const;
  /// @returns false, leaving it undefined, if there is nothing to be read.
  bool Restore(SnapshotReader& reader);

  /// True if some residual or window was beyond its limit, if only just.
  bool pending() const { return pending_ > 0; }

  /// The channels, by bit, with a run beyond a limit that is n_d long.
  std::uint32_t beyond() const;

  /// The largest share of its limit that a test of the last sample has held for
  /// n_d samples; above 1: detected.
  double share() const { return share_; }

  /// First sample of the earliest run beyond a limit that is n_d long.
  std::optional<std::int64_t> stamp_ns() const;

 private:
  struct Run {  // samples beyond one limit, without a break
    int length{0};
    std::int64_t since_ns{0};
  };
  // Below and above of the residual; of each window below, above and energy.
  static constexpr std::size_t kTestsPerChannel = 2 + 3 * kMaxWindows;

  struct Usual {  // of a window, while CV is as active as in training
    double per_variance{0.0};  // 1 / the one at the limit on its energy
    double activity{0.0};      // variance of CV, up to which this holds
  };

  // The variance of a window as a share of the one at its limit.
  double Energy(const WindowLimits& limits, const ResidualWindow& window,
                const ResidualWindow& command, std::size_t series) const;
  void PushValue(double value, double lower, double upper, std::size_t series);
  void Count(std::size_t test, bool beyond, std::int64_t stamp_ns);

  const ModelSet* models_;
  ResidualWindows windows_;
  std::array<Run, kTestsPerChannel * kMaxChannels> runs_{};
  int pending_{0};      // runs that are not empty
  Sustained values_;    // residuals by channel, then means by window
  Sustained energies_;  // by window
  std::vector<Usual> usual_;
  double share_{0.0};
};

}  // namespace fdi
