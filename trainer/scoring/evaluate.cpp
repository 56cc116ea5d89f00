#include "trainer/scoring/evaluate.h"

#include <memory>

#include "base/parallel_for.h"
#include "diagnosis/model/fault_catalogue.h"
#include "diagnosis/model/quality_count.h"
#include "simulator/second_look/second_look.h"
#include "trainer/campaign/run_input.h"
#include "trainer/scoring/rescore.h"

namespace fdi::trainer {
namespace {

// The last second fault of the run, and its last name.
void ScoreSecond(const std::vector<Indication>& all, EvaluatedRun& result) {
  bool before = false;
  for (const Indication& now : all) {
    if (now.second && !before) {
      result.second_t = now.time_s;
      result.second_set.clear();
    }
    if (now.second && !now.second_set.empty()) {
      result.second_set = now.second_set;
    }
    before = now.second;
  }
}

}  // namespace

Answer AnswerOf(const std::shared_ptr<const ModelSet>& models,
                const storage::StoredRun& run, const VerdictSink& sink) {
  QualityCount samples;
  const std::shared_ptr<const LookSimulation> simulation =
      models->physics.empty()
          ? nullptr
          : std::make_shared<const simulator::ValveLooker>(*models);
  const auto watch = [&](const Sample& sample, const Verdict& verdict) {
    if (CountsAsTime(verdict)) {
      samples.Add(verdict.quality);
    }
    if (sink) {
      sink(sample, verdict);
    }
  };
  Answer answer;
  answer.indications = Rescore(models, run, watch, simulation);
  answer.seconds.emplace();
  for (std::size_t q = 0; q < kQualityCount; ++q) {
    (*answer.seconds)[q] =
        models->sample_period_s *
        static_cast<double>(samples[static_cast<Quality>(q)]);
  }
  return answer;
}

EvaluatedRun ScoreAnswer(const Answer& answer, const storage::StoredRun& run,
                         bool assume_normal, double horizon_s) {
  EvaluatedRun result;
  result.indices = ComputeIndices(answer.indications, horizon_s);
  result.indices.run_id = RunName(run);
  result.has_truth = assume_normal || HasTruth(run);
  result.duration_s =
      run.info.run.period_s * static_cast<double>(answer.indications.size());
  result.seconds = answer.seconds;
  for (const Indication& indication : answer.indications) {
    if (!indication.isolated.empty() || indication.withdrawn) {
      if (indication.isolated.empty() ||
          indication.isolated != result.last_set) {
        result.last_wording = indication.wording;
      }
      result.last_set = indication.isolated;
    }
  }
  ScoreSecond(answer.indications, result);
  return result;
}

EvaluatedRun Evaluate(const std::shared_ptr<const ModelSet>& models,
                      const storage::StoredRun& run, bool assume_normal) {
  return ScoreAnswer(AnswerOf(models, run), run, assume_normal);
}

std::vector<EvaluatedRun> Evaluate(
    const std::shared_ptr<const ModelSet>& models,
    const std::vector<storage::StoredRun>& runs, bool assume_normal) {
  std::vector<EvaluatedRun> results(runs.size());
  ParallelFor(static_cast<int>(runs.size()), 0, [&](int i) {
    const auto r = static_cast<std::size_t>(i);
    results[r] = Evaluate(models, runs[r], assume_normal);
  });
  return results;
}

}  // namespace fdi::trainer
