#include "simulator/valve_identification.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>

#include "base/error.h"
#include "base/parallel_for.h"
#include "simulator/control_valve.h"
#include "simulator/require_range.h"
#include "simulator/robust_least_squares.h"
#include "simulator/valve_equations.h"

namespace fdi::simulator {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

constexpr const char* kFriction = "actuator.coulomb_friction_n";

// Rows [first, last) of a record that outlives it.
struct RecordSegment {
  const std::vector<RecordRow>* rows;
  std::size_t first;
  std::size_t last;

  std::size_t size() const { return last - first; }
};

// A candidate model of the valve.
struct ValveCandidate {
  ValveParameters parameters;
  RecordDrive drive;
};

// A physical parameter that a healthy record may determine. The logarithm of
// its value is fitted.
struct ValveUnknown {
  std::string name;  // Its field, as Validate() names it.
  double& (*in)(ValveParameters& parameters);
  double nominal;
  double lower;  // > 0.
  double upper;
  // Stated in a data sheet and poorly determined by a record: noise in the
  // recorded pressures by itself can favour a wrong value.
  bool stated;
};

double CommandTravel(const RecordSegment& segment) {
  double travel = 0.0;
  for (std::size_t k = segment.first + 1; k < segment.last; ++k) {
    travel += std::abs((*segment.rows)[k].input.cv_pct -
                       (*segment.rows)[k - 1].input.cv_pct);
  }
  return travel;
}

// Cuts the records into equal segments of at most 600 rows and selects those
// with the most travel of the command, liveliest first, at most `max_rows` in
// total but at least one segment. Segments below 180 rows are not used.
std::vector<RecordSegment> LiveliestSegments(
    const std::vector<HealthyRecord>& records, std::size_t max_rows) {
  constexpr std::size_t kMaxPieceRows = 600;
  constexpr std::size_t kMinPieceRows = 180;
  std::vector<RecordSegment> segments;
  for (const HealthyRecord& record : records) {
    const std::size_t count = record.rows.size();
    const std::size_t pieces = (count + kMaxPieceRows - 1) / kMaxPieceRows;
    for (std::size_t i = 0; i < pieces; ++i) {
      const RecordSegment piece{&record.rows, i * count / pieces,
                                (i + 1) * count / pieces};
      if (piece.size() >= kMinPieceRows) {
        segments.push_back(piece);
      }
    }
  }
  std::stable_sort(segments.begin(), segments.end(),
                   [](const RecordSegment& a, const RecordSegment& b) {
                     return CommandTravel(a) > CommandTravel(b);
                   });
  std::size_t rows = 0;
  std::size_t taken = 0;
  while (taken < segments.size() &&
         (taken == 0 || rows + segments[taken].size() <= max_rows)) {
    rows += segments[taken++].size();
  }
  segments.resize(taken);
  return segments;
}

using Answers = std::vector<std::vector<RecordAnswer>>;  // By segment.

// Integrator tolerances: differences between simulations of points 2 % apart
// need finer ones than a comparison with a record.
constexpr double kFine = 1.0;
constexpr double kCoarse = 10.0;

// Simulates all candidates on all segments with `threads` threads. Each pair
// has a place of its own for its answers, which need no lock and do not depend
// on the number of threads.
std::vector<Answers> Simulate(const std::vector<ValveCandidate>& candidates,
                              const std::vector<RecordSegment>& segments,
                              double tolerance_scale, int threads) {
  std::vector<Answers> motions(candidates.size(), Answers(segments.size()));
  const std::size_t pairs = candidates.size() * segments.size();
  ParallelFor(static_cast<int>(pairs), threads, [&](int pair) {
    const auto i = static_cast<std::size_t>(pair);
    const ValveCandidate& candidate = candidates[i / segments.size()];
    const RecordSegment& segment = segments[i % segments.size()];
    motions[i / segments.size()][i % segments.size()] =
        SimulateRecord(candidate.parameters, *segment.rows, segment.first,
                       segment.last, candidate.drive, tolerance_scale);
  });
  return motions;
}

// Differences simulation - record: one row per instant, columns X [%] and, if
// `has_flow`, F computed with `parameters`; the first `settle_rows` of every
// segment are omitted. A value that was not measured has a difference of 0,
// which RobustScale() and Compare() do not count.
MatrixXd Residuals(const ValveParameters& parameters, const Answers& motion,
                   const std::vector<RecordSegment>& segments,
                   std::size_t settle_rows, bool has_flow) {
  std::size_t count = 0;
  for (const RecordSegment& segment : segments) {
    count += segment.size() - settle_rows;
  }
  MatrixXd result(static_cast<Index>(count), has_flow ? 2 : 1);
  Index at = 0;
  for (std::size_t s = 0; s < segments.size(); ++s) {
    for (std::size_t k = settle_rows; k < segments[s].size(); ++k, ++at) {
      const RecordRow& row = (*segments[s].rows)[segments[s].first + k];
      const double x_pct = motion[s][k].x_pct;
      result(at, 0) = row.x_measured ? x_pct - row.x_pct : 0.0;
      if (has_flow) {
        result(at, 1) =
            row.flow_measured
                ? FlowReading(parameters, {}, row.input, x_pct) - row.flow
                : 0.0;
      }
    }
  }
  return result;
}

// A factor of `factor` either side of the nominal value, within [least, most].
ValveUnknown Unknown(const char* name, double& (*in)(ValveParameters&),
                     ValveParameters nominal, double factor, double least,
                     double most) {
  const double value = in(nominal);
  const double centre = std::clamp(value, least, most);
  return {name,
          in,
          value,
          std::max(least, centre / factor),
          std::min(most, centre * factor),
          false};
}

// Sums for the weighted straight line y = a - n x.
struct LineSums {
  double w{0.0};
  double x{0.0};
  double y{0.0};
  double xx{0.0};
  double xy{0.0};
  int rows{0};

