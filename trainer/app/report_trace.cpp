#include "trainer/app/report_trace.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

namespace fdi::trainer {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

// What holds in a column: samples of each set isolated, and any detection.
struct ColumnOutcome {
  std::map<std::vector<int>, int> sets;
  bool detected{false};

  // The set that held longest in it; a set is never lost to "none".
  std::vector<int> Set() const {
    const auto most = std::max_element(
        sets.begin(), sets.end(),
        [](const auto& a, const auto& b) { return a.second < b.second; });
    return most == sets.end() ? std::vector<int>{} : most->first;
  }
};

// Appends the column, or widens the last band if it is the same and adjoins.
void Extend(std::vector<TimeBand>& bands, const TimeBand& column) {
  if (!bands.empty() && bands.back().faults == column.faults &&
      std::abs(bands.back().to_s - column.from_s) < 1e-6) {
    bands.back().to_s = column.to_s;
  } else {
    bands.push_back(column);
  }
}

}  // namespace

RunTraceRecorder::RunTraceRecorder(const ModelSet& models, double duration_s)
    : models_(models) {
  const cli::Envelope blank(0.0, duration_s, kTraceColumns);
  trace_.duration_s = duration_s;
  trace_.normal_factor = blank;
  trace_.strength = blank;
  trace_.residuals.assign(models.channels.size(), blank);
  trace_.live_residuals.assign(models.channels.size(), {kInfinity, -kInfinity});
  trace_.fault_factors.assign(models.faults.size(), blank);
  trace_.peak_factors.assign(models.faults.size(), 0.0);
}

void RunTraceRecorder::Add(const Verdict& verdict) {
  if (verdict.intake != Intake::kAccepted) {
    return;
  }
  if (!started_) {
    first_stamp_ns_ = verdict.stamp_ns;
    started_ = true;
  }
  const auto seconds = [&](std::int64_t stamp_ns) {
    return static_cast<double>(stamp_ns - first_stamp_ns_) * 1e-9;
  };
  const double t_s = seconds(verdict.stamp_ns);
  const double last_s = seconds(last_stamp_ns_);
  const bool gap =
      last_stamp_ns_ != 0 && t_s - last_s > 1.5 * models_.sample_period_s;
  last_stamp_ns_ = verdict.stamp_ns;
  const auto add = [&](cli::Envelope& envelope, double value) {
    if (gap) {
      envelope.Add(0.5 * (last_s + t_s), kNaN);
    }
    envelope.Add(t_s, value);
  };
  for (std::size_t c = 0; c < trace_.residuals.size(); ++c) {
    const double residual = verdict.residuals[c];
    add(trace_.residuals[c], residual);
    if (verdict.quality != Quality::kSettling && std::isfinite(residual)) {
      SignalRange& range = trace_.live_residuals[c];
      range.minimum = std::min(range.minimum, residual);
      range.maximum = std::max(range.maximum, residual);
    }
  }
  add(trace_.normal_factor, verdict.normal_factor);
  for (std::size_t f = 0; f < trace_.fault_factors.size(); ++f) {
    add(trace_.fault_factors[f], verdict.fault_factors[f]);
    if (verdict.detected) {
      trace_.peak_factors[f] =
          std::max(trace_.peak_factors[f], verdict.fault_factors[f]);
    }
  }
}

void RunTraceRecorder::AddBands(const std::vector<Indication>& indications) {
  std::vector<ColumnOutcome> columns(kTraceColumns);
  const double per_column = trace_.duration_s / kTraceColumns;
  for (std::size_t k = 0; k < indications.size(); ++k) {
    const Indication& indication = indications[k];
    if (!indication.detected && indication.isolated.empty()) {
      continue;
    }
    // A sample holds until the next one, over all columns between them.
    const double end_s = indication.time_s + models_.sample_period_s;
    const auto first = static_cast<std::size_t>(indication.time_s / per_column);
    const auto last = static_cast<std::size_t>(
        std::max(0.0, std::ceil(end_s / per_column - 1e-9) - 1.0));
    for (std::size_t i = first; i <= last && i < columns.size(); ++i) {
      columns[i].detected = columns[i].detected || indication.detected;
      if (!indication.isolated.empty()) {
        ++columns[i].sets[indication.isolated];
      }
    }
  }
  for (std::size_t i = 0; i < columns.size(); ++i) {
    const double from_s = static_cast<double>(i) * per_column;
    const TimeBand band{from_s, from_s + per_column, {}};
    if (columns[i].detected) {
      Extend(trace_.detected, band);
      Extend(trace_.isolated, {band.from_s, band.to_s, columns[i].Set()});
    }
  }
}

RunTrace RunTraceRecorder::Finish(const std::vector<Indication>& indications) {
  AddBands(indications);
  for (const Indication& indication : indications) {
    trace_.strength.Add(indication.time_s, indication.truth.strength);
    if (indication.truth.fault != 0 && trace_.fault_start_s < 0.0) {
      trace_.fault_start_s = indication.time_s;
    }
  }
  return std::move(trace_);
}

std::vector<std::size_t> FaultsThatMattered(const ModelSet& models,
                                            const RunTrace& trace, int truth) {
  const auto rank = [&](std::size_t f) {
    const int fault = models.faults[f];
    const bool isolated = std::any_of(
        trace.isolated.begin(), trace.isolated.end(), [&](const TimeBand& b) {
          return std::find(b.faults.begin(), b.faults.end(), fault) !=
                 b.faults.end();
        });
    const bool reached =
        trace.fault_factors[f].maximum() >= models.decision.isolation_threshold;
    return fault == truth ? 0 : isolated ? 1 : reached ? 2 : 3;
  };
  std::vector<std::size_t> chosen;
  for (int wanted = 0; wanted < 3; ++wanted) {
    for (std::size_t f = 0; f < models.faults.size(); ++f) {
      if (rank(f) == wanted) {
        chosen.push_back(f);
      }
    }
  }
  return chosen;
}

}  // namespace fdi::trainer
