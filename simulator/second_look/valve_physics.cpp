#include "simulator/second_look/valve_physics.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <string>
#include <string_view>
#include <type_traits>

#include "base/error.h"
#include "base/field_list.h"
#include "base/median.h"

namespace fdi::simulator {
namespace {

constexpr std::size_t kSettleRows = 60;  // The simulation starts at rest.
constexpr std::size_t kMinStretchRows = 180;
constexpr std::size_t kSlowRows = 600;
constexpr double kLeastLoss = 0.5;

double Mean(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double value : values) {
    sum += value;
  }
  return sum / static_cast<double>(values.size());
}

// About the median, what is beyond five robust deviations drawn in.
std::vector<double> Bounded(std::vector<double> errors) {
  const double middle = Median(errors);
  for (double& error : errors) {
    error -= middle;
  }
  const double reach = 5.0 * std::max(1e-9, RobustSd(errors));
  for (double& error : errors) {
    error = std::clamp(error, -reach, reach);
  }
  return errors;
}

// The scatter of the readings in `rows` rows.
Scatter ScatterOf(std::vector<double> raw, std::size_t rows) {
  if (raw.empty()) {
    return {};
  }
  const std::vector<double> errors = Bounded(std::move(raw));
  // Not 0, because the correlations are divided by it.
  double squares = 1e-18;
  for (const double error : errors) {
    squares += error * error;
  }
  Scatter scatter;
  scatter.sd = std::sqrt(squares / static_cast<double>(errors.size()));
  // tau = 1 + 2 sum_k rho_k: the mean of n errors has the variance of that of
  // n/tau independent ones. The sum ends at the first small rho_k, or the noise
  // of all later ones would add up in it.
  constexpr double kUncorrelated = 0.05;
  // The lags are counted in readings, tau in rows.
  const double step =
      static_cast<double>(rows) / static_cast<double>(errors.size());
  for (std::size_t lag = 1; lag < kMinStretchRows / 2; ++lag) {
    double sum = 0.0;
    for (std::size_t k = lag; k < errors.size(); ++k) {
      sum += errors[k] * errors[k - lag];
    }
    if (sum < kUncorrelated * squares) {
      break;
    }
    scatter.correlation_time += step * 2.0 * sum / squares;
  }
  const std::size_t pieces =
      std::clamp<std::size_t>(rows / kSlowRows, 1, errors.size());
  double means = 0.0;
  for (std::size_t i = 0; i < pieces; ++i) {
    const auto at = [&](std::size_t j) {
      return errors.begin() +
             static_cast<std::ptrdiff_t>(j * errors.size() / pieces);
    };
    const double mean = Mean({at(i), at(i + 1)});
    means += mean * mean;
  }
  // Hours do not show how days differ.
  constexpr double kMinSlowRatio = 0.3;
  scatter.slow_sd = std::max(std::sqrt(means / static_cast<double>(pieces)),
                             kMinSlowRatio * scatter.sd);
  return scatter;
}

InputBand BandOf(const std::vector<double>& input,
                 const std::vector<double>& flow) {
  InputBand band;
  band.mean = Mean(input);
  const double flow_mean = Mean(flow);
  double cross = 0.0;
  double square = 1e-9;
  for (std::size_t k = 0; k < input.size(); ++k) {
    const double away = flow[k] - flow_mean;
    cross += away * (input[k] - band.mean);
    square += away * away;
  }
  band.slope = cross / square;
  double rest = 1e-9;
  for (std::size_t k = 0; k < input.size(); ++k) {
    const double error =
        input[k] - band.mean - band.slope * (flow[k] - flow_mean);
    rest += error * error;
  }
  band.sd = std::sqrt(rest / static_cast<double>(input.size()));
  return band;
}

// The part of a series that its last values do not predict: the errors of an
// autoregression, sum_i a_i y_(k-i) with a_0 = 1. Levinson's recursion raises
// its order to m by
//
//   c = -sum_(i<m) a_i r_(m-i) / E,   a_i += c a_(m-i),   E *= 1 - c^2
//
// with r_i the sum of y_k y_(k-i) and E that of the squared errors.
std::vector<double> Innovations(std::vector<double> series) {
  constexpr std::size_t kOrder = 5;
  const double mean = Mean(series);
  for (double& value : series) {
    value -= mean;
  }
  std::array<double, kOrder + 1> r{};
  for (std::size_t lag = 0; lag <= kOrder; ++lag) {
    for (std::size_t k = lag; k < series.size(); ++k) {
      r[lag] += series[k] * series[k - lag];
    }
  }
  std::array<double, kOrder + 1> a{1.0};  // sum_i a_i y_(k-i) is the error.
  // Above 0 even for a command that never moves.
  double error = r[0] + 1e-12;
  for (std::size_t order = 1; order <= kOrder; ++order) {
    double sum = 0.0;
    for (std::size_t i = 0; i < order; ++i) {
      sum += a[i] * r[order - i];
    }
    const double reflection = -sum / error;
    const auto before = a;
    for (std::size_t i = 1; i <= order; ++i) {
      a[i] = before[i] + reflection * before[order - i];
    }
    error *= 1.0 - reflection * reflection;
  }
  std::vector<double> errors(series.size());
  for (std::size_t k = kOrder; k < series.size(); ++k) {
    for (std::size_t i = 0; i <= kOrder; ++i) {
      errors[k] += a[i] * series[k - i];
    }
  }
  return errors;
}

// Gathers, record by record, how the command changes, and whether it follows
// what F reads beyond what the valve lets pass: its noise is seen by nobody but
// a controller that reads it.
class LoopObserver {
 public:
  // `unexplained`: measured minus simulated flow, in the rows `measured`. A
  // command that acts before its stamp (delay < 0) shows in F of the same row.
  void Add(const std::vector<double>& command,
           const std::vector<double>& unexplained,
           const std::vector<std::size_t>& measured, int delay) {
    for (std::size_t k = kBefore; k + kGap + kAfter < command.size(); k += 10) {
      const auto at = [&](std::size_t row) {
        return command.begin() + static_cast<std::ptrdiff_t>(row);
      };
      changes_.push_back(Mean({at(k + kGap), at(k + kGap + kAfter)}) -
                         Mean({at(k - kBefore), at(k)}));
    }
    if (unexplained.empty()) {
      return;
    }
    std::vector<double> steps(command.size());
    for (std::size_t k = 1; k < command.size(); ++k) {
      steps[k] = command[k] - command[k - 1];
    }
    // Two series that are correlated in time seem correlated with each other by
    // chance; their innovations do not (Haugh, J. Am. Stat. Assoc. 71, 1976).
    const std::vector<double> moved = Innovations(Bounded(steps));
    const std::vector<double> noise = Innovations(Bounded(unexplained));
    first_ = delay < 0 ? 1 : 0;
    for (std::size_t k = 0; k + kLags < moved.size(); ++k) {
      moved_ += moved[k] * moved[k];
      ++count_;
    }
    // Values filled in between two readings have no noise of their own.
    for (std::size_t j = 0; j < noise.size(); ++j) {
      const std::size_t k = measured[j];
      if (k + kLags >= moved.size()) {
        break;
      }
      for (std::size_t lag = first_; lag < kLags; ++lag) {
        cross_[lag] += moved[k + lag] * noise[j];
      }
      noise_ += noise[j] * noise[j];
      ++readings_;
    }
  }