  void Add(double weight, double at, double value) {
    w += weight;
    x += weight * at;
    y += weight * value;
    xx += weight * at * at;
    xy += weight * at * value;
    ++rows;
  }
};

// Kv f(X) of a row [m3/h]; 0 if not usable.
double EffectiveKv(const RecordRow& row, const ValveParameters& valve) {
  const Instrumentation& i = valve.instruments;
  // A saturated transmitter gives only a bound of the flow.
  const double margin = 0.01 * (i.flow.high - i.flow.low);
  if (row.flow < i.flow.low + margin || row.flow > i.flow.high - margin) {
    return 0.0;
  }
  const MediumState medium =
      MediumAt(valve.medium, 1e3 * row.input.p1_kpa, 1e3 * row.input.p2_kpa,
               row.input.t1_degc);
  return CapacityFor(FlowFromUnit(i.flow_unit, row.flow, medium.density_kg_m3),
                     valve.trim, medium, 0.01 * row.x_pct);
}

// About the middle of its travel a linear trim has the slope of an exponent of
// 2, one of equal percentage and large rangeability that of 5.
constexpr double kExponentFactor = 8.0;

bool IsElectric(const ValveParameters& valve) {
  return valve.actuator.drive == ActuatorDrive::kElectric;
}

// The unknowns of `nominal` with its air relay, best determined first: Kv and
// exponent (only with flow), coefficients of the air relay, filter time of the
// positioner; then the stated ones: gain of the positioner, play, supply
// pressure. An electric actuator has its stroke time, then its dead band.
std::vector<ValveUnknown> UnknownsOf(const ValveParameters& nominal,
                                     bool has_flow) {
  // The order counts: KeepIdentified() gives up the last ones first.
  using V = ValveParameters;
  std::vector<ValveUnknown> unknowns;
  const auto add = [&](const char* name, double& (*in)(V&), double factor,
                       double least, double most) {
    unknowns.push_back(Unknown(name, in, nominal, factor, least, most));
  };
  if (has_flow) {
    add(
        "trim.kv_m3_h", [](V& v) -> double& { return v.trim.kv_m3_h; }, 4.0,
        1e-5, 1e6);
    if (nominal.trim.characteristic == FlowCharacteristic::kExponential) {
      add(
          "trim.exponent", [](V& v) -> double& { return v.trim.exponent; },
          kExponentFactor, 0.1, 20.0);
    }
  }
  if (IsElectric(nominal)) {
    add(
        "actuator.stroke_time_s",
        [](V& v) -> double& { return v.actuator.stroke_time_s; }, 5.0, 0.5,
        600.0);
  } else if (nominal.positioner.relay == AirRelay::kOrifice) {
    add(
        "positioner.orifice_coefficient",
        [](V& v) -> double& { return v.positioner.orifice_coefficient; }, 5.0,
        1e-9, 1e-3);
  } else {
    add(
        "positioner.filling_cv",
        [](V& v) -> double& { return v.positioner.filling_cv; }, 5.0, 1e-6,
        1.0);
    add(
        "positioner.venting_cv",
        [](V& v) -> double& { return v.positioner.venting_cv; }, 5.0, 1e-6,
        1.0);
  }
  add(
      "positioner.filter_time_s",
      [](V& v) -> double& { return v.positioner.filter_time_s; }, 5.0, 1e-2,
      100.0);
  const std::size_t first_stated = unknowns.size();
  if (IsElectric(nominal)) {
    add(
        "actuator.dead_band",
        [](V& v) -> double& { return v.actuator.dead_band; }, 5.0, 1e-3, 0.2);
  } else {
    add(
        "positioner.gain", [](V& v) -> double& { return v.positioner.gain; },
        5.0, 0.1, 1e4);
  }
  add(
      "actuator.play_fraction",
      [](V& v) -> double& { return v.actuator.play_fraction; }, 5.0, 2e-3, 0.2);
  if (!IsElectric(nominal)) {
    add(
        "actuator.supply_pressure_gauge_pa",
        [](V& v) -> double& { return v.actuator.supply_pressure_gauge_pa; },
        2.0, 1.3e5, 2e6);
  }
  for (std::size_t i = first_stated; i < unknowns.size(); ++i) {
    unknowns[i].stated = true;
  }
  return unknowns;
}

// Coulomb friction. Where the nominal valve has none, it is searched between
// 0.5 and 50 % of what the spring changes over the stroke.
ValveUnknown FrictionUnknown(const ValveParameters& nominal) {
  const auto in = [](ValveParameters& v) -> double& {
    return v.actuator.coulomb_friction_n;
  };
  if (nominal.actuator.coulomb_friction_n > 0.0) {
    return Unknown(kFriction, in, nominal, 5.0, 1e-3, 1e5);
  }
  const double range_n =
      nominal.actuator.spring_rate_n_m * nominal.actuator.stroke_m;
  return {kFriction, in, 0.0, 0.005 * range_n, 0.5 * range_n, false};
}

// With the other air relay: of (16), and of the benchmark's square root with
// the transducer's dead zone.
ValveParameters OtherRelay(ValveParameters nominal) {
  const bool orifice = nominal.positioner.relay == AirRelay::kOrifice;
  nominal.positioner.relay =
      orifice ? AirRelay::kCompressible : AirRelay::kOrifice;
  nominal.positioner.transducer_dead_zone = !orifice;
  return nominal;
}

// Bounds of `unknowns` as logarithms, with a prior around the nominal values
// whose deviation is a factor of 1.65.
PointBounds BoundsOf(const std::vector<ValveUnknown>& unknowns) {
  constexpr double kPriorSd = 0.5;
  const auto count = static_cast<Eigen::Index>(unknowns.size());
  PointBounds bounds{Eigen::VectorXd(count), Eigen::VectorXd(count),
                     Eigen::VectorXd(count),
                     Eigen::VectorXd::Constant(count, kPriorSd)};
  for (Eigen::Index i = 0; i < count; ++i) {
    const ValveUnknown& unknown = unknowns[static_cast<std::size_t>(i)];
    bounds.lower[i] = std::log(unknown.lower);
    bounds.upper[i] = std::log(unknown.upper);
    bounds.prior_mean[i] =
        unknown.nominal > 0.0
            ? std::log(
                  std::clamp(unknown.nominal, unknown.lower, unknown.upper))
            : 0.5 * (bounds.lower[i] + bounds.upper[i]);
  }
  return bounds;
}

// `parameters` with the unknowns set to exp(point).
ValveParameters WithUnknowns(ValveParameters parameters,
                             const std::vector<ValveUnknown>& unknowns,
                             const Eigen::VectorXd& point) {
  for (std::size_t i = 0; i < unknowns.size(); ++i) {
    unknowns[i].in(parameters) = std::exp(point[static_cast<Eigen::Index>(i)]);
  }
  return parameters;
}

constexpr std::ptrdiff_t kMinTrimRows = 30;

// Enough rows have both readings. Otherwise a substitute of X has to do: the
// command of a valve without a position transmitter, and the line between two
// readings where tags are stored at different times.
bool HasPosition(const std::vector<HealthyRecord>& records) {
  std::ptrdiff_t both = 0;
  for (const HealthyRecord& record : records) {
    both += std::ranges::count_if(record.rows, [](const RecordRow& row) {
      return row.x_measured && row.flow_measured;
    });
  }
  return both >= kMinTrimRows;
}

bool IsUsable(const RecordRow& row, bool has_position) {
  return row.flow_measured && (row.x_measured || !has_position);
}

// Beyond it, the shut-off part of the trim may begin.
double ShuttingOff(const Trim& trim) {
  return std::min(0.97, trim.shut_off);
}

}  // namespace

