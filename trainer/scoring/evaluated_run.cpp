#include "trainer/scoring/evaluated_run.h"

#include <string>

#include "base/text.h"
#include "diagnosis/model/fault_catalogue.h"

namespace fdi::trainer {
std::string SetText(const std::vector<int>& set) {
  return JoinText(set, "|", FaultName);
}

std::string GroupsText(const ModelSet& models) {
  return models.groups.empty()
             ? "none"
             : JoinText(models.groups, ", ", [](const std::vector<int>& group) {
                 return SetText(group);
               });
}

std::string FaultsText(const std::vector<int>& faults) {
  return faults.empty() ? "none" : JoinText(faults, ", ", FaultName);
}

bool IsDetected(const EvaluatedRun& run) {
  return run.indices.fault != 0 ? run.indices.detected
                                : run.indices.episodes > 0;
}

const Wording* AnswerWording(const EvaluatedRun& run) {
  if (!IsDetected(run) && FinalSet(run).empty()) {
    return nullptr;
  }
  return run.indices.fault != 0 ? &run.indices.wording : &run.last_wording;
}

const std::vector<int>& FinalSet(const EvaluatedRun& run) {
  return run.indices.fault != 0 ? run.indices.final_set : run.last_set;
}

EvaluationFigures FiguresOf(const std::vector<EvaluatedRun>& runs) {
  EvaluationFigures figures;
  for (const EvaluatedRun& run : runs) {
    figures.wrong_isolations += run.indices.wrong_isolations;
    if (!run.has_truth) {
      ++figures.without_truth;
      continue;
    }
    if (const Wording* wording = AnswerWording(run)) {
      AnswerCount& count =
          figures.by_certainty.at(static_cast<std::size_t>(wording->certainty));
      ++count.answers;
      count.right += run.indices.d_acc > 0.0 ||
                     Contains(wording->look_alikes, run.indices.fault);
    }
    if (run.indices.fault == 0) {
      ++figures.fault_free_runs;
      figures.fault_free_hours += run.duration_s / 3600.0;
      figures.fault_free_episodes += run.indices.episodes;
      continue;
    }
    ++figures.faulty_runs;
    figures.detected += run.indices.detected;
    figures.contained += run.indices.d_acc > 0.0;
    // d_acc is 1/n for a set of n faults, so the comparison with 1 is exact.
    figures.exact += run.indices.d_acc == 1.0;
  }
  return figures;
}

}  // namespace fdi::trainer
