#include "trainer/onboarding/coverage.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "base/error.h"
#include "base/parallel_for.h"
#include "diagnosis/model/fault_catalogue.h"
#include "trainer/evaluation.h"

namespace fdi::trainer {
namespace {

constexpr std::size_t kLeadIn = 120;  // healthy samples before a fault
constexpr std::size_t kMaxShownSamples =
    900;                                // samples that a fault is given to show
constexpr std::size_t kPart = 600;      // samples of a part that is left out
constexpr std::size_t kLeastRest = 60;  // samples of a stretch that tell
// Effects of faults are exact, so that few samples fit them: four blocks of a
// long record.
constexpr std::size_t kBlock = 300;
constexpr std::size_t kMostRest = 1200;
constexpr std::size_t kIsolableSize = 2;

// The last part of the stretch.
Stretch Shortened(const Stretch& stretch) {
  const std::size_t count =
      std::min(stretch.samples.size(), kLeadIn + kMaxShownSamples);
  return CutOut(stretch, {0, stretch.samples.size() - count, count});
}

// `healthy`, then `faulty` from the lead-in on.
TrainingRun RunWith(const FaultCondition& fault,
                    const std::vector<Sample>& faulty, const ScoredPart& part) {
  TrainingRun run;
  run.id = part.healthy.run_id;
  run.period_s = part.models->sample_period_s;
  run.flow_unit = part.models->flow_unit;
  for (std::size_t k = 0; k < faulty.size(); ++k) {
    if (k < kLeadIn) {
      run.samples.push_back({part.healthy.samples[k], FaultTruth{}});
    } else {
      run.samples.push_back(
          {faulty[k], FaultTruth{fault.fault, fault.strength}});
    }
  }
  return run;
}

// Judgement of the models on a part without a fault.
struct HealthyScore {
  std::optional<double> alarm_s;  // From when a fault would begin.
  double judged{1.0};             // Share of the samples after the first LIVE.
};

HealthyScore ScoreHealthy(const ScoredPart& part,
                          const std::shared_ptr<const EnginePlan>& plan) {
  HealthyScore score;
  double live = 0.0;
  double settled = 0.0;
  const auto count = [&](const Sample&, const Verdict& verdict) {
    live += verdict.quality == Quality::kLive ? 1.0 : 0.0;
    settled += live > 0.0 ? 1.0 : 0.0;
  };
  const double from_s =
      part.models->sample_period_s * static_cast<double>(kLeadIn);
  for (const Indication& now :
       ScoreRun(plan, RunWith({}, part.healthy.samples, part), count)) {
    if (now.detected && !score.alarm_s) {
      score.alarm_s = now.time_s - from_s;
    }
  }
  score.judged = settled > 0.0 ? live / settled : 0.0;
  return score;
}

// Score of a fault at a strength, over all parts.
struct FaultScore {
  FaultCondition fault;
  bool detected{true};
  bool isolated{true};
  std::vector<int> others{};  // Named beside it, or instead.
};

void AddPart(const RunIndices& indices, const HealthyScore& healthy,
             FaultScore& score) {
  const std::vector<int>& set = indices.final_set;
  const bool detected =
      indices.detected &&
      !(healthy.alarm_s && *healthy.alarm_s <= indices.t_dt_first);
  score.detected = score.detected && detected;
  score.isolated = score.isolated && detected && set.size() <= kIsolableSize &&
                   Contains(set, indices.fault);
  for (const int fault : set) {
    if (detected && fault != indices.fault && !Contains(score.others, fault)) {
      score.others.push_back(fault);
    }
  }
}

// `scores` ascend by |strength|. The walk begins at the strongest and ends at
// the first that fails: what holds below a strength that fails does not count.
std::optional<double> Smallest(const std::vector<FaultScore>& scores,
                               bool FaultScore::*holds) {
  std::optional<double> smallest;
  for (auto at = scores.rbegin(); at != scores.rend() && (*at).*holds; ++at) {
    smallest = std::abs(at->fault.strength);
  }
  return smallest;
}

FaultCoverage Summarise(std::vector<FaultScore> scores) {
  std::ranges::stable_sort(scores, {}, [](const FaultScore& score) {
    return std::abs(score.fault.strength);
  });
  FaultCoverage coverage;
  coverage.fault = scores.front().fault.fault;
  coverage.negative = scores.front().fault.strength < 0.0;
  coverage.detectable = Smallest(scores, &FaultScore::detected);
  coverage.isolable = Smallest(scores, &FaultScore::isolated);
  for (const FaultScore& score : scores) {
    for (const int fault : score.others) {
      if (!Contains(coverage.look_alikes, fault)) {
        coverage.look_alikes.push_back(fault);
      }
    }
  }
  std::ranges::sort(coverage.look_alikes);
  return coverage;
}

// Number of parts of `count` samples that fit into the stretch.
std::size_t Room(const Stretch& stretch, std::size_t count) {
  return stretch.samples.size() / count;
}

}  // namespace

CoverageTable ScoreCoverage(const std::vector<FaultCondition>& faults,
                            const std::vector<ScoredPart>& parts, int threads) {
  CoverageTable table;
  table.signals = parts.front().healthy.samples.front().present;
  table.parts = static_cast<int>(parts.size());
  std::size_t shortest = parts.front().healthy.samples.size();
  std::vector<HealthyScore> healthy;
  std::vector<std::shared_ptr<const EnginePlan>> plans;
  for (const ScoredPart& part : parts) {
    plans.push_back(std::make_shared<const EnginePlan>(part.models));
    shortest = std::min(shortest, part.healthy.samples.size());
    healthy.push_back(ScoreHealthy(part, plans.back()));
    table.alarmed += healthy.back().alarm_s ? 1 : 0;
    table.judged = std::min(table.judged, healthy.back().judged);
  }
  table.seconds = parts.front().models->sample_period_s *
                  static_cast<double>(shortest - kLeadIn);
  std::vector<FaultScore> scores(faults.size());
  ParallelFor(static_cast<int>(faults.size()), threads, [&](int i) {
    const auto f = static_cast<std::size_t>(i);
    scores[f].fault = faults[f];
    for (std::size_t p = 0; p < parts.size(); ++p) {
      const TrainingRun run = RunWith(faults[f], parts[p].faulty[f], parts[p]);
      AddPart(ComputeIndices(ScoreRun(plans[p], run)), healthy[p], scores[f]);
    }
  });
  // Every turn takes out the scores of one fault in one direction.
  while (!scores.empty()) {
    const FaultCondition first = scores.front().fault;
    const auto others = std::stable_partition(
        scores.begin(), scores.end(), [&](const FaultScore& score) {
          return score.fault.fault == first.fault &&
                 (score.fault.strength < 0.0) == (first.strength < 0.0);
        });
    table.faults.push_back(Summarise({scores.begin(), others}));
    scores.erase(scores.begin(), others);
  }
  return table;
}

CoverageTable AssessCoverage(std::shared_ptr<const ModelSet> models,
                             const std::vector<FaultCondition>& faults,
                             const FaultSynthesis& synthesize,
                             const Stretch& healthy, int threads) {
  ScoredPart part{std::move(models), Shortened(healthy), {}};
  part.faulty.resize(faults.size());
  ParallelFor(static_cast<int>(faults.size()), threads, [&](int i) {
    const auto f = static_cast<std::size_t>(i);
    part.faulty[f] = synthesize(faults[f], part.healthy);
  });
  return ScoreCoverage(faults, {part}, threads);
}

std::vector<RecordPart> PartsOf(const std::vector<Stretch>& stretches) {
  std::vector<std::size_t> wide;  // one entry for each part that there is
  std::size_t longest = 0;
  for (std::size_t i = 0; i < stretches.size(); ++i) {
    wide.insert(wide.end(), Room(stretches[i], kPart), i);
    longest = stretches[i].samples.size() > stretches[longest].samples.size()
                  ? i
                  : longest;
  }
  std::size_t count = kPart;
  std::size_t first = longest;
  std::size_t last = longest;
  if (wide.size() >= 2) {
    first = wide.front();
    last = wide.back();
  } else {
    count = std::min(kPart, stretches[longest].samples.size() / 2);
  }
  if (count <= kLeadIn) {
    throw DataError("a part has " + std::to_string(count) +
                    " samples, scoring takes more than " +
                    std::to_string(kLeadIn));
  }
  return {{first, 0, count},
          {last, stretches[last].samples.size() - count, count}};
}

std::vector<TrainingRun> RunsWithout(const std::vector<TrainingRun>& runs,
                                     const Stretch& part) {
  const std::int64_t from = part.samples.front().stamp_ns;
  const std::int64_t to = part.samples.back().stamp_ns;
  std::vector<TrainingRun> rest = runs;
  for (TrainingRun& run : rest) {
    if (run.id == part.run_id) {
      std::erase_if(run.samples, [&](const LabelledSample& labelled) {
        return labelled.sample.stamp_ns >= from &&
               labelled.sample.stamp_ns <= to;
      });
    }
  }
  std::erase_if(rest, [](const auto& run) { return run.samples.empty(); });
  return rest;
}

Stretch CutOut(const Stretch& stretch, const RecordPart& part) {
  const auto begin =
      stretch.samples.begin() + static_cast<std::ptrdiff_t>(part.from);
  return {stretch.run_id,
          {begin, begin + static_cast<std::ptrdiff_t>(part.count)}};
}

namespace {

// Blocks evenly spread, of about kMostRest samples in all.
std::vector<RecordPart> EvenBlocks(const std::vector<RecordPart>& parts) {
  std::vector<RecordPart> blocks;
  for (const RecordPart& part : parts) {
    for (std::size_t k = 0; k + kBlock <= part.count; k += kBlock) {
      blocks.push_back({part.stretch, part.from + k, kBlock});
    }
  }
  const std::size_t most = kMostRest / kBlock;
  if (blocks.size() < most) {  // gaps leave too few
    return parts;
  }
  std::vector<RecordPart> chosen;
  for (std::size_t i = 0; i < most; ++i) {
    chosen.push_back(blocks[(2 * i + 1) * blocks.size() / (2 * most)]);
  }
  return chosen;
}

}  // namespace

FaultyStretches Without(const FaultyStretches& all, const RecordPart& part) {
  std::vector<RecordPart> kept;
  std::size_t samples = 0;
  const auto keep = [&](const RecordPart& piece) {
    if (piece.count >= kLeastRest) {
      kept.push_back(piece);
      samples += piece.count;
    }
  };
  for (std::size_t i = 0; i < all.healthy.size(); ++i) {
    const std::size_t size = all.healthy[i].samples.size();
    if (i == part.stretch) {
      const std::size_t end = part.from + part.count;
      keep({i, 0, part.from});
      keep({i, end, size - end});
    } else {
      keep({i, 0, size});
    }
  }
  if (samples > kMostRest) {
    kept = EvenBlocks(kept);
  }
  const auto cut = [&](const std::vector<Stretch>& stretches) {
    std::vector<Stretch> rest;
    for (const RecordPart& piece : kept) {
      rest.push_back(CutOut(stretches[piece.stretch], piece));
    }
    return rest;
  };
  FaultyStretches rest{cut(all.healthy), {}};
  for (const std::vector<Stretch>& stretches : all.faulty) {
    rest.faulty.push_back(cut(stretches));
  }
  return rest;
}

std::vector<CoverageChange> ChangesOf(const CoverageTable& before,
                                      const CoverageTable& after) {
  std::vector<CoverageChange> changes;
  for (const FaultCoverage& now : after.faults) {
    const auto then =
        std::ranges::find_if(before.faults, [&](const FaultCoverage& fault) {
          return fault.fault == now.fault && fault.negative == now.negative;
        });
    if (then != before.faults.end() && then->detectable != now.detectable) {
      changes.push_back(
          {now.fault, now.negative, then->detectable, now.detectable});
    }
  }
  return changes;
}

}  // namespace fdi::trainer