double SizeOf(const std::vector<HealthyRecord>& records,
              const ValveParameters& valve) {
  const bool has_position = HasPosition(records);
  std::vector<double> ratios;
  for (const HealthyRecord& record : records) {
    for (const RecordRow& row : record.rows) {
      const InputRow& in = row.input;
      const double expected = FlowOf(
          valve, {},
          {0.01 * in.cv_pct, 1e3 * in.p1_kpa, 1e3 * in.p2_kpa, in.t1_degc},
          0.01 * row.x_pct, 0.0);
      if (IsUsable(row, has_position) && row.flow > 0.0 && expected > 0.0 &&
          row.x_pct < 100.0 * ShuttingOff(valve.trim)) {
        ratios.push_back(row.flow / expected);
      }
    }
  }
  if (std::ssize(ratios) < kMinTrimRows) {
    return 1.0;
  }
  const auto middle =
      ratios.begin() + static_cast<std::ptrdiff_t>(ratios.size() / 2);
  std::nth_element(ratios.begin(), middle, ratios.end());
  return *middle;
}

ValveParameters Resized(ValveParameters valve, double size,
                        double largest_flow) {
  constexpr double kLeastUse = 0.1;  // Share of a range.
  constexpr double kUse = 0.8;
  valve.trim.kv_m3_h *= size;
  valve.trim.bypass_kv_m3_h *= size;
  Transmitter& flow = valve.instruments.flow;
  const double high = size * flow.high;
  const bool fits = largest_flow <= high && largest_flow >= kLeastUse * high;
  const double range = fits ? size : largest_flow / kUse / flow.high;
  for (double* value : {&flow.low, &flow.high, &flow.noise_sd}) {
    *value *= range;
  }
  return valve;
}

