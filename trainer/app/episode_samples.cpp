#include "trainer/app/episode_samples.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "diagnosis/error.h"
#include "storage/runs.h"
#include "trainer/app/run_input.h"

namespace fdi::trainer {
namespace {

constexpr double kSecondsPerNs = 1e-9;

// The step in time that most samples are apart [s]; 0 for fewer than two.
double PeriodOf(const std::vector<storage::StoredSample>& samples) {
  std::vector<std::int64_t> steps;
  for (std::size_t k = 1; k < samples.size(); ++k) {
    steps.push_back(samples[k].sample.stamp_ns -
                    samples[k - 1].sample.stamp_ns);
  }
  if (steps.empty()) {
    return 0.0;
  }
  const auto middle =
      steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
  std::nth_element(steps.begin(), middle, steps.end());
  return static_cast<double>(*middle) * kSecondsPerNs;
}

void KeepAccepted(const TimeSpan& span,
                  std::vector<storage::StoredSample>& samples) {
  std::erase_if(samples, [&](const storage::StoredSample& stored) {
    return stored.intake != Intake::kAccepted ||
           !span.Contains(stored.sample.stamp_ns);
  });
}

EpisodeSamples FromTrace(storage::HistoryReader& history,
                         const storage::Episode& episode,
                         const TimeSpan& span) {
  EpisodeSamples result;
  for (const storage::TraceInstant& instant : history.Trace(episode.id)) {
    result.run.samples.push_back(instant.received);
  }
  KeepAccepted(span, result.run.samples);
  storage::NewRun& row = result.run.info.run;
  row.valve_id = episode.valve_id;
  row.source_id = episode.source_id;
  row.flow_unit = episode.flow_unit;
  row.period_s = PeriodOf(result.run.samples);
  result.where = "trace";
  return result;
}

// Seconds from the start of the run, one period on both sides.
std::string SelectorOf(const storage::RunInfo& info, const TimeSpan& span) {
  const auto seconds = [&](std::int64_t stamp_ns) {
    return static_cast<double>(stamp_ns - info.run.start_ns) * kSecondsPerNs;
  };
  storage::StoredRun name;
  name.info.id = info.id;
  name.selector.from_s =
      std::floor(seconds(std::max(span.from_ns, info.first_stamp_ns)));
  name.selector.to_s = std::ceil(
      seconds(std::min(span.to_ns, info.last_stamp_ns)) + info.run.period_s);
  return RunName(name);
}

}  // namespace

EpisodeSamples LoadEpisodeSamples(storage::HistoryReader& history,
                                  const std::filesystem::path& runs,
                                  const storage::Episode& episode,
                                  const TimeSpan& span) {
  EpisodeSamples best = FromTrace(history, episode, span);
  if (!std::filesystem::exists(runs)) {
    return best;
  }
  storage::RunStore store(runs);
  storage::RunFilter filter;
  filter.valve_glob = episode.valve_id;
  for (const storage::RunInfo& info : store.List(filter)) {
    if (info.run.source_id != episode.source_id ||
        info.run.origin == storage::RunOrigin::kImported || info.samples == 0 ||
        info.last_stamp_ns < span.from_ns || info.first_stamp_ns > span.to_ns) {
      continue;
    }
    const std::string selector = SelectorOf(info, span);
    try {
      storage::StoredRun run = store.Load(selector);
      KeepAccepted(span, run.samples);
      if (!run.samples.empty() &&
          run.samples.size() >= best.run.samples.size()) {
        best = {std::move(run), selector};
      }
    } catch (const NotFoundError&) {
      // The run pauses there.
    }
  }
  return best;
}

}  // namespace fdi::trainer
