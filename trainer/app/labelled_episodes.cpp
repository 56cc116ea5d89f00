#include "trainer/app/labelled_episodes.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "diagnosis/error.h"
#include "diagnosis/fault_catalogue.h"
#include "trainer/app/episode_samples.h"
#include "trainer/app/run_input.h"
#include "trainer/app/strength_estimate.h"

namespace fdi::trainer {
namespace {

constexpr std::int64_t kLeadInNs = 1'800'000'000'000;

std::string NameOf(const ModelSet& models) {
  return models.name + "@" + std::to_string(models.version);
}

std::string Number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.6g", value);
  return text;
}

// Numbers of the faults isolated last.
std::vector<int> IsolatedIn(const storage::Episode& episode) {
  std::vector<int> faults;
  for (std::size_t bit = 0; bit < episode.faults.size(); ++bit) {
    if ((episode.fault_bits >> bit & 1U) != 0) {
      faults.push_back(ParseFault(episode.faults[bit]).value_or(0));
    }
  }
  return faults;
}

// Samples in the longest piece without a gap.
std::size_t LongestPiece(const TrainingRun& run) {
  std::size_t longest = 0;
  for (const Stretch& piece : SplitAtGaps(run)) {
    longest = std::max(longest, piece.samples.size());
  }
  return longest;
}

// A label that teaches nothing; what() says why.
class Refusal : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace

std::vector<storage::Episode> FindLabelled(storage::HistoryReader& history,
                                           const LabelSelection& selection) {
  std::vector<storage::Episode> episodes = history.List(selection.filter);
  std::erase_if(episodes,
                [](const storage::Episode& e) { return !e.label.has_value(); });
  return episodes;
}

class LabelReader::Impl {
 public:
  Impl(storage::HistoryReader& history, std::filesystem::path runs,
       std::shared_ptr<const ModelSet> parent, const DatasetOptions& dataset,
       const LabelSelection& selection)
      : history_(history),
        runs_(std::move(runs)),
        parent_(std::move(parent)),
        dataset_(dataset),
        selection_(selection) {}

  LabelledEpisode Read(const storage::Episode& episode) {
    LabelledEpisode result;
    result.meaning.episode_id = episode.episode_id;
    result.meaning.valve_id = episode.valve_id;
    result.meaning.label = *episode.label;
    for (const storage::EpisodeEvent& event : history_.Events(episode.id)) {
      if (event.kind == "LABEL") {
        result.meaning.labelled_by = event.who;
        result.meaning.labelled_ns = event.stamp_ns;
      }
    }
    try {
      result.meaning.fault = FaultMeant(episode);
      const EpisodeSamples all =
          LoadEpisodeSamples(history_, runs_, episode, SpanAround(episode));
      result.data = all.where;
      RequireSuited(all.run);
      result.meaning.strength =
          result.meaning.fault == 0
              ? 0.0
              : StrengthOf(episode, result.meaning.fault, all.run);
      TakeSamples(all.run, episode, result);
    } catch (const Refusal& refusal) {
      result.refusal = refusal.what();
    }
    return result;
  }

 private:
  static int FaultMeant(const storage::Episode& episode) {
    if (*episode.label == "false") {
      return 0;
    }
    if (*episode.label != "true") {
      return RequireFault(*episode.label);
    }
    const std::vector<int> isolated = IsolatedIn(episode);
    if (isolated.size() != 1 || isolated.front() == 0) {
      throw Refusal(
          "label true says which fault only if exactly one was "
          "isolated, here " +
          episode.fault.value_or("none") +
          "; label it with the name of the fault");
    }
    return isolated.front();
  }

  // With the time before the detection that the false one counts, and that
  // the engine needs to settle.
  TimeSpan SpanAround(const storage::Episode& episode) {
    std::int64_t from = episode.detected_ns - kLeadInNs;
    storage::EpisodeFilter same;
    same.valve_glob = episode.valve_id;
    same.until_ns = episode.detected_ns;
    for (const storage::Episode& other : history_.List(same)) {
      if (other.id != episode.id && other.detected_ns < episode.detected_ns) {
        from = std::max(from, other.ended_ns.value_or(other.detected_ns) + 1);
      }
    }
    return {from, episode.cleared_ns.value_or(episode.ended_ns.value_or(
                      std::numeric_limits<std::int64_t>::max()))};
  }