HealthyRecord WithSimulatedRod(const std::vector<RecordRow>& rows,
                               std::size_t first, std::size_t last,
                               const ValveParameters& valve,
                               const RecordDrive& drive) {
  const std::vector<RecordAnswer> answers =
      SimulateRecord(valve, rows, first, last, drive);
  HealthyRecord record;
  for (std::size_t k = first; k < last; ++k) {
    record.rows.push_back(rows[k]);
    record.rows.back().x_pct = answers[k - first].x_pct;
  }
  return record;
}

Trim RegressTrim(const std::vector<HealthyRecord>& records,
                 const ValveParameters& nominal) {
  Trim trim = nominal.trim;
  const bool exponential =
      trim.characteristic == FlowCharacteristic::kExponential;
  // Noise of F with the deviation sd is noise of ln F with sd / F, hence the
  // weights F^2. For f = exp(-n X), y = ln(Kv f) is a straight line. With means
  // so weighted,
  //
  //   n = (mean(X) mean(y) - mean(X y)) / var(X),
  //   ln Kv = mean(y) + n mean(X).
  //
  // For a characteristic without n, y = ln(Kv f) - ln f(X) and n = 0.
  LineSums sums;
  const bool has_position = HasPosition(records);
  for (const HealthyRecord& record : records) {
    for (const RecordRow& row : record.rows) {
      const double kv =
          IsUsable(row, has_position) ? EffectiveKv(row, nominal) : 0.0;
      const double x = 0.01 * row.x_pct;
      if (kv > 0.0 && x < ShuttingOff(trim)) {
        const double shape = exponential ? 0.0 : std::log(Opening(trim, x));
        sums.Add(row.flow * row.flow, x, std::log(kv) - shape);
      }
    }
  }
  if (sums.rows < kMinTrimRows) {
    return trim;
  }
  const double x_mean = sums.x / sums.w;
  const double x_variance = sums.xx / sums.w - x_mean * x_mean;
  constexpr double kMinSpread = 0.02;  // Standard deviation of X.
  if (exponential && x_variance > kMinSpread * kMinSpread) {
    const double n =
        -(sums.xy / sums.w - x_mean * sums.y / sums.w) / x_variance;
    trim.exponent = std::clamp(n, trim.exponent / kExponentFactor,
                               kExponentFactor * trim.exponent);
  }
  const double slope = exponential ? trim.exponent : 0.0;
  trim.kv_m3_h = std::exp(sums.y / sums.w + slope * x_mean);
  return trim;
}

namespace {

using Eigen::Index;
using Eigen::VectorXd;

// With this corner a fit to normal residuals has 95 % of the efficiency of
// least squares.
constexpr double kHuber = 1.345;   // Corner of the loss.
constexpr double kAtBound = 1e-3;  // Near a bound, in the logarithm.
constexpr int kMaxIterations = 10;

// The transmitter's noise, or at least its resolution.
double MinScale(const Transmitter& transmitter) {
  return std::max(transmitter.noise_sd,
                  1e-5 * (transmitter.high - transmitter.low));
}

std::vector<Index> AllOf(const std::vector<ValveUnknown>& unknowns) {
  std::vector<Index> all(unknowns.size());
  std::iota(all.begin(), all.end(), Index{0});
  return all;
}

// Kv and exponent do not affect the rod.
VectorXd WithoutTrim(const std::vector<ValveUnknown>& unknowns,
                     VectorXd point) {
  for (std::size_t i = 0; i < unknowns.size(); ++i) {
    if (unknowns[i].name.starts_with("trim.")) {
      point[static_cast<Index>(i)] = 0.0;
    }
  }
  return point;
}

FittedParameter Rejected(const ValveUnknown& u, double sd) {
  return {u.name, u.nominal, u.nominal, u.lower, u.upper, sd, false};
}

void RequireUsable(const std::vector<HealthyRecord>& records,
                   const ValveFitOptions& options) {
  RequireRange("period_s", options.period_s, 1e-3, 3600.0);
  RequireRange("threads", options.threads, 1, 256);
  RequireRange("max_rows", options.max_rows, 180, 1e7);
  RequireRange("settle_rows", options.settle_rows, 0, 120);
  RequirePositive("identified_sd", options.identified_sd);
  for (std::size_t r = 0; r < records.size(); ++r) {
    const std::vector<RecordRow>& rows = records[r].rows;
    for (std::size_t k = 0; k < rows.size(); ++k) {
      const InputRow& in = rows[k].input;
      // One test for all: no sum with a NaN or an infinity is finite.
      double sum = in.cv_pct + in.p1_kpa + in.p2_kpa + in.t1_degc;
      sum += rows[k].x_pct + (options.has_flow ? rows[k].flow : 0.0);
      if (!std::isfinite(sum)) {
        throw DataError("healthy record " + std::to_string(r) + ", row " +
                        std::to_string(k) + ": expected finite values");
      }
    }
  }
}

// One choice of air relay and drive, with its fitted unknowns.
struct Hypothesis {
  ValveCandidate base;  // With the nominal values of all unknowns.
  std::vector<ValveUnknown> unknowns;
  VectorXd point;
  RobustFit fit;
  std::vector<FittedParameter> rejected;
  std::optional<double> error{};  // Error of Best(), once it is fitted there.
};

// Bounds of a fit, and of its cost.
struct FitEffort {
  int iterations;
  double tolerance_scale;
  int threads;
  double damping{RobustFitOptions{}.damping};  // Where another fit ended.
};

// A parameter at a bound of its search compensates for something missing in the
// model, and whether it lowers the loss enough then depends on the last digit
// of the readings.
bool Inside(const ValveUnknown& unknown, double point) {
  return point > std::log(unknown.lower) + kAtBound &&
         point < std::log(unknown.upper) - kAtBound;
}

bool HasFriction(const Hypothesis& hypothesis) {
  return std::ranges::find(hypothesis.unknowns, kFriction,
                           &ValveUnknown::name) != hypothesis.unknowns.end();
}

bool FrictionInside(const Hypothesis& hypothesis) {
  const auto& unknowns = hypothesis.unknowns;
  const auto at = std::ranges::find(unknowns, kFriction, &ValveUnknown::name);
  return at != unknowns.end() &&
         Inside(*at, hypothesis.point[at - unknowns.begin()]);
}

class Identification {
 public:
  Identification(const std::vector<HealthyRecord>& records,
                 const ValveParameters& nominal, const ValveFitOptions& options)
      : records_(records), nominal_(nominal), options_(options) {
    segments_ =
        LiveliestSegments(records, static_cast<std::size_t>(options.max_rows));
    if (segments_.empty()) {
      throw DataError("healthy records: expected one of at least 180 rows");
    }
  }

