#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "diagnosis/sample.h"
#include "simulator/excitation.h"

/// What an operator does to a valve: start it up, shut it down, stroke it, take
/// it out of AUTO. Laid over any excitation.
namespace fdi::simulator {

/// Process inputs that follow straight lines through points in time, beginning
/// with t_s.front() and ending with t_s.back(); equal times make a step. Before
/// and behind, and for inputs without points, the excitation goes on.
///
/// While CV is profiled, a closed loop is held: it neither controls nor
/// advances, and goes on from where it stood; its pressures follow the flow.
struct InputProfile {
  std::vector<double> t_s{};     ///< Since the first sample, >= 0, ascending.
  std::vector<double> cv_pct{};  ///< Each as long as t_s, or empty.
  std::vector<double> p1_kpa{};
  std::vector<double> p2_kpa{};
  std::vector<double> t1_degc{};
  /// On profiled inputs. Where CV is profiled at 0 or 100 it is exactly that.
  Disturbance cv_noise_pct{};
  Disturbance p1_noise_kpa{};
  Disturbance p2_noise_kpa{};

  friend bool operator==(const InputProfile&, const InputProfile&) = default;
};

/// The samples from from_s (included) to until_s carry `mode`.
struct ModeStretch {
  double from_s{0.0};   ///< Since the first sample, >= 0.
  double until_s{0.0};  ///< > from_s.
  ValveMode mode{ValveMode::kAuto};

  friend bool operator==(const ModeStretch&, const ModeStretch&) = default;
};

/// @throws ConfigError naming field, value and range.
void Validate(const InputProfile& profile);
void Validate(const ModeStretch& stretch);

/// The first stretch that has `time_s`, else `otherwise`.
ValveMode ModeAt(const std::vector<ModeStretch>& stretches, double time_s,
                 ValveMode otherwise);

/// `base` with `profiles` laid over it; where they overlap, the later one wins.
/// @throws ConfigError if a profile is not valid.
std::unique_ptr<Excitation> WithProfiles(
    std::unique_ptr<Excitation> base, const std::vector<InputProfile>& profiles,
    double period_s, std::uint64_t seed);

}  // namespace fdi::simulator