  void RequireSuited(const storage::StoredRun& run) const {
    const storage::NewRun& row = run.info.run;
    const std::string set = NameOf(*parent_);
    if (run.samples.empty()) {
      throw Refusal("neither a run nor its trace holds a sample of it");
    }
    if (std::abs(row.period_s - parent_->sample_period_s) >
        1e-3 * parent_->sample_period_s) {
      throw Refusal("its sample period is " + Number(row.period_s) + " s, " +
                    set + " is for " + Number(parent_->sample_period_s) + " s");
    }
    if (row.flow_unit != parent_->flow_unit) {
      throw Refusal("its flow is in " +
                    std::string(FlowUnitName(row.flow_unit)) + ", " + set +
                    " is for " + std::string(FlowUnitName(parent_->flow_unit)));
    }
    const SignalMask missing =
        RequiredSignals(*parent_) &
        static_cast<SignalMask>(~run.samples.front().sample.present);
    for (std::size_t i = 0; i < kSignalCount; ++i) {
      const auto signal = static_cast<Signal>(i);
      if ((missing & MaskOf(signal)) != 0) {
        throw Refusal("it has no signal " + std::string(SignalName(signal)) +
                      ", which " + set + " reads");
      }
    }
  }

  double StrengthOf(const storage::Episode& episode, int fault,
                    const storage::StoredRun& run) const {
    for (const auto& [id, strength] : selection_.strengths) {
      if (episode.episode_id.starts_with(id)) {
        return strength;
      }
    }
    const std::vector<int> isolated = IsolatedIn(episode);
    if (isolated == std::vector<int>{fault} && episode.strength != 0.0) {
      return episode.strength;
    }
    const StrengthEstimate estimate =
        EstimateStrength(parent_, run, fault, episode.detected_ns);
    if (!estimate.problem.empty()) {
      throw Refusal("the strength is unknown: " + estimate.problem +
                    "; say it: --strength " + episode.episode_id +
                    "=S, S in [-1, 1] without 0, 1 the full fault");
    }
    return estimate.strength;
  }

  void TakeSamples(const storage::StoredRun& run,
                   const storage::Episode& episode, LabelledEpisode& result) {
    const storage::TrainingEpisode& meaning = result.meaning;
    TimeSpan span{std::numeric_limits<std::int64_t>::min(),
                  std::numeric_limits<std::int64_t>::max()};
    if (meaning.fault != 0) {
      span.from_ns = episode.detected_ns;
      if (episode.cleared_ns) {
        const int back =
            parent_->decision.clearing_samples + dataset_.dropped_after_step;
        span.to_ns = *episode.cleared_ns -
                     std::llround(back * parent_->sample_period_s * 1e9);
      }
    }
    storage::StoredRun part;
    part.info = run.info;
    for (storage::StoredSample stored : run.samples) {
      if (span.Contains(stored.sample.stamp_ns)) {
        stored.truth = FaultTruth{meaning.fault, meaning.strength};
        part.samples.push_back(stored);
      }
    }
    TrainingRun usable = ToTrainingRun(part, false);
    const std::size_t longest = LongestPiece(usable);
    const int needed = dataset_.dropped_after_step + dataset_.shortest_stretch;
    if (longest < static_cast<std::size_t>(needed)) {
      throw Refusal("too short: " + std::to_string(longest) +
                    " usable samples in a row, needed are " +
                    std::to_string(needed));
    }
    result.samples = std::move(usable.samples);
    result.meaning.samples = static_cast<std::int64_t>(result.samples.size());
  }

  storage::HistoryReader& history_;
  std::filesystem::path runs_;
  std::shared_ptr<const ModelSet> parent_;
  DatasetOptions dataset_;
  const LabelSelection& selection_;
};

LabelReader::LabelReader(storage::HistoryReader& history,
                         const std::filesystem::path& runs,
                         std::shared_ptr<const ModelSet> parent,
                         const DatasetOptions& dataset,
                         const LabelSelection& selection)
    : impl_(std::make_unique<Impl>(history, runs, std::move(parent), dataset,
                                   selection)) {}

LabelReader::~LabelReader() = default;

LabelledEpisode LabelReader::Read(const storage::Episode& episode) {
  return impl_->Read(episode);
}

}  // namespace fdi::trainer