  ValveFit Run();

 private:
  std::vector<ValveUnknown> Unknowns(const ValveParameters& base,
                                     bool stated) const;
  Trim StartTrim(const ValveParameters& variant,
                 const RecordDrive& drive) const;
  Hypothesis Start(const ValveParameters& variant, const RecordDrive& drive,
                   bool friction) const;
  Hypothesis BestStart() const;
  Hypothesis BestRelay(const Hypothesis& fitted) const;
  std::optional<Hypothesis> WithFriction(const Hypothesis& without) const;
  bool Gains(const Hypothesis& trial, const Hypothesis& hypothesis) const;
  RobustFit Fit(const Hypothesis& hypothesis,
                const std::vector<RecordSegment>& segments,
                const FitEffort& effort) const;
  RobustFit FitFinely(const Hypothesis& hypothesis) const {
    return Fit(hypothesis, segments_,
               {kMaxIterations, kFine, options_.threads});
  }
  void FitBriefly(std::vector<Hypothesis>& hypotheses) const;
  Hypothesis Best(std::vector<Hypothesis> hypotheses) const;
  void KeepIdentified(Hypothesis& hypothesis) const;
  void AddStated(Hypothesis& hypothesis) const;
  void Refine(Hypothesis& hypothesis) const {
    KeepIdentified(hypothesis);
    AddStated(hypothesis);
  }
  std::vector<RecordFit> Compare(
      const std::vector<ValveCandidate>& candidates) const;
  ValveCandidate Candidate(const Hypothesis& h, const VectorXd& point) const {
    return {WithUnknowns(h.base.parameters, h.unknowns, point), h.base.drive};
  }