  LoopHabit Habit() const {
    constexpr double kMinRows = 1800.0;
    constexpr double kSignificant = 4.0;
    LoopHabit habit;
    if (changes_.empty() || readings_ < kMinRows || moved_ <= 0.0) {
      return habit;
    }
    double squares = 0.0;
    for (const double change : Bounded(changes_)) {
      squares += change * change;
    }
    habit.command_sd =
        std::sqrt(squares / static_cast<double>(changes_.size()));
    // If neither series depends on the other, the sum of their products has the
    // deviation sqrt(moved_ noise_ / count_).
    habit.reads_flow = std::ranges::any_of(cross_, [&](double cross) {
      return std::abs(cross) >
             kSignificant * std::sqrt(moved_ * noise_ / count_);
    });
    return habit;
  }

 private:
  static constexpr std::size_t kBefore = 120;
  static constexpr std::size_t kGap = 10;
  static constexpr std::size_t kAfter = 60;
  static constexpr std::size_t kLags = 4;

  std::vector<double> changes_;
  std::size_t first_{0};
  std::array<double, kLags> cross_{};
  double moved_{0.0};
  double noise_{0.0};
  double count_{0.0};
  double readings_{0.0};
};

}  // namespace

ValvePhysics DescribeValve(const ValveParameters& parameters,
                           const RecordDrive& drive,
                           const std::vector<std::vector<RecordRow>>& records) {
  std::vector<double> x;
  std::vector<double> flow;
  std::vector<double> level;
  std::vector<double> p1;
  std::vector<double> p2;
  std::vector<double> t1;
  LoopObserver loop;
  for (const std::vector<RecordRow>& rows : records) {
    if (rows.size() < kMinStretchRows) {
      continue;
    }
    const auto answers =
        SimulateRecord(parameters, rows, 0, rows.size(), drive);
    std::vector<double> command;
    std::vector<double> unexplained;
    std::vector<std::size_t> measured;
    for (std::size_t k = kSettleRows; k < rows.size(); ++k) {
      command.push_back(rows[k].input.cv_pct);
      // As in the second look, which divides by the scatter: what is filled in
      // does not count.
      if (rows[k].x_measured) {
        x.push_back(rows[k].x_pct - answers[k].x_pct);
      }
      if (rows[k].flow_measured) {
        flow.push_back(rows[k].flow - answers[k].flow);
        unexplained.push_back(flow.back());
        measured.push_back(k - kSettleRows);
      }
      level.push_back(rows[k].flow);
      p1.push_back(rows[k].input.p1_kpa);
      p2.push_back(rows[k].input.p2_kpa);
      t1.push_back(rows[k].input.t1_degc);
    }
    loop.Add(command, unexplained, measured, drive.command_delay);
  }
  if (level.empty()) {
    throw DataError("healthy records: expected one of at least 180 rows");
  }
  ValvePhysics physics{parameters, drive, ScatterOf(std::move(x), level.size()),
                       ScatterOf(std::move(flow), level.size()), Mean(level)};
  physics.p1 = BandOf(p1, level);
  physics.p2 = BandOf(p2, level);
  physics.t1 = BandOf(t1, level);
  physics.loop = loop.Habit();
  physics.least_loss = kLeastLoss;
  return physics;
}

