#include "trainer/onboarding/fault_coverage.h"

#include <algorithm>
#include <cmath>

#include "trainer/evaluation.h"
#include "trainer/parallel_for.h"

namespace fdi::trainer {
namespace {

constexpr std::size_t kLeadIn = 120;   // healthy samples before a fault
constexpr std::size_t kLongest = 900;  // samples that it is given to show
constexpr std::size_t kIsolableSize = 2;

// The last part of the stretch.
Stretch Shortened(const Stretch& stretch) {
  const std::size_t count =
      std::min(stretch.samples.size(), kLeadIn + kLongest);
  return {stretch.run_id,
          {stretch.samples.end() - static_cast<std::ptrdiff_t>(count),
           stretch.samples.end()}};
}

// `healthy`, then `faulty` from the lead-in on.
TrainingRun FaultyRun(const Stretch& healthy, const std::vector<Sample>& faulty,
                      const FaultCondition& fault, const ModelSet& models) {
  TrainingRun run;
  run.id = healthy.run_id;
  run.period_s = models.sample_period_s;
  run.flow_unit = models.flow_unit;
  for (std::size_t k = 0; k < faulty.size(); ++k) {
    if (k < kLeadIn) {
      run.samples.push_back({healthy.samples[k], FaultTruth{}});
    } else {
      run.samples.push_back(
          {faulty[k], FaultTruth{fault.fault, fault.strength}});
    }
  }
  return run;
}

bool Isolated(const RunIndices& indices) {
  const std::vector<int>& set = indices.final_set;
  return indices.detected && set.size() <= kIsolableSize &&
         std::find(set.begin(), set.end(), indices.fault) != set.end();
}

// By rising |strength|: from where on `holds` does not fail any more.
template <typename Predicate>
std::optional<double> Smallest(const std::vector<RunIndices>& runs,
                               Predicate holds) {
  std::optional<double> smallest;
  for (auto run = runs.rbegin(); run != runs.rend() && holds(*run); ++run) {
    smallest = std::abs(run->strength);
  }
  return smallest;
}

FaultCoverage Summarise(std::vector<RunIndices> runs) {
  std::sort(runs.begin(), runs.end(), [](const auto& a, const auto& b) {
    return std::abs(a.strength) < std::abs(b.strength);
  });
  FaultCoverage coverage;
  coverage.fault = runs.front().fault;
  coverage.negative = runs.front().strength < 0.0;
  coverage.detectable =
      Smallest(runs, [](const RunIndices& r) { return r.detected; });
  coverage.isolable = Smallest(runs, Isolated);
  for (const RunIndices& run : runs) {
    for (const int fault : run.final_set) {
      auto& others = coverage.look_alikes;
      if (run.detected && fault != run.fault &&
          std::find(others.begin(), others.end(), fault) == others.end()) {
        others.push_back(fault);
      }
    }
  }
  std::sort(coverage.look_alikes.begin(), coverage.look_alikes.end());
  return coverage;
}

// Faults with a value in `more` and none in `less`.
template <typename Member>
std::vector<int> Gained(const CoverageTable& less, const CoverageTable& more,
                        Member member) {
  const auto has = [&](const CoverageTable& table, int fault) {
    return std::any_of(table.faults.begin(), table.faults.end(),
                       [&](const FaultCoverage& c) {
                         return c.fault == fault && (c.*member).has_value();
                       });
  };
  std::vector<int> gained;
  for (const FaultCoverage& coverage : more.faults) {
    if (has(more, coverage.fault) && !has(less, coverage.fault) &&
        (gained.empty() || gained.back() != coverage.fault)) {
      gained.push_back(coverage.fault);
    }
  }
  return gained;
}

}  // namespace

CoverageTable AssessCoverage(std::shared_ptr<const ModelSet> models,
                             const std::vector<FaultCondition>& faults,
                             const FaultSynthesizer& synthesize,
                             const Stretch& healthy, int threads) {
  const Stretch stretch = Shortened(healthy);
  std::vector<RunIndices> runs(faults.size());
  ParallelFor(static_cast<int>(faults.size()), threads, [&](int i) {
    const FaultCondition& fault = faults[static_cast<std::size_t>(i)];
    const TrainingRun run =
        FaultyRun(stretch, synthesize(fault, stretch), fault, *models);
    runs[static_cast<std::size_t>(i)] = ComputeIndices(ScoreRun(models, run));
  });
  CoverageTable table;
  table.signals = healthy.samples.front().present;
  table.seconds = models->sample_period_s *
                  static_cast<double>(stretch.samples.size() - kLeadIn);
  while (!runs.empty()) {
    const auto others = std::stable_partition(
        runs.begin(), runs.end(), [first = runs.front()](const RunIndices& r) {
          return r.fault == first.fault &&
                 (r.strength < 0.0) == (first.strength < 0.0);
        });
    table.faults.push_back(Summarise({runs.begin(), others}));
    runs.erase(runs.begin(), others);
  }
  return table;
}

TransmitterGain GainOf(Signal signal, const CoverageTable& less,
                       const CoverageTable& more) {
  return {signal, Gained(less, more, &FaultCoverage::detectable),
          Gained(less, more, &FaultCoverage::isolable)};
}

}  // namespace fdi::trainer