  const std::vector<HealthyRecord>& records_;
  const ValveParameters& nominal_;
  const ValveFitOptions& options_;
  std::vector<RecordSegment> segments_;
};

std::vector<ValveUnknown> Identification::Unknowns(const ValveParameters& base,
                                                   bool stated) const {
  std::vector<ValveUnknown> unknowns = UnknownsOf(base, options_.has_flow);
  std::erase_if(unknowns,
                [&](const ValveUnknown& u) { return u.stated != stated; });
  return unknowns;
}

// Without a position, over where the rod would be. In rows in which it comes to
// rest, that is where the command is, and all of the record tells.
Trim Identification::StartTrim(const ValveParameters& variant,
                               const RecordDrive& drive) const {
  const bool rests =
      SimulatedPeriod(options_.period_s, nominal_) < options_.period_s;
  if (HasPosition(records_) || rests) {
    return RegressTrim(records_, nominal_);
  }
  const RecordSegment& liveliest = segments_.front();
  return RegressTrim({WithSimulatedRod(*liveliest.rows, liveliest.first,
                                       liveliest.last, variant, drive)},
                     nominal_);
}

Hypothesis Identification::Start(const ValveParameters& variant,
                                 const RecordDrive& drive,
                                 bool friction) const {
  ValveParameters start = variant;
  if (options_.has_flow) {
    start.trim = StartTrim(variant, drive);
  }
  Hypothesis h{
      {variant, drive}, Unknowns(variant, /*stated=*/false), {}, {}, {}};
  // Kv is that of the open valve, to which a record is extrapolated: if two
  // valves pass the same where the record is, the one with the smaller
  // slope has the smaller Kv. Its search reaches as far about that value.
  for (ValveUnknown& u : h.unknowns) {
    if (u.name == "trim.kv_m3_h") {
      const double slope =
          start.trim.kv_m3_h / (u.nominal * SizeOf(records_, nominal_));
      u.lower *= std::min(1.0, slope);
      u.upper *= std::max(1.0, slope);
    }
  }
  if (friction) {
    h.unknowns.push_back(FrictionUnknown(variant));
  }
  h.point = BoundsOf(h.unknowns).prior_mean;
  for (std::size_t i = 0; i < h.unknowns.size(); ++i) {
    const double value = h.unknowns[i].in(start);
    if (value > 0.0) {
      h.point[static_cast<Index>(i)] = std::log(value);
    }
  }
  return h;
}

// Chooses first how and when the command acts, then the relay, unless a motor
// takes the place of air and friction. If fits are
// equally good, keeps the first: the nominal relay, a held command without
// delay. That takes 8 + 1 fits, all combinations would take 16.
Hypothesis Identification::BestStart() const {
  const bool friction =
      nominal_.actuator.coulomb_friction_n > 0.0 && !IsElectric(nominal_);
  std::vector<Hypothesis> drives;
  for (const int delay : {0, -1, 1, 2}) {
    for (const bool interpolated : {false, true}) {
      drives.push_back(
          Start(nominal_, {options_.period_s, interpolated, delay}, friction));
    }
  }
  return BestRelay(Best(std::move(drives)));
}

// @param fitted by Best(), with the nominal relay.
Hypothesis Identification::BestRelay(const Hypothesis& fitted) const {
  if (IsElectric(nominal_)) {
    return fitted;
  }
  return Best({fitted, Start(OtherRelay(nominal_), fitted.base.drive,
                             HasFriction(fitted))});
}

// The best start with friction, if it follows X better than the one without.
// Friction delays the rod, so that without it a later command may have been
// found: the delay is chosen again, from this and the one before.
std::optional<Hypothesis> Identification::WithFriction(
    const Hypothesis& without) const {
  if (IsElectric(nominal_)) {
    return std::nullopt;
  }
  const int latest = without.base.drive.command_delay;
  std::vector<Hypothesis> rods{without};
  rods.front().error.reset();  // Is fitted once more, as the others are.
  rods.front().fit = {};
  for (const int delay : {latest, std::max(-1, latest - 1)}) {
    for (const bool interpolated : {false, true}) {
      rods.push_back(
          Start(nominal_, {options_.period_s, interpolated, delay}, true));
    }
  }
  const Hypothesis best = Best(std::move(rods));
  return HasFriction(best) ? std::optional(BestRelay(best)) : std::nullopt;
}

RobustFit Identification::Fit(const Hypothesis& hypothesis,
                              const std::vector<RecordSegment>& segments,
                              const FitEffort& effort) const {
  // Points that differ only in the trim share a simulation, so that derivatives
  // for Kv and the exponent cost none. The last single point is the present one
  // of the fit, because Minimiser takes derivatives only where its last trial
  // was accepted.
  std::vector<VectorXd> simulated;
  std::vector<Answers> motions;
  const auto residuals = [&](const std::vector<VectorXd>& points) {
    std::vector<VectorXd> wanted;
    std::vector<ValveCandidate> candidates;
    for (const VectorXd& point : points) {
      const VectorXd key = WithoutTrim(hypothesis.unknowns, point);
      if (std::ranges::find(simulated, key) == simulated.end()) {
        wanted.push_back(key);
        candidates.push_back(Candidate(hypothesis, point));
      }
    }
    std::vector<Answers> added =
        Simulate(candidates, segments, effort.tolerance_scale, effort.threads);
    if (points.size() == 1 && !added.empty()) {
      simulated.clear();
      motions.clear();
    }
    simulated.insert(simulated.end(), wanted.begin(), wanted.end());
    std::ranges::move(added, std::back_inserter(motions));
    std::vector<MatrixXd> result;
    for (const VectorXd& point : points) {
      const auto at =
          std::ranges::find(simulated, WithoutTrim(hypothesis.unknowns, point));
      result.push_back(Residuals(
          Candidate(hypothesis, point).parameters,
          motions[static_cast<std::size_t>(at - simulated.begin())], segments,
          static_cast<std::size_t>(options_.settle_rows), options_.has_flow));
    }
    return result;
  };
  RobustFitOptions options;
  options.max_iterations = effort.iterations;
  options.damping = effort.damping;
  options.huber = kHuber;
  const Instrumentation& i = nominal_.instruments;
  options.least_scale.resize(options_.has_flow ? 2 : 1);
  options.least_scale[0] = MinScale(i.position);
  if (options_.has_flow) {
    options.least_scale[1] = MinScale(i.flow);
  }
  return FitRobustly(residuals, hypothesis.point, BoundsOf(hypothesis.unknowns),
                     options);
}

// Fits those that are not yet fitted to the liveliest segment. One whose X (F
// where there is no X) is off by twice as much as that of another after the
// first iteration is given up: none of the three that are left makes up for a
// wrong delay, which puts X off by three times as much.
void Identification::FitBriefly(std::vector<Hypothesis>& hypotheses) const {
  constexpr int kIterations = 4;
  constexpr double kHopeless = 2.0;
  std::vector<Hypothesis*> open;
  for (Hypothesis& h : hypotheses) {
    if (!h.error) {
      open.push_back(&h);
    }
  }
  // Each is one thread's as far as there are enough of them: with a single
  // segment, most simulations of a fit come one after the other.
  const auto fit = [&](int iterations) {
    const int threads = std::max(
        1, options_.threads /
               static_cast<int>(std::max(open.size(), std::size_t{1})));
    ParallelFor(static_cast<int>(open.size()), options_.threads, [&](int i) {
      Hypothesis& h = *open[static_cast<std::size_t>(i)];
      h.fit = Fit(h, {segments_.front()},
                  {iterations, kCoarse, threads, h.fit.damping});
      h.point = h.fit.point;
    });
  };
  fit(1);
  const auto error = [&](const Hypothesis* h) {
    return HasPosition(records_) ? h->fit.residuals.col(0).norm()
                                 : h->fit.residuals.norm();
  };
  double least = std::numeric_limits<double>::infinity();
  for (const Hypothesis* h : open) {
    least = std::min(least, error(h));
  }
  for (Hypothesis* h : open) {
    if (error(h) > kHopeless * least) {
      h->error = std::numeric_limits<double>::infinity();
    }
  }
  std::erase_if(open, [](const Hypothesis* h) {
    return h->error.has_value() || h->fit.settled;
  });
  fit(kIterations - 1);
}

// Fits each briefly, and compares X on all segments; F where there is no X.
Hypothesis Identification::Best(std::vector<Hypothesis> hypotheses) const {
  FitBriefly(hypotheses);
  std::vector<Hypothesis*> fitted;
  std::vector<ValveCandidate> candidates;
  for (Hypothesis& h : hypotheses) {
    if (!h.error) {
      fitted.push_back(&h);
      candidates.push_back(Candidate(h, h.point));
    }
  }
  const std::vector<Answers> motions =
      Simulate(candidates, segments_, kCoarse, options_.threads);
  const bool by_flow = !HasPosition(records_);
  for (std::size_t i = 0; i < motions.size(); ++i) {
    fitted[i]->error =
        Residuals(candidates[i].parameters, motions[i], segments_,
                  static_cast<std::size_t>(options_.settle_rows), by_flow)
            .norm();
  }
  std::size_t best = 0;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < hypotheses.size(); ++i) {
    // A lag of the valve resembles a delay of part of a sample, and so does
    // friction.
    const bool alike =
        hypotheses[i].base.drive.command_delay ==
            hypotheses[best].base.drive.command_delay &&
        HasFriction(hypotheses[i]) == HasFriction(hypotheses[best]);
    if (*hypotheses[i].error < (alike ? 0.99 : 0.9) * least) {
      least = *hypotheses[i].error;
      best = i;
    }
  }
  return hypotheses[best];
}

