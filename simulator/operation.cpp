#include "simulator/operation.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "diagnosis/error.h"
#include "simulator/random.h"
#include "simulator/require_range.h"

namespace fdi::simulator {
namespace {

constexpr double kForever = 1e10;

// Value at `time_s`, which is within the points.
double Interpolate(const std::vector<double>& t_s,
                   const std::vector<double>& values, double time_s) {
  const auto right = std::upper_bound(t_s.begin(), t_s.end(), time_s);
  if (right == t_s.end()) {
    return values.back();
  }
  const auto i = static_cast<std::size_t>(right - t_s.begin());
  const double share = (time_s - t_s[i - 1]) / (t_s[i] - t_s[i - 1]);
  return std::lerp(values[i - 1], values[i], share);
}

class Profile {
 public:
  // Each profile has three streams of noise, beyond those of the excitations.
  Profile(InputProfile config, std::uint64_t seed, std::uint64_t index)
      : config_(std::move(config)),
        cv_(config_.cv_noise_pct, NormalSource(seed, 100 + 3 * index)),
        p1_(config_.p1_noise_kpa, NormalSource(seed, 101 + 3 * index)),
        p2_(config_.p2_noise_kpa, NormalSource(seed, 102 + 3 * index)) {}

  bool ActsAt(double time_s) const {
    return time_s >= config_.t_s.front() && time_s <= config_.t_s.back();
  }
  bool DrivesCommandAt(double time_s) const {
    return ActsAt(time_s) && !config_.cv_pct.empty();
  }

  void Apply(double time_s, ProcessInputs& inputs) {
    if (!ActsAt(time_s)) {
      return;
    }
    if (!config_.cv_pct.empty()) {
      const double cv = Interpolate(config_.t_s, config_.cv_pct, time_s);
      const double noise = cv_.Next();
      const bool at_end = cv <= 0.0 || cv >= 100.0;
      inputs.command =
          0.01 * (at_end ? cv : std::clamp(cv + noise, 0.0, 100.0));
    }
    if (!config_.p1_kpa.empty()) {
      inputs.inlet_pressure_pa =
          1e3 * (Interpolate(config_.t_s, config_.p1_kpa, time_s) + p1_.Next());
    }
    if (!config_.p2_kpa.empty()) {
      inputs.outlet_pressure_pa =
          1e3 * (Interpolate(config_.t_s, config_.p2_kpa, time_s) + p2_.Next());
    }
    if (!config_.t1_degc.empty()) {
      inputs.temperature_c = Interpolate(config_.t_s, config_.t1_degc, time_s);
    }
  }

 private:
  InputProfile config_;
  DisturbanceProcess cv_;
  DisturbanceProcess p1_;
  DisturbanceProcess p2_;
};

class Profiled final : public Excitation {
 public:
  Profiled(std::unique_ptr<Excitation> base, std::vector<Profile> profiles,
           double period_s)
      : base_(std::move(base)),
        profiles_(std::move(profiles)),
        period_s_(period_s) {}

  bool is_open_loop() const override { return base_->is_open_loop(); }
  double bypass_opening() const override { return base_->bypass_opening(); }

  // Without noise of its own: that belongs to the samples.
  ProcessInputs Rest() const override {
    ProcessInputs inputs = base_->Rest();
    std::vector<Profile> at_start = profiles_;
    for (Profile& profile : at_start) {
      profile.Apply(0.0, inputs);
    }
    return inputs;
  }

  ProcessInputs Next(const FlowOfPressures& flow) override {
    const double time_s = static_cast<double>(sample_++) * period_s_;
    base_->Hold(std::ranges::any_of(profiles_, [time_s](const Profile& p) {
      return p.DrivesCommandAt(time_s);
    }));
    ProcessInputs inputs = base_->Next(flow);
    for (Profile& profile : profiles_) {
      profile.Apply(time_s, inputs);
    }
    return inputs;
  }

 private:
  std::unique_ptr<Excitation> base_;
  std::vector<Profile> profiles_;
  double period_s_;
  std::uint64_t sample_{0};
};

void RequireValues(const std::string& name, const InputProfile& profile,
                   const std::vector<double>& values, double most) {
  if (!values.empty() && values.size() != profile.t_s.size()) {
    throw ConfigError("input: " + name + " has " +
                      std::to_string(values.size()) + " values, t_s has " +
                      std::to_string(profile.t_s.size()));
  }
  for (const double value : values) {
    RequireRange("input." + name, value, 0.0, most);
  }
}

}  // namespace

void Validate(const InputProfile& profile) {
  if (profile.t_s.size() < 2) {
    throw ConfigError("input: t_s has " + std::to_string(profile.t_s.size()) +
                      " values, expected at least 2");
  }
  RequireValues("t_s", profile, profile.t_s, kForever);
  if (!std::ranges::is_sorted(profile.t_s) ||
      profile.t_s.front() == profile.t_s.back()) {
    throw ConfigError("input: t_s does not ascend");
  }
  if (profile.cv_pct.empty() && profile.p1_kpa.empty() &&
      profile.p2_kpa.empty() && profile.t1_degc.empty()) {
    throw ConfigError(
        "input: there are no values, expected one of cv_pct, p1_kpa, p2_kpa, "
        "t1_degc");
  }
  RequireValues("cv_pct", profile, profile.cv_pct, 100.0);
  RequireValues("p1_kpa", profile, profile.p1_kpa, 2e4);
  RequireValues("p2_kpa", profile, profile.p2_kpa, 2e4);
  RequireValues("t1_degc", profile, profile.t1_degc, 300.0);
  RequireDisturbance("input.cv_noise_pct", profile.cv_noise_pct);
  RequireDisturbance("input.p1_noise_kpa", profile.p1_noise_kpa);
  RequireDisturbance("input.p2_noise_kpa", profile.p2_noise_kpa);
}

void Validate(const ModeStretch& stretch) {
  RequireRange("mode.from_s", stretch.from_s, 0.0, kForever);
  if (!(stretch.until_s > stretch.from_s)) {
    throw ConfigError("mode.until_s is not after mode.from_s");
  }
}

ValveMode ModeAt(const std::vector<ModeStretch>& stretches, double time_s,
                 ValveMode otherwise) {
  for (const ModeStretch& stretch : stretches) {
    if (time_s >= stretch.from_s && time_s < stretch.until_s) {
      return stretch.mode;
    }
  }
  return otherwise;
}

std::unique_ptr<Excitation> WithProfiles(
    std::unique_ptr<Excitation> base, const std::vector<InputProfile>& profiles,
    double period_s, std::uint64_t seed) {
  std::vector<Profile> laid;
  for (const InputProfile& profile : profiles) {
    Validate(profile);
    laid.emplace_back(profile, seed, laid.size());
  }
  return std::make_unique<Profiled>(std::move(base), std::move(laid), period_s);
}

}  // namespace fdi::simulator
