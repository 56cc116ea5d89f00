#include "simulator/valve_identification.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "diagnosis/error.h"
#include "simulator/require_range.h"
#include "simulator/robust_least_squares.h"
#include "simulator/valve_unknowns.h"

namespace fdi::simulator {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr double kHuber = 1.345;  // Corner of the loss.
constexpr int kMostIterations = 10;

// The noise of a transmitter; one without noise still reads in steps.
double LeastScale(const Transmitter& transmitter) {
  return std::max(transmitter.noise_sd,
                  1e-5 * (transmitter.high - transmitter.low));
}

std::vector<Index> AllOf(const std::vector<ValveUnknown>& unknowns) {
  std::vector<Index> all(unknowns.size());
  std::iota(all.begin(), all.end(), Index{0});
  return all;
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
      double sum = in.cv_pct + in.p1_kpa + in.p2_kpa + in.t1_degc;
      sum += rows[k].x_pct + (options.has_flow ? rows[k].flow : 0.0);
      if (!std::isfinite(sum)) {
        throw DataError("healthy record " + std::to_string(r) + ", row " +
                        std::to_string(k) + ": expected finite values");
      }
    }
  }
}

// One choice of air relay and drive, and what may be fitted in it.
struct Hypothesis {
  ValveCandidate base;  // With the nominal values of all unknowns.
  std::vector<ValveUnknown> unknowns;
  VectorXd point;
  RobustFit fit;
};

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
  std::vector<Hypothesis> Hypotheses() const;
  RobustFit Fit(const Hypothesis& hypothesis,
                const std::vector<RecordSegment>& segments,
                int iterations) const;
  Hypothesis Best(std::vector<Hypothesis> hypotheses) const;
  void KeepIdentified(Hypothesis& hypothesis,
                      std::vector<FittedParameter>& rejected) const;
  void AddStated(Hypothesis& hypothesis,
                 std::vector<FittedParameter>& rejected) const;
  RecordFit Compare(const ValveCandidate& candidate) const;
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

// The nominal relay with the command held comes first: it wins a draw.
std::vector<Hypothesis> Identification::Hypotheses() const {
  std::vector<Hypothesis> hypotheses;
  for (const ValveParameters& variant : RelayVariants(nominal_)) {
    ValveParameters start = variant;
    if (options_.has_flow) {
      start.trim = RegressTrim(records_, nominal_);
    }
    for (const bool interpolated : {false, true}) {
      Hypothesis h{{variant, {options_.period_s, interpolated}},
                   Unknowns(variant, /*stated=*/false),
                   {},
                   {}};
      h.point = BoundsOf(h.unknowns).prior_mean;
      for (std::size_t i = 0; i < h.unknowns.size(); ++i) {
        const double value = h.unknowns[i].in(start);
        if (value > 0.0) {
          h.point[static_cast<Index>(i)] = std::log(value);
        }
      }
      hypotheses.push_back(std::move(h));
    }
  }
  return hypotheses;
}

RobustFit Identification::Fit(const Hypothesis& hypothesis,
                              const std::vector<RecordSegment>& segments,
                              int iterations) const {
  const auto residuals = [&](const std::vector<VectorXd>& points) {
    std::vector<ValveCandidate> candidates;
    for (const VectorXd& point : points) {
      candidates.push_back(Candidate(hypothesis, point));
    }
    return SegmentResiduals(candidates, segments,
                            static_cast<std::size_t>(options_.settle_rows),
                            options_.has_flow, options_.threads);
  };
  RobustFitOptions options;
  options.max_iterations = iterations;
  options.huber = kHuber;
  const InstrumentParameters& i = nominal_.instruments;
  options.least_scale.resize(options_.has_flow ? 2 : 1);
  options.least_scale[0] = LeastScale(i.position);
  if (options_.has_flow) {
    options.least_scale[1] = LeastScale(i.flow);
  }
  return FitRobustly(residuals, hypothesis.point, BoundsOf(hypothesis.unknowns),
                     options);
}