// Fits; resets parameters that the records do not determine to nominal, the
// last of the list first, and fits the others again. F tells a lag less closely
// than X does. Without X, one that is surely not the nominal one is kept all
// the same, because F would be further off with that.
void Identification::KeepIdentified(Hypothesis& hypothesis) const {
  constexpr double kSurely = 3.0;  // deviations
  const bool has_position = HasPosition(records_);
  for (bool changed = true; changed && !hypothesis.unknowns.empty();) {
    hypothesis.fit = FitFinely(hypothesis);
    hypothesis.point = hypothesis.fit.point;
    const PointBounds bounds = BoundsOf(hypothesis.unknowns);
    std::vector<Index> kept = AllOf(hypothesis.unknowns);
    changed = false;
    // Downwards, so that i is the place in `kept` as well: only later ones have
    // been erased. Each is judged with those that are left.
    for (std::size_t i = kept.size(); i-- > 0;) {
      const double sd = StandardDeviations(hypothesis.fit, bounds,
                                           kept)[static_cast<Index>(i)];
      const ValveUnknown& unknown = hypothesis.unknowns[i];
      const double value = hypothesis.point[static_cast<Index>(i)];
      const bool is_nominal =
          has_position || unknown.nominal <= 0.0 || !Inside(unknown, value) ||
          std::abs(value - std::log(unknown.nominal)) < kSurely * sd;
      if (sd > options_.identified_sd && is_nominal) {
        hypothesis.rejected.push_back(Rejected(hypothesis.unknowns[i], sd));
        const auto at = static_cast<std::ptrdiff_t>(i);
        kept.erase(kept.begin() + at);
        hypothesis.unknowns.erase(hypothesis.unknowns.begin() + at);
        changed = true;
      }
    }
    hypothesis.point = VectorXd(hypothesis.point(kept));
  }
}