// A model set stores the physics in the order of the field lists:
//
//   physics = { path value }        a double, of switches and enumerations, too
//   path    = field { "." field } [ "." index ]
//             for example "parameters.actuator.stroke_m"
//
// PhysicsFrom() requires these paths in this order: a field that is new,
// renamed or moved makes the stored sets unreadable.
namespace {

FDI_VISITABLE(RecordDrive, period_s, interpolated_command, command_delay)
FDI_VISITABLE(Scatter, sd, correlation_time, slow_sd)
FDI_VISITABLE(InputBand, mean, slope, sd)
FDI_VISITABLE(LoopHabit, command_sd, reads_flow)
FDI_VISITABLE(ValvePhysics, parameters, drive, x, flow, flow_mean, p1, p2, t1,
              loop, least_loss)

// Calls use(path, field) for every field that is a number or a list of them.
template <typename Use>
struct Numbers {
  std::string prefix;
  Use& use;

  void operator()(const char* /*name*/, std::string& /*field*/) {}
  void operator()(const char* name, std::vector<double>& field) {
    use(prefix + name, field);
  }
  template <typename Field>
  void operator()(const char* name, Field& field) {
    if constexpr (std::is_class_v<Field>) {
      VisitFields(field, Numbers{prefix + name + '.', use});
    } else {
      use(prefix + name, field);
    }
  }
};

using List = std::vector<double>;

// A double beyond the range of what it becomes would be undefined behaviour.
template <typename Field>
Field FromNumber(const PhysicalValue& value) {
  if constexpr (std::is_floating_point_v<Field>) {
    return value.value;
  } else {
    using Whole = std::numeric_limits<int>;
    constexpr bool kSigned = std::is_same_v<Field, int>;
    constexpr double kLeast = kSigned ? static_cast<double>(Whole::min()) : 0.0;
    constexpr double kMost =
        std::is_same_v<Field, bool> ? 1.0
        : std::is_enum_v<Field>
            ? static_cast<double>(kEnumNames<Field>.size()) - 1.0
            : static_cast<double>(Whole::max());
    if (!(value.value >= kLeast && value.value <= kMost &&
          value.value == std::floor(value.value))) {
      throw DataError(
          "the physics of the model set has " + value.name + " = " +
          std::to_string(value.value) + ", expected a whole number of " +
          std::to_string(static_cast<int>(kLeast)) + " to " +
          std::to_string(static_cast<int>(kMost)) + ": onboard the valve anew");
    }
    return static_cast<Field>(static_cast<int>(value.value));
  }
}

}  // namespace

std::vector<PhysicalValue> ToValues(const ValvePhysics& physics) {
  std::vector<PhysicalValue> values;
  auto use = [&](const std::string& name, auto& field) {
    if constexpr (std::is_same_v<std::decay_t<decltype(field)>, List>) {
      for (std::size_t i = 0; i < field.size(); ++i) {
        values.push_back({name + '.' + std::to_string(i), field[i]});
      }
    } else {
      values.push_back({name, static_cast<double>(field)});
    }
  };
  ValvePhysics copy = physics;
  VisitFields(copy, Numbers<decltype(use)>{"", use});
  return values;
}

ValvePhysics PhysicsFrom(const std::vector<PhysicalValue>& values) {
  ValvePhysics physics;
  std::size_t next = 0;
  const auto is_next = [&](const std::string& name) {
    return next < values.size() && values[next].name == name;
  };
  auto use = [&](const std::string& name, auto& field) {
    if constexpr (std::is_same_v<std::decay_t<decltype(field)>, List>) {
      while (is_next(name + '.' + std::to_string(field.size()))) {
        field.push_back(values[next++].value);
      }
    } else if (is_next(name)) {
      field =
          FromNumber<std::remove_reference_t<decltype(field)>>(values[next++]);
    } else {
      throw DataError("the physics of the model set lacks " + name +
                      ": onboard the valve anew");
    }
  };
  VisitFields(physics, Numbers<decltype(use)>{"", use});
  if (next < values.size()) {
    throw DataError("the physics of the model set has " + values[next].name +
                    ", which is unknown: onboard the valve anew");
  }
  Validate(physics.parameters);
  return physics;
}

FlowTarget FlowTargetOf(const ModelSet& models) {
  if (models.physics.empty()) {
    return {models.flow_unit};
  }
  const ValvePhysics physics = PhysicsFrom(models.physics);
  FlowTarget target{models.flow_unit, physics.parameters.medium};
  if (target.medium.is_gas()) {
    target.p1_kpa = physics.p1.mean;
    target.t1_degc = physics.t1.mean;
  }
  return target;
}

}  // namespace fdi::simulator
