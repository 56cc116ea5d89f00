#include "simulator/valve_simulation.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

#include "base/error.h"
#include "diagnosis/model/fault_catalogue.h"
#include "simulator/control_valve.h"
#include "simulator/random.h"
#include "simulator/require_range.h"

namespace fdi::simulator {
namespace {

constexpr double kForever = 1e10;

// Value at `time_s`, which must lie within the points. With upper_bound(), the
// last of equal times is the left neighbour: a step takes its later value, and
// the difference of times below is never 0.
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
  // Each profile has three noise streams, numbered above those of the
  // excitations.
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
      // Drawn even where it is not used, so that the noise of later samples
      // does not depend on whether the command is at an end.
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

  // Uses copies of the profiles, because their noise streams belong to the
  // samples.
  ProcessInputs InitialInputs() const override {
    ProcessInputs inputs = base_->InitialInputs();
    std::vector<Profile> at_start = profiles_;
    for (Profile& profile : at_start) {
      profile.Apply(0.0, inputs);
    }
    return inputs;
  }

  ProcessInputs Next(const FlowOfPressures& flow) override {
    const double time_s = static_cast<double>(sample_++) * period_s_;
    // Hold() comes first, because a closed loop controls and advances within
    // Next(). Next() is called even where profiles replace every input: the
    // noise of the base goes on as it does without them.
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
                   const std::vector<double>& values, double least,
                   double most) {
  if (!values.empty() && values.size() != profile.t_s.size()) {
    throw ConfigError("input: " + name + " has " +
                      std::to_string(values.size()) + " values, t_s has " +
                      std::to_string(profile.t_s.size()));
  }
  for (const double value : values) {
    RequireRange("input." + name, value, least, most);
  }
}

}  // namespace

void Validate(const InputProfile& profile) {
  if (profile.t_s.size() < 2) {
    throw ConfigError("input: t_s has " + std::to_string(profile.t_s.size()) +
                      " values, expected at least 2");
  }
  RequireValues("t_s", profile, profile.t_s, 0.0, kForever);
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
  RequireValues("cv_pct", profile, profile.cv_pct, 0.0, 100.0);
  RequireValues("p1_kpa", profile, profile.p1_kpa, 0.0, 2e4);
  RequireValues("p2_kpa", profile, profile.p2_kpa, 0.0, 2e4);
  RequireValues("t1_degc", profile, profile.t1_degc, kColdestMediumC,
                kHottestMediumC);
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

namespace {

constexpr double kNsPerS = 1e9;
// Fault onsets this close to a sample are moved to it [s].
constexpr double kMinSegmentS = 1e-6;

std::uint64_t SampleCount(const ValveSimulationConfig& config) {
  // 1e-9 samples: a quotient rounded up must not add a sample.
  const double samples = std::ceil(config.duration_s / config.period_s - 1e-9);
  const auto count = static_cast<std::uint64_t>(samples);
  if (const auto* recorded =
          std::get_if<RecordedExcitation>(&config.excitation)) {
    return std::min<std::uint64_t>(count, recorded->rows.size());
  }
  return count;
}

std::unique_ptr<Excitation> ExcitationOf(const ValveSimulationConfig& config) {
  auto base = MakeExcitation(config.excitation, config.period_s, config.seed);
  return config.inputs.empty() ? std::move(base)
                               : WithProfiles(std::move(base), config.inputs,
                                              config.period_s, config.seed);
}

ValveMode RecordedMode(const ValveSimulationConfig& config, std::uint64_t k) {
  const auto* recorded = std::get_if<RecordedExcitation>(&config.excitation);
  return recorded == nullptr ? ValveMode::kAuto : recorded->rows[k].mode;
}

}  // namespace

void Validate(const ValveSimulationConfig& config) {
  Validate(config.parameters);
  Validate(config.excitation);
  for (const FaultSchedule& fault : config.faults) {
    Validate(fault);
  }
  for (const InputProfile& profile : config.inputs) {
    Validate(profile);
  }
  for (const ModeStretch& stretch : config.modes) {
    Validate(stretch);
  }
  // The solver evaluates continuous inputs at any time. Profiles and the other
  // excitations draw noise sample by sample and have no value in between.
  if (config.continuous_inputs && !config.inputs.empty()) {
    throw ConfigError("continuous_inputs is set: expected no [[input]]");
  }
  if (config.continuous_inputs &&
      !std::holds_alternative<SineExcitation>(config.excitation) &&
      !std::holds_alternative<RecordedExcitation>(config.excitation)) {
    throw ConfigError("continuous_inputs is set for the excitation '" +
                      std::string(ExcitationName(config.excitation)) +
                      "': expected sine or csv, the others are sampled");
  }
  RequireRange("duration_s", config.duration_s, 1e-3, 1e10);
  RequireRange("period_s", config.period_s, 1e-3, 3600.0);
  RequireRange("tolerance_scale", config.tolerance_scale, 1e-6, 100.0);
}

class ValveSimulation::Impl {
 public:
  explicit Impl(const ValveSimulationConfig& config)
      : config_(config),
        period_ns_(std::llround(config.period_s * kNsPerS)),
        count_(SampleCount(config)),
        excitation_(ExcitationOf(config)),
        input_function_(excitation_->AsFunction()),
        // Streams of the seed: 1 and 2 here, 11 to 23 in the excitations, from
        // 100 on in the profiles.
        noise_(config.seed, 1),
        positioner_noise_(config.seed, 2),
        valve_(config.parameters, config.tolerance_scale),
        held_(config.faults.size()) {}

  LabelledSample Step();

  ValveSimulationConfig config_;
  std::int64_t period_ns_;
  std::uint64_t count_;
  std::uint64_t next_{0};
  std::unique_ptr<Excitation> excitation_;
  InputFunction input_function_;
  NormalSource noise_;
  NormalSource positioner_noise_;
  ControlValve valve_;
  ProcessInputs inputs_;   // Command, and the pressures to be reached next.
  ProcessInputs reached_;  // Pressures up to which the valve is integrated.
  std::vector<std::optional<double>> held_;  // Per schedule: its flatline.

 private:
  // By way of whole nanoseconds: faults begin and end by the same time that the
  // stamp states, however many samples there are.
  double TimeOf(std::uint64_t k) const {
    return static_cast<double>(static_cast<std::int64_t>(k) * period_ns_) /
           kNsPerS;
  }
  ProcessInputs NextInputs();
  void Start();
  void AdvanceTo(std::uint64_t k);
  void AdvanceAcrossFaults(double from_s, double to_s,
                           const ProcessInputs& target);
  double Read(const Transmitter& transmitter, double value, double step = 0.0);
  void HoldFlatlines(double time_s, Sample& sample);
  Sample ReadAll(std::uint64_t k);
};

ProcessInputs ValveSimulation::Impl::NextInputs() {
  return excitation_->Next([this](double p1_pa, double p2_pa) {
    ProcessInputs inputs = inputs_;
    inputs.inlet_pressure_pa = p1_pa;
    inputs.outlet_pressure_pa = p2_pa;
    return valve_.FlowM3PerHour(inputs, excitation_->bypass_opening());
  });
}

// The valve settles before the faults act: a fault from 0 s on meets a healthy
// valve in equilibrium, as it does at any later time. A closed loop settles at
// its initial inputs, because Next() asks for the flow at a position.
void ValveSimulation::Impl::Start() {
  const bool open_loop = excitation_->is_open_loop();
  inputs_ = open_loop ? NextInputs() : excitation_->InitialInputs();
  if (config_.cold_start) {
    valve_.ColdStart();
  } else {
    valve_.Settle(inputs_);
  }
  valve_.SetEffects(EffectsAt(config_.faults, 0.0));
  reached_ = inputs_;
  if (!open_loop) {
    inputs_ = NextInputs();
  }
}

// One Advance() per interval of constant faults, with the last command and
// pressures on the line from the reached ones to those of `target`. A
// developing fault is constant within an interval: it grows sample by sample.
void ValveSimulation::Impl::AdvanceAcrossFaults(double from_s, double to_s,
                                                const ProcessInputs& target) {
  ProcessInputs here = inputs_;
  here.inlet_pressure_pa = reached_.inlet_pressure_pa;
  here.outlet_pressure_pa = reached_.outlet_pressure_pa;
  double at_s = from_s;
  while (at_s < to_s) {
    double until_s = to_s;
    for (const FaultSchedule& fault : config_.faults) {
      for (const double edge : {fault.start_s, fault.end_s}) {
        if (edge > at_s + kMinSegmentS && edge < to_s - kMinSegmentS) {
          until_s = std::min(until_s, edge);
        }
      }
    }
    const double share = (until_s - at_s) / (to_s - at_s);
    ProcessInputs there = here;
    there.inlet_pressure_pa =
        std::lerp(here.inlet_pressure_pa, target.inlet_pressure_pa, share);
    there.outlet_pressure_pa =
        std::lerp(here.outlet_pressure_pa, target.outlet_pressure_pa, share);
    if (config_.continuous_inputs) {
      valve_.AdvanceSmoothly(at_s, until_s, input_function_);
    } else {
      valve_.Advance(until_s - at_s, here, there);
    }
    valve_.SetEffects(EffectsAt(config_.faults, until_s));
    here = there;
    at_s = until_s;
  }
  reached_ = target;
}

// In open loop the inputs of sample k are known beforehand, and the pressures
// run towards them. In a closed loop, they run towards those computed at sample
// k - 1; the next ones follow from the flow at the position reached, so that
// NextInputs() has to come after the integration.
void ValveSimulation::Impl::AdvanceTo(std::uint64_t k) {
  if (config_.noise) {
    valve_.SetCommandNoise(
        0.01 * config_.parameters.instruments.positioner_noise_sd_pct *
        positioner_noise_());
  }
  const bool open_loop = excitation_->is_open_loop();
  const ProcessInputs target = open_loop ? NextInputs() : inputs_;
  AdvanceAcrossFaults(TimeOf(k - 1), TimeOf(k), target);
  inputs_ = open_loop ? target : NextInputs();
}

// `step` is a transmitter fault, as a share of its span.
//
// The range is applied before the noise, so that a saturated transmitter stays
// noisy, and the step comes after the noise, so that |step| = 1 reads the
// limit whatever the value (docs/model.md). Rounding is last: every reading
// lies on the converter's grid.
double ValveSimulation::Impl::Read(const Transmitter& transmitter, double value,
                                   double step) {
  value = std::clamp(value, transmitter.low, transmitter.high);
  if (config_.noise) {
    value = std::clamp(value + transmitter.noise_sd * noise_(), transmitter.low,
                       transmitter.high);
  }
  value = std::clamp(value + step * (transmitter.high - transmitter.low),
                     transmitter.low, transmitter.high);
  if (config_.resolution) {
    const double digit =
        (transmitter.high - transmitter.low) /
        (std::ldexp(1.0, config_.parameters.instruments.resolution_bits) - 1.0);
    value =
        transmitter.low + digit * std::round((value - transmitter.low) / digit);
  }
  return value;
}

// A flatline holds the first reading after its start.
void ValveSimulation::Impl::HoldFlatlines(double time_s, Sample& sample) {
  for (std::size_t i = 0; i < config_.faults.size(); ++i) {
    const FaultSchedule& fault = config_.faults[i];
    if (fault.flatline && StrengthAt(fault, time_s) != 0.0) {
      double& reading = sample.values[fdi::Index(*TransmitterOf(fault.fault))];
      held_[i] = held_[i].value_or(reading);
      reading = *held_[i];
    }
  }
}

// P1 and P2 are those that act on the plug at the stamp; CV is the command that
// acts from the stamp on. Every Read() draws from the same stream of noise, so
// their order is part of what a seed reproduces.
Sample ValveSimulation::Impl::ReadAll(std::uint64_t k) {
  const Instrumentation& i = config_.parameters.instruments;
  const FaultEffects effects = EffectsAt(config_.faults, TimeOf(k));
  ProcessInputs present = inputs_;
  present.inlet_pressure_pa = reached_.inlet_pressure_pa;
  present.outlet_pressure_pa = reached_.outlet_pressure_pa;
  const ProcessInputs seen = valve_.Effective(present);
  const double flow = valve_.Flow(present, excitation_->bypass_opening());
  Sample sample;
  sample.stamp_ns =
      config_.start_ns + static_cast<std::int64_t>(k) * period_ns_;
  sample.source_id = config_.source_id;
  sample.seq = k;
  sample.flow_unit = i.flow_unit;
  sample.mode = ModeAt(config_.modes, TimeOf(k), RecordedMode(config_, k));
  sample.Set(Signal::kCv, Read(i.command, 100.0 * inputs_.command));
  sample.Set(Signal::kP1, Read(i.pressure, 1e-3 * seen.inlet_pressure_pa,
                               effects.inlet_reading_step));
  sample.Set(Signal::kP2, Read(i.pressure, 1e-3 * seen.outlet_pressure_pa,
                               effects.outlet_reading_step));
  sample.Set(Signal::kT1, Read(i.temperature, seen.temperature_c,
                               effects.temperature_reading_step));
  sample.Set(Signal::kX,
             Read(i.position,
                  100.0 * valve_.state().rod * effects.position_reading_factor,
                  effects.position_reading_step));
  sample.Set(Signal::kF, Read(i.flow, FlowReadingWith(effects, flow)));
  HoldFlatlines(TimeOf(k), sample);
  return sample;
}

LabelledSample ValveSimulation::Impl::Step() {
  if (next_ >= count_) {
    throw std::logic_error("ValveSimulation::Step() after the last sample");
  }
  const std::uint64_t k = next_++;
  if (k == 0) {
    Start();
  } else {
    AdvanceTo(k);
  }
  return {ReadAll(k), TruthAt(config_.faults, TimeOf(k))};
}

ValveSimulation::ValveSimulation(const ValveSimulationConfig& config) {
  Validate(config);
  impl_ = std::make_unique<Impl>(config);
}
ValveSimulation::~ValveSimulation() = default;
ValveSimulation::ValveSimulation(ValveSimulation&&) noexcept = default;
ValveSimulation& ValveSimulation::operator=(ValveSimulation&&) noexcept =
    default;

std::uint64_t ValveSimulation::sample_count() const {
  return impl_->count_;
}

bool ValveSimulation::finished() const {
  return impl_->next_ >= impl_->count_;
}

LabelledSample ValveSimulation::Step() {
  return impl_->Step();
}

SimulationStatistics ValveSimulation::statistics() const {
  const CvodeIntegrator& integrator = impl_->valve_.integrator();
  return {integrator.step_count(), integrator.restart_count()};
}

}  // namespace fdi::simulator