// One scale for both losses. Each with its own, they would hardly differ,
// because the scale follows the size of the residuals.
bool Identification::Gains(const Hypothesis& trial,
                           const Hypothesis& hypothesis) const {
  const VectorXd& scale = trial.fit.scale;
  return MeanHuberLoss(trial.fit.residuals, scale, kHuber) <
         (1.0 - options_.least_gain) *
             MeanHuberLoss(hypothesis.fit.residuals, scale, kHuber);
}

// Tries each stated parameter in addition to those kept.
void Identification::AddStated(Hypothesis& hypothesis) const {
  for (const ValveUnknown& unknown :
       Unknowns(hypothesis.base.parameters, /*stated=*/true)) {
    Hypothesis trial = hypothesis;
    trial.unknowns.push_back(unknown);
    trial.point.conservativeResize(trial.point.size() + 1);
    trial.point.tail<1>() = BoundsOf({unknown}).prior_mean;
    trial.fit = FitFinely(trial);
    trial.point = trial.fit.point;
    const double sd =
        StandardDeviations(trial.fit, BoundsOf(trial.unknowns),
                           AllOf(trial.unknowns))[trial.point.size() - 1];
    if (sd <= options_.identified_sd &&
        Inside(unknown, trial.point[trial.point.size() - 1]) &&
        Gains(trial, hypothesis)) {
      hypothesis = std::move(trial);
    } else {
      hypothesis.rejected.push_back(Rejected(unknown, sd));
    }
  }
}

std::vector<RecordFit> Identification::Compare(
    const std::vector<ValveCandidate>& candidates) const {
  std::vector<RecordSegment> whole;
  for (const HealthyRecord& record : records_) {
    if (record.rows.size() > static_cast<std::size_t>(options_.settle_rows)) {
      whole.push_back({&record.rows, 0, record.rows.size()});
    }
  }
  // Filled-in rows have a difference of 0.
  const auto count = [&](Index j) {
    double measured = 0.0;
    for (const RecordSegment& segment : whole) {
      measured += static_cast<double>(
          std::count_if(segment.rows->begin() + options_.settle_rows,
                        segment.rows->end(), [j](const RecordRow& row) {
                          return j == 0 ? row.x_measured : row.flow_measured;
                        }));
    }
    return std::max(1.0, measured);
  };
  const std::vector<Answers> motions =
      Simulate(candidates, whole, kCoarse, options_.threads);
  std::vector<RecordFit> fits(candidates.size());
  for (std::size_t i = 0; i < fits.size(); ++i) {
    const MatrixXd r = Residuals(candidates[i].parameters, motions[i], whole,
                                 static_cast<std::size_t>(options_.settle_rows),
                                 options_.has_flow);
    const auto rmse = [&](Index j) {
      return r.col(j).norm() / std::sqrt(count(j));
    };
    fits[i].x_rmse_pct = rmse(0);
    fits[i].x_bias_pct = r.col(0).sum() / count(0);
    if (options_.has_flow) {
      fits[i].flow_rmse = rmse(1);
      fits[i].flow_bias = r.col(1).sum() / count(1);
    }
  }
  return fits;
}

ValveFit Identification::Run() {
  Hypothesis best = BestStart();
  std::optional<Hypothesis> rough = WithFriction(best);
  Refine(best);
  if (rough) {
    // Compared only now, because play that has been fitted acts like friction.
    Refine(*rough);
    if (FrictionInside(*rough) && Gains(*rough, best)) {
      best = *std::move(rough);
    }
  }
  const ValveCandidate candidate = Candidate(best, best.point);
  const VectorXd sd = StandardDeviations(best.fit, BoundsOf(best.unknowns),
                                         AllOf(best.unknowns));
  ValveFit result;
  for (std::size_t i = 0; i < best.unknowns.size(); ++i) {
    const ValveUnknown& u = best.unknowns[i];
    const auto at = static_cast<Index>(i);
    result.values.push_back({u.name, std::exp(best.point[at]), u.nominal,
                             u.lower, u.upper, sd[at], true});
  }
  result.values.insert(result.values.end(), best.rejected.begin(),
                       best.rejected.end());
  result.parameters = candidate.parameters;
  result.interpolated_command = candidate.drive.interpolated_command;
  result.command_delay = candidate.drive.command_delay;
  const std::vector<RecordFit> fits =
      Compare({candidate, {nominal_, candidate.drive}});
  result.fitted = fits[0];
  result.nominal = fits[1];
  return result;
}

}  // namespace

ValveFit FitValve(const std::vector<HealthyRecord>& records,
                  const ValveParameters& nominal,
                  const ValveFitOptions& options) {
  Validate(nominal);
  RequireUsable(records, options);
  return Identification(records, nominal, options).Run();
}

}  // namespace fdi::simulator
