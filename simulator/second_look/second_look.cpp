#include "simulator/second_look/second_look.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include "base/error.h"
#include "diagnosis/model/fault_catalogue.h"
#include "simulator/control_valve.h"
#include "simulator/fault_effects.h"
#include "simulator/valve_equations.h"
#include "simulator/valve_simulation.h"

namespace fdi::simulator {
namespace {

using Trajectory = std::vector<RecordAnswer>;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
// An error e pulls a fit by e / (1 + e^2 / nu), which falls beyond sqrt(nu).
constexpr double kFreedom = 6.0;       // nu
constexpr double kEffectError = 0.05;  // kappa
// 2 log-likelihood that a fault has to gain over none, for its free strength
// and start; a constant shift alike.
constexpr double kFaultPenalty = 6.0;

// When a fault acts: from `start` on (from before the window if it is 0 and the
// fault is constant), or growing from there to the end of the window.
struct Course {
  int start;
  bool growing;

  friend bool operator==(const Course&, const Course&) = default;
};

// A healthy record hardly tells the supply pressure, of which a positioner in
// control takes what it needs; a torn diaphragm shows it. Deviation of its
// logarithm.
constexpr double kSupplyDeviation = 0.15;
constexpr std::array kSupplies{0.7, 0.8, 0.9, 1.12, 1.25};

// A fault in one direction with what is known about its strength so far.
struct Hypothesis {
  int fault;
  double sign;
  Course course;
  double supply{1.0};  // Factor on the supply pressure of onboarding.
  std::map<double, Trajectory> simulated{};  // By |strength|.
  double cost{kInfinity};                    // The least that was simulated,
  double strength{0.0};                      // and its |strength|.
};

constexpr double kNoHypothesis = 1e6;  // of cost
// Cost of a line that loses its flow, as long as the loop has not answered.
constexpr double kUnanswered = 30.0;

// X is that of the healthy valve, and so is what drives the flow.
bool ActsOnFlowAlone(int fault) {
  return fault != 0 && (FaultFactsOf(fault).acts_on == ActsOn::kFlow ||
                        FaultFactsOf(fault).acts_on == ActsOn::kFlowReading);
}

bool ActsOnInputs(int fault) {
  return fault != 0 && FaultFactsOf(fault).acts_on == ActsOn::kInputs;
}

// The recorded inputs already have what a fault does to them, unless it hides
// one; a transmitter fault does not reach the valve, which InputAt() has given
// the usual value.
bool ReachesValve(int fault) {
  return fault != 0 && !TransmitterOf(fault) &&
         (!ActsOnInputs(fault) || FaultFactsOf(fault).hides.has_value());
}

// A channel's share of Q, and how much of it is due to the errors.
struct ChannelFit {
  double cost{0.0};
  double errors{0.0};
};

class Looker {
 public:
  Looker(const ValvePhysics& physics, const LookWindow& window)
      : physics_(physics),
        window_(window),
        valve_(physics.parameters),
        rows_(static_cast<int>(window.rows.size())),
        detection_(static_cast<int>(window.detection)) {
    valve_.instruments.flow.high = MeterEnd();
    if (window_.standing != 0) {
      ApplyFault(window_.standing, window_.standing_strength, standing_);
      bare_ = Simulate(0, 0.0, {0, false});
      stands_ = true;
    }
    // Before any fault: those that only act on the flow are built on it, and
    // the effect of every fault is the difference from it.
    healthy_ = Simulate(0, 0.0, {0, false});
    FindUsualInputs();
    command_away_ = CommandAway();
  }

  SecondLook Run(const std::stop_token& stop);
  StrengthLook EstimateStrengths(const std::vector<Explanation>& known,
                                 const std::stop_token& stop);
  double MisfitOfHealthy() const { return ErrorsOf(healthy_) / Readings(); }

 private:
  bool Measures(Signal signal) const {
    return (window_.signals & MaskOf(signal)) != 0;
  }
  // Rows that do not count, because the simulation starts at rest.
  int Settling() const { return std::min(10, detection_ / 2); }
  double StrengthAt(int row, double strength, Course course) const;
  double MeterEnd() const;
  void FindUsualInputs();
  InputRow InputAt(int row, int fault, double strength) const;
  void Hide(int fault, const InputRow& instead, InputRow& input) const;
  FaultEffects EffectsOf(bool stands, int fault, double strength) const;
  bool IsSeenInInputs(const Hypothesis& h) const;
  Trajectory Simulate(int fault, double strength, Course course,
                      double supply = 1.0);
  Trajectory FlowOnly(int fault, double strength, Course course) const;
  Trajectory Seized(Course course) const;
  ChannelFit FitChannel(const Trajectory& answers, bool flow,
                        double slow_sd) const;
  double ErrorsOf(const Trajectory& answers) const;
  double Readings() const;
  double InputCost(int fault, double strength, Course course,
                   const Trajectory& answers) const;
  std::optional<double> CommandAway() const;
  double Cost(int fault, double strength, Course course,
              const Trajectory& answers) const;
  double CostOf(const Hypothesis& hypothesis, double strength,
                const Trajectory& answers) const;
  ChannelFit FitWithoutFault() const;
  std::vector<Hypothesis> Hypotheses() const;
  std::vector<Hypothesis> FitHypotheses(const std::stop_token& stop);
  std::optional<double> ObservedStop() const;
  void Try(Hypothesis& hypothesis, double strength);
  void TryCourse(Hypothesis& hypothesis, Course course);
  Hypothesis PerforationLike(const Hypothesis& supply_drop, Course course);
  void Refine(Hypothesis& hypothesis);
  template <typename Use>
  void Between(const Hypothesis& hypothesis, Use&& use) const;
  Explanation Explain(const Hypothesis& hypothesis, double scale) const;