// A short fit of each to the liveliest segment, judged by X on all of them.
Hypothesis Identification::Best(std::vector<Hypothesis> hypotheses) const {
  constexpr int kIterations = 4;
  std::vector<ValveCandidate> candidates;
  for (Hypothesis& h : hypotheses) {
    h.point = Fit(h, {segments_.front()}, kIterations).point;
    candidates.push_back(Candidate(h, h.point));
  }
  const auto residuals = SegmentResiduals(
      candidates, segments_, static_cast<std::size_t>(options_.settle_rows),
      options_.has_flow, options_.threads);
  std::size_t best = 0;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < residuals.size(); ++i) {
    const double loss = residuals[i].col(0).norm();
    constexpr double kClearly = 0.99;
    if (loss < kClearly * least) {
      least = loss;
      best = i;
    }
  }
  return hypotheses[best];
}

// Fits; puts what the records leave open back to nominal, the last of the list
// first, and fits the others again.
void Identification::KeepIdentified(
    Hypothesis& hypothesis, std::vector<FittedParameter>& rejected) const {
  for (bool changed = true; changed && !hypothesis.unknowns.empty();) {
    hypothesis.fit = Fit(hypothesis, segments_, kMostIterations);
    hypothesis.point = hypothesis.fit.point;
    const PointBounds bounds = BoundsOf(hypothesis.unknowns);
    std::vector<Index> kept = AllOf(hypothesis.unknowns);
    changed = false;
    for (std::size_t i = kept.size(); i-- > 0;) {
      const double sd = StandardDeviations(hypothesis.fit, bounds,
                                           kept)[static_cast<Index>(i)];
      if (sd > options_.identified_sd) {
        rejected.push_back(Rejected(hypothesis.unknowns[i], sd));
        const auto at = static_cast<std::ptrdiff_t>(i);
        kept.erase(kept.begin() + at);
        hypothesis.unknowns.erase(hypothesis.unknowns.begin() + at);
        changed = true;
      }
    }
    hypothesis.point = VectorXd(hypothesis.point(kept));
  }
}

// Tries each stated parameter beside those that are kept.
void Identification::AddStated(Hypothesis& hypothesis,
                               std::vector<FittedParameter>& rejected) const {
  for (const ValveUnknown& unknown :
       Unknowns(hypothesis.base.parameters, /*stated=*/true)) {
    Hypothesis trial = hypothesis;
    trial.unknowns.push_back(unknown);
    trial.point.conservativeResize(trial.point.size() + 1);
    trial.point.tail<1>() = BoundsOf({unknown}).prior_mean;
    trial.fit = Fit(trial, segments_, kMostIterations);
    trial.point = trial.fit.point;
    const double sd =
        StandardDeviations(trial.fit, BoundsOf(trial.unknowns),
                           AllOf(trial.unknowns))[trial.point.size() - 1];
    const VectorXd& scale = trial.fit.scale;
    const double before =
        MeanHuberLoss(hypothesis.fit.residuals, scale, kHuber);
    const double after = MeanHuberLoss(trial.fit.residuals, scale, kHuber);
    if (sd <= options_.identified_sd &&
        after < (1.0 - options_.least_gain) * before) {
      hypothesis = std::move(trial);
    } else {
      rejected.push_back(Rejected(unknown, sd));
    }
  }
}

RecordFit Identification::Compare(const ValveCandidate& candidate) const {
  std::vector<RecordSegment> whole;
  for (const HealthyRecord& record : records_) {
    if (record.rows.size() > static_cast<std::size_t>(options_.settle_rows)) {
      whole.push_back({&record.rows, 0, record.rows.size()});
    }
  }
  const Eigen::MatrixXd r =
      SegmentResiduals({candidate}, whole,
                       static_cast<std::size_t>(options_.settle_rows),
                       options_.has_flow, options_.threads)
          .front();
  const auto rmse = [&](Index j) {
    return r.col(j).norm() / std::sqrt(static_cast<double>(r.rows()));
  };
  RecordFit fit;
  fit.x_rmse_pct = rmse(0);
  fit.x_bias_pct = r.col(0).mean();
  if (options_.has_flow) {
    fit.flow_rmse = rmse(1);
    fit.flow_bias = r.col(1).mean();
  }
  return fit;
}

ValveFit Identification::Run() {
  Hypothesis best = Best(Hypotheses());
  std::vector<FittedParameter> rejected;
  KeepIdentified(best, rejected);
  AddStated(best, rejected);
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
  result.values.insert(result.values.end(), rejected.begin(), rejected.end());
  result.parameters = candidate.parameters;
  result.interpolated_command = candidate.drive.interpolated_command;
  result.fitted = Compare(candidate);
  result.nominal = Compare({nominal_, candidate.drive});
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
