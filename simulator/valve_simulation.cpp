#include "simulator/valve_simulation.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <utility>

#include "diagnosis/error.h"
#include "diagnosis/fault_catalogue.h"
#include "simulator/control_valve.h"
#include "simulator/random.h"
#include "simulator/require_range.h"
#include "simulator/water.h"

namespace fdi::simulator {
namespace {

constexpr double kNsPerS = 1e9;
// Fault onsets closer than this to a sample belong to it [s].
constexpr double kLeastSegmentS = 1e-6;

std::uint64_t SampleCount(const ValveSimulationConfig& config) {
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
  ProcessInputs inputs_;   // Of the last sample.
  ProcessInputs reached_;  // Pressures up to which the valve is integrated.
  std::vector<std::optional<double>> held_;  // Per schedule: its flatline.

 private:
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

void ValveSimulation::Impl::Start() {
  const bool open_loop = excitation_->is_open_loop();
  inputs_ = open_loop ? NextInputs() : excitation_->Rest();
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

// One Advance() per stretch of constant faults, with the command of the last
// sample and pressures on the line from those reached to those of `target`.
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
        if (edge > at_s + kLeastSegmentS && edge < to_s - kLeastSegmentS) {
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

// `step` is a fault of the transmitter, as a fraction of its span.
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

// A flatline starts with the first reading from its start on.
void ValveSimulation::Impl::HoldFlatlines(double time_s, Sample& sample) {
  for (std::size_t i = 0; i < config_.faults.size(); ++i) {
    const FaultSchedule& fault = config_.faults[i];
    if (fault.flatline && StrengthAt(fault, time_s) != 0.0) {
      double& reading = sample.values[Index(*TransmitterOf(fault.fault))];
      held_[i] = held_[i].value_or(reading);
      reading = *held_[i];
    }
  }
}

Sample ValveSimulation::Impl::ReadAll(std::uint64_t k) {
  const InstrumentParameters& i = config_.parameters.instruments;
  const FaultEffects effects = EffectsAt(config_.faults, TimeOf(k));
  const ProcessInputs seen = valve_.Effective(inputs_);
  double flow = valve_.FlowM3PerHour(inputs_, excitation_->bypass_opening());
  if (i.flow_unit == FlowUnit::kTPerHour) {
    flow *= LiquidDensity(seen.temperature_c) / 1000.0;
  }
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
  sample.Set(Signal::kX, Read(i.position, 100.0 * valve_.state().rod *
                                              effects.position_reading_factor));
  sample.Set(Signal::kF, Read(i.flow, flow * effects.flow_reading_factor));
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
  return {integrator.step_count(), integrator.derivative_count(),
          integrator.restart_count()};
}

}  // namespace fdi::simulator