  const ValvePhysics& physics_;
  const LookWindow& window_;
  ValveParameters valve_;  // With the flow transmitter as the window shows it.
  int rows_;
  int detection_;
  InputRow usual_{};  // Mean inputs before the detection, or in onboarding.
  std::optional<double> command_away_{};
  FaultEffects standing_{};  // Effects of the standing fault,
  bool stands_{false};       // and whether it acts by now.
  Trajectory bare_;          // Without it; empty if there is none.
  Trajectory healthy_;       // With it: what is expected.
};

// The range of the flow transmitter is a guess if the valve is not as large as
// its type. It ends where readings repeat that were not reached before the
// fault: whatever the noise, a flow beyond the limit reads the limit.
double Looker::MeterEnd() const {
  constexpr double kLeastUse = 0.75;  // Share of the guess; below, it is stuck.
  constexpr int kMinReadings = 10;
  const double end = valve_.instruments.flow.high;
  double most = kLeastUse * end;
  std::ptrdiff_t equal = 0;
  for (const RecordRow& row : window_.rows) {
    if (row.flow_measured && row.flow >= most) {
      equal = row.flow > most ? 1 : equal + 1;
      most = row.flow;
    }
  }
  const auto is_near = [&](const RecordRow& row) {
    return row.flow_measured && row.flow > most - 3.0 * physics_.flow.sd;
  };
  const auto detected = window_.rows.begin() + detection_;
  const bool ends =
      equal >= kMinReadings &&
      std::none_of(window_.rows.begin(), detected, is_near) &&
      3 * equal >= std::count_if(detected, window_.rows.end(), is_near);
  return ends ? most : std::max(end, most);
}

double Looker::StrengthAt(int row, double strength, Course course) const {
  if (row < course.start) {
    return 0.0;
  }
  return course.growing ? strength * (row - course.start) /
                              std::max(1, rows_ - 1 - course.start)
                        : strength;
}

void Looker::FindUsualInputs() {
  constexpr int kMinRows = 30;
  constexpr int kGuard = 5;  // Rows before a late detection.
  usual_ = {0.0, physics_.p1.mean, physics_.p2.mean, physics_.t1.mean};
  if (detection_ < kMinRows + kGuard) {
    return;
  }
  usual_ = {};
  const double share = 1.0 / (detection_ - kGuard);
  for (int k = 0; k < detection_ - kGuard; ++k) {
    const InputRow& in = window_.rows[static_cast<std::size_t>(k)].input;
    usual_.p1_kpa += share * in.p1_kpa;
    usual_.p2_kpa += share * in.p2_kpa;
    usual_.t1_degc += share * in.t1_degc;
  }
}

// The inputs of the valve if the fault is there: a faulty transmitter does not
// show them, and the hot water of f7 is read as the end of the range.
InputRow Looker::InputAt(int row, int fault, double strength) const {
  InputRow input = window_.rows[static_cast<std::size_t>(row)].input;
  input.cv_pct = DelayedCommand(window_.rows, static_cast<std::size_t>(row),
                                physics_.drive.command_delay);
  if (stands_) {
    // Before this window it was there already, so what is usual in it does not
    // tell either.
    Hide(window_.standing,
         {0.0, physics_.p1.mean, physics_.p2.mean, physics_.t1.mean}, input);
  }
  if (strength != 0.0 && fault != 0) {
    Hide(fault, usual_, input);
  }
  // A measured input has moved already; any other still has its usual value.
  const FaultEffects effects =
      EffectsOf(stands_ && ActsOnInputs(window_.standing),
                ActsOnInputs(fault) ? fault : 0, strength);
  input.p1_kpa *= Measures(Signal::kP1) ? 1.0 : effects.inlet_factor;
  input.p2_kpa *= Measures(Signal::kP2) ? 1.0 : effects.outlet_factor;
  return input;
}

void Looker::Hide(int fault, const InputRow& instead, InputRow& input) const {
  const auto hidden = FaultFactsOf(fault).hides;
  if (hidden == Signal::kT1) {
    input.t1_degc = instead.t1_degc;
  } else if (hidden == Signal::kP1) {
    input.p1_kpa = instead.p1_kpa;
  } else if (hidden == Signal::kP2) {
    input.p2_kpa = instead.p2_kpa;
  }
}

// The effects of a fault, together with the standing one if that `stands`.
FaultEffects Looker::EffectsOf(bool stands, int fault, double strength) const {
  FaultEffects effects = stands ? standing_ : FaultEffects{};
  if (fault == kLowFlow) {
    effects.flow_reading_factor *= 1.0 - strength;
  } else if (fault != 0 && strength != 0.0) {
    ApplyFault(fault, strength, effects);
  }
  return effects;
}

// The fault acts on an input that is measured, where it would be seen. Without
// that transmitter nothing but the flow tells.
bool Looker::IsSeenInInputs(const Hypothesis& h) const {
  FaultEffects effects;
  ApplyFault(h.fault, h.sign, effects);
  const FaultEffects none;
  return (effects.temperature_rise_c > 0.0 && Measures(Signal::kT1)) ||
         (effects.inlet_factor != none.inlet_factor && Measures(Signal::kP1)) ||
         (effects.outlet_factor != none.outlet_factor &&
          Measures(Signal::kP2)) ||
         TransmitterOf(h.fault).has_value();
}

Trajectory Looker::Simulate(int fault, double strength, Course course,
                            double supply) {
  const bool reads_rod = !stands_ || RodAt(standing_, 0.5) == 0.5;
  if ((ActsOnFlowAlone(fault) && (reads_rod || fault == kLowFlow)) ||
      (window_.at_position && fault != 0)) {
    return FlowOnly(fault, strength, course);
  }
  if (fault == kStemFriction && strength >= 1.0 && !course.growing) {
    return Seized(course);
  }
  ValveSimulationConfig config;
  RecordedExcitation excitation;
  for (int k = 0; k < rows_; ++k) {
    excitation.rows.push_back(
        InputAt(k, fault, StrengthAt(k, strength, course)));
  }
  config.parameters = valve_;
  config.parameters.actuator.supply_pressure_gauge_pa *= supply;
  config.excitation = std::move(excitation);
  config.period_s = SimulatedPeriod(physics_.drive.period_s, valve_);
  config.duration_s = rows_ * config.period_s;
  config.continuous_inputs = physics_.drive.interpolated_command;
  config.noise = false;
  config.resolution = false;
  // Half the time of 1, for an error of 0.02 % of X (record_fit.h).
  config.tolerance_scale = 10.0;
  FaultSchedule schedule;
  if (stands_ && ReachesValve(window_.standing)) {
    schedule.fault = window_.standing;
    schedule.final_strength = window_.standing_strength;
    config.faults.push_back(schedule);
  }
  if (ReachesValve(fault)) {
    schedule.fault = fault;
    schedule.start_s = course.start * config.period_s;
    schedule.final_strength = strength;
    schedule.development_s =
        course.growing ? (rows_ - 1 - course.start) * config.period_s : 0.0;
    config.faults.push_back(schedule);
  }
  ValveSimulation simulation(config);
  Trajectory answers;
  while (!simulation.finished()) {
    const Sample sample = simulation.Step().sample;
    answers.push_back({sample[Signal::kX], sample[Signal::kF]});
  }
  return answers;
}

// X as in the healthy valve, the flow by (12), without a simulation. At the
// position that is read, the rod is there whatever the fault does to it. The
// command needs no delay here: FlowReading() does not use it.
Trajectory Looker::FlowOnly(int fault, double strength, Course course) const {
  Trajectory answers = healthy_;
  for (int k = course.start; k < rows_; ++k) {
    const double now = StrengthAt(k, strength, course);
    const FaultEffects effects =
        EffectsOf(stands_ && ReachesValve(window_.standing),
                  ReachesValve(fault) ? fault : 0, now);
    RecordAnswer& answer = answers[static_cast<std::size_t>(k)];
    answer.flow =
        FlowReading(valve_, effects, InputAt(k, fault, now), answer.x_pct);
  }
  return answers;
}

// f4 at its full strength: the play is as wide as the travel, but where in it
// the rod begins is not known. So it rests where X is read.
Trajectory Looker::Seized(Course course) const {
  Trajectory answers = healthy_;
  double sum = 0.0;
  double count = 0.0;
  for (int k = course.start; k < rows_; ++k) {
    const RecordRow& row = window_.rows[static_cast<std::size_t>(k)];
    sum += row.x_measured ? row.x_pct : 0.0;
    count += row.x_measured ? 1.0 : 0.0;
  }
  const auto start = static_cast<std::size_t>(course.start);
  const double rest = count > 0.0 ? sum / count : healthy_.at(start).x_pct;
  const FaultEffects effects =
      EffectsOf(stands_ && ReachesValve(window_.standing), 0, 0.0);
  for (int k = course.start; k < rows_; ++k) {
    answers[static_cast<std::size_t>(k)] = {
        rest, FlowReading(valve_, effects, InputAt(k, 0, 0.0), rest)};
  }
  return answers;
}

// In rows. Readings that are all correlated still say as much as one.
double CorrelationTime(const Scatter& scatter, std::size_t measured) {
  return std::min(scatter.correlation_time,
                  static_cast<double>(std::max<std::size_t>(measured, 1)));
}

// With e and b in units of sd, a channel's share of Q is
//
//   1/tau [ sum_k (nu ln(1 + (e_k - b)^2 / (nu w_k)) + ln w_k) + p b^2 ]
//
// with p = tau sd^2 / s^2. Its derivative by b is 0 where
//
//   b = sum_k v_k e_k / (p + sum_k v_k),
//   v_k = 1 / (w_k (1 + (e_k - b)^2 / (nu w_k))).
//
// The weights v depend on b, which is therefore found by reweighting from 0 on.
ChannelFit Looker::FitChannel(const Trajectory& answers, bool flow,
                              double slow_sd) const {
  const Scatter& scatter = flow ? physics_.flow : physics_.x;
  std::vector<double> errors;
  std::vector<double> widths;  // w
  for (int k = Settling(); k < rows_; ++k) {
    const auto at = static_cast<std::size_t>(k);
    const RecordRow& row = window_.rows[at];
    if (!(flow ? row.flow_measured : row.x_measured)) {
      continue;
    }
    const RecordAnswer& answer = answers[at];
    const RecordAnswer& without = healthy_[at];
    const RecordAnswer& bare = bare_.empty() ? without : bare_[at];
    const double error =
        flow ? row.flow - answer.flow : row.x_pct - answer.x_pct;
    const double effect =
        flow ? answer.flow - without.flow : answer.x_pct - without.x_pct;
    errors.push_back(error / scatter.sd);
    const double stands =
        flow ? without.flow - bare.flow : without.x_pct - bare.x_pct;
    const double away = kEffectError * std::hypot(effect, stands) / scatter.sd;
    widths.push_back(1.0 + away * away);
  }
  const double correlation_time = CorrelationTime(scatter, errors.size());
  const double prior =
      correlation_time * scatter.sd * scatter.sd / (slow_sd * slow_sd);
  double shift = 0.0;  // b / sd
  for (int iteration = 0; iteration < 4; ++iteration) {
    double sum = 0.0;
    double weights = prior;
    for (std::size_t k = 0; k < errors.size(); ++k) {
      const double e = errors[k] - shift;
      const double weight =
          1.0 / (widths[k] * (1.0 + e * e / (widths[k] * kFreedom)));
      sum += weight * errors[k];
      weights += weight;
    }
    shift = sum / weights;
  }
  ChannelFit fit;
  for (std::size_t k = 0; k < errors.size(); ++k) {
    const double e = errors[k] - shift;
    fit.errors += kFreedom * std::log1p(e * e / (widths[k] * kFreedom));
    fit.cost += std::log(widths[k]);
  }
  fit.cost = (fit.errors + fit.cost + prior * shift * shift) / correlation_time;
  fit.errors /= correlation_time;
  return fit;
}

// The logarithms of the widths belong to the likelihood, not here: they grow
// with the effect of a fault, however well it fits.
double Looker::ErrorsOf(const Trajectory& answers) const {
  return FitChannel(answers, false, physics_.x.slow_sd).errors +
         (Measures(Signal::kF)
              ? FitChannel(answers, true, physics_.flow.slow_sd).errors
              : 0.0);
}

// The number of readings of X and F that count as independent.
double Looker::Readings() const {
  std::size_t positions = 0;
  std::size_t flows = 0;
  for (int k = Settling(); k < rows_; ++k) {
    const RecordRow& row = window_.rows[static_cast<std::size_t>(k)];
    positions += row.x_measured ? 1 : 0;
    flows += Measures(Signal::kF) && row.flow_measured ? 1 : 0;
  }
  const auto independent = [](const Scatter& scatter, std::size_t count) {
    return static_cast<double>(count) / CorrelationTime(scatter, count);
  };
  return independent(physics_.x, positions) + independent(physics_.flow, flows);
}

// Cost of unusual inputs after the detection, if the fault is there.
double Looker::InputCost(int fault, double strength, Course course,
                         const Trajectory& answers) const {
  const Instrumentation& i = valve_.instruments;
  double cost = 0.0;
  const auto add = [&](Signal signal, double InputRow::*member,
                       const InputBand& band, const Transmitter& transmitter,
                       auto&& as_read) {
    if (!Measures(signal)) {
      return;
    }
    double mean = 0.0;
    double expected = 0.0;
    double flow = 0.0;
    const int first = std::max(detection_, course.start);
    const double share = 1.0 / std::max(1, rows_ - first);
    for (int k = first; k < rows_; ++k) {
      const auto at = static_cast<std::size_t>(k);
      mean += share * (window_.rows[at].input.*member);
      flow += share * answers[at].flow;
      expected += share * std::clamp(as_read(usual_.*member,
                                             StrengthAt(k, strength, course)),
                                     transmitter.low, transmitter.high);
    }
    // The loop moves the pressures with the flow; how far is uncertain.
    const double moved = band.slope * (flow - physics_.flow_mean);
    const double span = transmitter.high - transmitter.low;
    const double sd = std::hypot(0.5 * band.sd, 0.005 * span, moved);
    const double away = (mean - expected) / sd;
    cost += away * away;
  };
  // Expected readings: the usual ones, with what the fault does to them.
  const auto with_fault = [&](auto&& change) {
    return [&, change](double usual, double s) {
      if (!ActsOnInputs(fault)) {
        return usual;
      }
      FaultEffects effects;
      ApplyFault(fault, s, effects);
      return change(usual, effects);
    };
  };
  const double pressure_span = i.pressure.high - i.pressure.low;
  add(Signal::kP1, &InputRow::p1_kpa, physics_.p1, i.pressure,
      with_fault([&](double usual, const FaultEffects& e) {
        return usual * e.inlet_factor + e.inlet_reading_step * pressure_span;
      }));
  add(Signal::kP2, &InputRow::p2_kpa, physics_.p2, i.pressure,
      with_fault([&](double usual, const FaultEffects& e) {
        return usual * e.outlet_factor + e.outlet_reading_step * pressure_span;
      }));
  add(Signal::kT1, &InputRow::t1_degc, physics_.t1, i.temperature,
      with_fault([&](double usual, const FaultEffects& e) {
        const double t1_degc =
            e.temperature_rise_c > 0.0
                ? std::min(usual + e.temperature_rise_c, kMaxTemperatureC)
                : usual;
        return t1_degc + e.temperature_reading_step *
                             (i.temperature.high - i.temperature.low);
      }));
  if (fault != 0 && FaultFactsOf(fault).acts_on == ActsOn::kFlowReading &&
      !physics_.loop.reads_flow) {
    return cost + command_away_.value_or(0.0);
  }
  if (fault == kLowFlow && command_away_) {
    return cost + std::max(0.0, kUnanswered - *command_away_);
  }
  return cost;
}

// A flow transmitter that goes wrong moves no command, unless the loop reads
// it: one that moved with the fault tells against it. A line that loses its
// flow does. Returns how far the command moved, in squared deviations.
std::optional<double> Looker::CommandAway() const {
  // The gap is that of LoopObserver (valve_physics.cpp), which measures how far
  // this difference usually is from 0.
  constexpr int kMinRowsBefore = 60;
  constexpr int kGap = 10;
  constexpr int kMinRowsAfter = 10;
  const LoopHabit& loop = physics_.loop;
  const int first = detection_ + kGap;
  if (loop.command_sd <= 0.0 || detection_ < kMinRowsBefore ||
      rows_ < first + kMinRowsAfter) {
    return std::nullopt;
  }
  const auto mean = [&](int from, int to) {
    double sum = 0.0;
    for (int k = from; k < to; ++k) {
      sum += window_.rows[static_cast<std::size_t>(k)].input.cv_pct;
    }
    return sum / (to - from);
  };
  const double away =
      (mean(first, rows_) - mean(0, detection_)) / loop.command_sd;
  return away * away;
}

double Looker::Cost(int fault, double strength, Course course,
                    const Trajectory& answers) const {
  double cost = FitChannel(answers, false, physics_.x.slow_sd).cost +
                InputCost(fault, strength, course, answers);
  if (Measures(Signal::kF)) {
    cost += FitChannel(answers, true, physics_.flow.slow_sd).cost;
  }
  return cost;
}

double Looker::CostOf(const Hypothesis& h, double strength,
                      const Trajectory& answers) const {
  const double away = std::log(h.supply) / kSupplyDeviation;
  if (h.fault == kLowFlow && strength < physics_.least_loss) {
    return kNoHypothesis;
  }
  return Cost(h.fault, h.sign * strength, h.course, answers) + away * away;
}

std::vector<Hypothesis> Looker::Hypotheses() const {
  std::vector<Hypothesis> hypotheses;
  for (int fault = 1; fault <= kLastFault; ++fault) {
    const FaultFacts& facts = FaultFactsOf(fault);
    if (facts.weak || fault == window_.standing ||
        !IsVisibleIn(fault, window_.signals) || !Exists(fault, valve_) ||
        (window_.at_position && ShowsInRodAlone(fault))) {
      continue;
    }
    for (const double sign : {1.0, -1.0}) {
      if (sign > 0.0 || HasNegative(fault)) {
        hypotheses.push_back({fault, sign, {detection_, false}});
      }
    }
  }
  if (Measures(Signal::kF) && physics_.least_loss > 0.0) {
    hypotheses.push_back({kLowFlow, 1.0, {detection_, false}});
  }
  return hypotheses;
}

// The strength of f1 whose stop, X = 100 (1 - s) %, X does not pass in 98 % of
// its readings behind the detection. Between two stops, one passed and one not,
// X is not linear, so that the search by itself may miss the right one. Nothing
// if X was never read there.
std::optional<double> Looker::ObservedStop() const {
  std::vector<double> x;
  for (int k = detection_; k < rows_; ++k) {
    const RecordRow& row = window_.rows[static_cast<std::size_t>(k)];
    if (row.x_measured) {
      x.push_back(row.x_pct);
    }
  }
  if (x.empty()) {
    return std::nullopt;
  }
  const auto most = x.begin() + static_cast<std::ptrdiff_t>(x.size() * 49 / 50);
  std::nth_element(x.begin(), most, x.end());
  return std::clamp(1.0 - RodAt(standing_, 0.01 * *most), 0.0, 1.0);
}

void Looker::Try(Hypothesis& h, double strength) {
  if (h.simulated.contains(strength)) {
    return;
  }
  Trajectory answers = Simulate(h.fault, h.sign * strength, h.course, h.supply);
  const double cost = CostOf(h, strength, answers);
  if (cost < h.cost) {
    h.cost = cost;
    h.strength = strength;
  }
  h.simulated.emplace(strength, std::move(answers));
}

// Another course at the best strength; taken if it fits better. Strengths about
// it are then simulated again, because the earlier ones had the old course.
void Looker::TryCourse(Hypothesis& h, Course course) {
  if (course == h.course) {
    return;
  }
  Hypothesis other{h.fault, h.sign, course};
  Try(other, h.strength);
  if (other.cost < h.cost) {
    Try(other, 0.75 * h.strength);
    Try(other, std::min(1.0, 1.3 * h.strength));
    h = std::move(other);
  }
}

// f10 in the place of f16: both leave the actuator less force, and which of
// them it is rests on the supply pressure.
Hypothesis Looker::PerforationLike(const Hypothesis& supply_drop,
                                   Course course) {
  constexpr int kRefinements = 3;
  Hypothesis best{kDiaphragmPerforation, 1.0, course};
  for (const double supply : kSupplies) {
    Hypothesis other{kDiaphragmPerforation, 1.0, course, supply};
    // Where the force that is left is that of f16,
    //
    //   A (1 - s) r P = A (1 - s16) P,   s = 1 - (1 - s16) / r
    //
    // with r P the supply pressure. f10 also leaks air, so strengths about this
    // one are tried.
    const double alike = 1.0 - (1.0 - supply_drop.strength) / supply;
    for (const double share : {0.6, 0.75, 0.9, 1.0, 1.15}) {
      Try(other, std::clamp(share * alike, 0.02, 1.0));
    }
    for (int i = 0; i < kRefinements; ++i) {
      Refine(other);
    }
    if (other.cost < best.cost) {
      best = std::move(other);
    }
  }
  return best;
}

// use(|strength|, answers) for strengths between the simulated ones, the
// answers linear between theirs, from none on. std::lerp() is exact at 1, so
// that a simulated strength is passed as the key that it has in `simulated`.
template <typename Use>
void Looker::Between(const Hypothesis& h, Use&& use) const {
  constexpr int kParts = 8;
  double low = 0.0;
  const Trajectory* from = &healthy_;
  Trajectory answers(healthy_.size());
  for (const auto& [high, to] : h.simulated) {
    for (int part = 1; part <= kParts; ++part) {
      const double share = static_cast<double>(part) / kParts;
      for (std::size_t k = 0; k < answers.size(); ++k) {
        answers[k] = {std::lerp((*from)[k].x_pct, to[k].x_pct, share),
                      std::lerp((*from)[k].flow, to[k].flow, share)};
      }
      use(std::lerp(low, high, share), answers);
    }
    low = high;
    from = &to;
  }
}

// Simulates where the least cost is expected, never beyond the largest strength
// that was simulated before.
void Looker::Refine(Hypothesis& h) {
  double least = kInfinity;
  double where = h.strength;
  Between(h, [&](double strength, const Trajectory& answers) {
    const double cost = CostOf(h, strength, answers);
    if (cost < least) {
      least = cost;
      where = strength;
    }
  });
  if (h.simulated.contains(where)) {
    // Not linear in between: halve the wider of the gaps beside it.
    const auto at = h.simulated.find(where);
    const double below = at == h.simulated.begin() ? 0.0 : std::prev(at)->first;
    const double above =
        std::next(at) == h.simulated.end() ? where : std::next(at)->first;
    where = 0.5 * (where + (above - where > where - below ? above : below));
  }
  Try(h, where);
}

// The 95 % interval is where the cost is within 3.84 `scale` of the least; 3.84
// is the 95 % quantile of chi-square for one free parameter. The cost is linear
// between the strengths that it is known at.
Explanation Looker::Explain(const Hypothesis& h, double scale) const {
  constexpr double kQuantile = 3.84;
  Explanation e{h.fault,    h.sign * h.strength,         h.strength,
                h.strength, h.course.start - detection_, h.course.growing};
  e.supply = h.supply;
  const auto beyond = [&](double strength, const Trajectory& answers) {
    return CostOf(h, strength, answers) - h.cost - kQuantile * scale;
  };
  double last = 0.0;
  double last_beyond = beyond(0.0, healthy_);
  Between(h, [&](double strength, const Trajectory& answers) {
    const double now_beyond = beyond(strength, answers);
    if (last_beyond <= 0.0 || now_beyond <= 0.0) {
      // Used only if the signs differ, where the divisor is not 0.
      const double end =
          std::lerp(last, strength, last_beyond / (last_beyond - now_beyond));
      e.lowest = std::min(e.lowest, last_beyond <= 0.0 ? last : end);
      e.highest = std::max(e.highest, now_beyond <= 0.0 ? strength : end);
    }
    last = strength;
    last_beyond = now_beyond;
  });
  if (h.sign < 0.0) {
    std::tie(e.lowest, e.highest) = std::pair(-e.highest, -e.lowest);
  }
  return e;
}

// A healthy valve, whose readings may drift.
ChannelFit Looker::FitWithoutFault() const {
  const bool has_flow = Measures(Signal::kF);
  // A constant shift of one reading by some per cent: drift.
  constexpr double kDrift = 0.02;
  const Instrumentation& i = valve_.instruments;
  // The change by a drift of one reading; the rest of the cost stays.
  const auto drifted = [&](bool flow, const Transmitter& transmitter,
                           const Scatter& scatter) {
    ChannelFit fit = FitChannel(healthy_, flow,
                                kDrift * (transmitter.high - transmitter.low));
    const ChannelFit usual = FitChannel(healthy_, flow, scatter.slow_sd);
    fit.cost += kFaultPenalty - usual.cost;
    fit.errors -= usual.errors;
    return fit;
  };
  ChannelFit unmoved{};
  ChannelFit shifted = drifted(false, i.position, physics_.x);
  if (has_flow) {
    const ChannelFit flow = drifted(true, i.flow, physics_.flow);
    shifted = flow.cost < shifted.cost ? flow : shifted;
  }
  if (shifted.cost < 0.0) {
    unmoved = shifted;
  }
  unmoved.cost += Cost(0, 0.0, {detection_, false}, healthy_);
  unmoved.errors += ErrorsOf(healthy_);
  return unmoved;
}

// By cost; empty if it was asked to stop.
std::vector<Hypothesis> Looker::FitHypotheses(const std::stop_token& stop) {
  std::vector<Hypothesis> hypotheses = Hypotheses();
  const double inputs = InputCost(0, 0.0, {detection_, false}, healthy_);
  for (Hypothesis& h : hypotheses) {
    if (stop.stop_requested()) {
      return {};
    }
    // Faults of the inputs are sought where an input is unusual: one by three
    // deviations, or several by less.
    if (ActsOnInputs(h.fault) && inputs < 9.0 && IsSeenInInputs(h)) {
      continue;
    }
    for (const double strength : {0.1, 0.3, 0.6, 1.0}) {
      Try(h, strength);
    }
    const Onset onset = FaultFactsOf(h.fault).onset;
    if (onset == Onset::kStop) {
      if (const std::optional<double> stop_seen = ObservedStop()) {
        Try(h, *stop_seen);
      }
    } else if (onset == Onset::kThreshold) {
      for (const double strength : {0.5, 0.7, 0.8, 0.9}) {
        Try(h, strength);
      }
    }
  }
  // Number of the best that get another simulation in each round; the number of
  // simulations decides what a look costs.
  constexpr std::array<std::size_t, 8> kKept{12, 10, 7, 5, 5, 5, 5, 5};
  for (std::size_t round = 0; round < kKept.size(); ++round) {
    std::stable_sort(
        hypotheses.begin(), hypotheses.end(),
        [](const auto& a, const auto& b) { return a.cost < b.cost; });
    for (std::size_t j = 0; j < std::min(kKept[round], hypotheses.size());
         ++j) {
      Hypothesis& h = hypotheses[j];
      if (stop.stop_requested()) {
        return {};
      }
      if (h.simulated.empty()) {
        continue;
      }
      // Not in the first round: a course is first tried at the best strength,
      // which one refinement has to find first.
      if (round == 1) {
        for (const Course course :
             {Course{std::max(0, detection_ - 3), false},
              Course{std::max(0, detection_ - 20), false}, Course{0, false},
              Course{std::max(0, detection_ - 60), true}}) {
          TryCourse(h, course);
        }
      }
      Refine(h);
    }
  }
  std::stable_sort(
      hypotheses.begin(), hypotheses.end(),
      [](const auto& a, const auto& b) { return a.cost < b.cost; });
  return hypotheses;
}

SecondLook Looker::Run(const std::stop_token& stop) {
  const ChannelFit unmoved = FitWithoutFault();
  const std::vector<Hypothesis> hypotheses = FitHypotheses(stop);
  if (hypotheses.empty()) {
    return {};
  }
  const double readings = Readings();
  const Hypothesis& first = hypotheses.front();
  const bool faulty = first.cost + kFaultPenalty < unmoved.cost;
  const double best = faulty ? first.cost + kFaultPenalty : unmoved.cost;
  SecondLook look;
  look.best = faulty ? first.simulated.at(first.strength) : healthy_;
  look.readings = readings;
  look.complete = Measures(Signal::kP1) && Measures(Signal::kP2) &&
                  (Measures(Signal::kX) || window_.at_position);
  look.misfit = (faulty ? ErrorsOf(look.best) : unmoved.errors) / readings;
  // Where nothing fits well, little is told apart.
  const double scale = std::max(1.0, look.misfit);
  Explanation nothing;
  nothing.distance = (unmoved.cost - best) / scale;
  look.ranked.push_back(nothing);
  for (const Hypothesis& h : hypotheses) {
    if (h.simulated.empty()) {
      continue;
    }
    Explanation explanation = Explain(h, scale);
    explanation.distance = (h.cost + kFaultPenalty - best) / scale;
    look.ranked.push_back(explanation);
  }
  std::stable_sort(look.ranked.begin(), look.ranked.end(),
                   [](const Explanation& a, const Explanation& b) {
                     return a.distance < b.distance;
                   });
  if (faulty && first.fault == kSupplyDrop) {
    Hypothesis torn = PerforationLike(first, first.course);
    // Hypotheses() has f10 wherever it has f16.
    const auto f10 = std::ranges::find(hypotheses, kDiaphragmPerforation,
                                       &Hypothesis::fault);
    if (f10->course != first.course) {
      Hypothesis other = PerforationLike(first, f10->course);
      torn = other.cost < torn.cost ? std::move(other) : std::move(torn);
    }
    look.perforation = Explain(torn, scale);
    look.perforation->distance = (torn.cost + kFaultPenalty - best) / scale;
  }
  return look;
}

StrengthLook Looker::EstimateStrengths(const std::vector<Explanation>& known,
                                       const std::stop_token& stop) {
  constexpr double kMinStrength = 0.02;
  constexpr double kFurther = 1.5;
  constexpr int kRefinements = 4;
  StrengthLook look;
  look.misfit = kInfinity;
  for (const Explanation& e : known) {
    if (stop.stop_requested()) {
      return {};
    }
    Hypothesis h{e.fault, e.strength < 0.0 ? -1.0 : 1.0, {0, false}, e.supply};
    const double about = std::max(kMinStrength, std::abs(e.strength));
    Try(h, 0.75 * about);
    double most = about;
    Try(h, most);
    // Refine() does not go beyond the largest strength, so this one has to be
    // worse than one below it, or 1.
    do {
      most = std::min(1.0, kFurther * most);
      Try(h, most);
    } while (h.strength == most && most < 1.0);
    for (int i = 0; i < kRefinements; ++i) {
      Refine(h);
    }
    const double misfit = ErrorsOf(h.simulated.at(h.strength)) / Readings();
    look.faults.push_back(Explain(h, std::max(1.0, misfit)));
    look.misfit = std::min(look.misfit, misfit);
  }
  return look;
}

void RequireRows(const LookWindow& window) {
  Require(window.rows.size() >= 20 && window.detection < window.rows.size(),
          "a second look takes 20 rows and a detection among them");
}

}  // namespace

SecondLook RunSecondLook(const ValvePhysics& physics, const LookWindow& window,
                         const std::stop_token& stop) {
  RequireRows(window);
  return Looker(physics, window).Run(stop);
}

StrengthLook EstimateStrengths(const ValvePhysics& physics,
                               const LookWindow& window,
                               const std::vector<Explanation>& known,
                               const std::stop_token& stop) {
  RequireRows(window);
  return Looker(physics, window).EstimateStrengths(known, stop);
}

double MisfitWithoutFault(const ValvePhysics& physics,
                          const LookWindow& window) {
  RequireRows(window);
  return Looker(physics, window).MisfitOfHealthy();
}

namespace {

UsualValve UsualOf(const ValvePhysics& physics) {
  const bool is_water = physics.parameters.medium.fluid == Fluid::kWater;
  UsualValve usual;
  usual.period_s = physics.drive.period_s;
  usual.p1_kpa = physics.p1.mean;
  usual.p2_kpa = physics.p2.mean;
  usual.t1_degc = physics.t1.mean;
  usual.coldest_degc = is_water ? 0.0 : kColdestMediumC;
  usual.hottest_degc = is_water ? kMaxTemperatureC : kHottestMediumC;
  usual.flow = physics.flow_mean;
  usual.slow_flow_sd = physics.flow.slow_sd;
  return usual;
}

}  // namespace

ValveLooker::ValveLooker(const ValvePhysics& physics)
    : LookSimulation(UsualOf(physics)), physics_(physics) {}

double ValveLooker::HealthyFlow(const InputRow& input, double x_pct) const {
  return FlowReading(physics_.parameters, {}, input, x_pct);
}

SecondLook ValveLooker::Look(const LookWindow& window,
                             const std::stop_token& stop) const {
  return RunSecondLook(physics_, window, stop);
}

StrengthLook ValveLooker::Strengths(const LookWindow& window,
                                    const std::vector<Explanation>& known,
                                    const std::stop_token& stop) const {
  return EstimateStrengths(physics_, window, known, stop);
}

double ValveLooker::Misfit(const LookWindow& window) const {
  return MisfitWithoutFault(physics_, window);
}

}  // namespace fdi::simulator
