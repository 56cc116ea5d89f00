#include "bench/study/fault_groups.h"

#include <algorithm>
#include <set>

#include "base/text.h"

namespace fdi::trainer::study {
namespace {

std::size_t IndexIn(const std::set<FaultGroup>& sorted,
                    const FaultGroup& group) {
  return static_cast<std::size_t>(
      std::distance(sorted.begin(), sorted.find(group)));
}

}  // namespace

FaultGroup GroupOf(int fault, const std::vector<FaultGroup>& groups) {
  for (const FaultGroup& group : groups) {
    if (std::find(group.begin(), group.end(), fault) != group.end()) {
      return group;
    }
  }
  return {fault};
}

double GroupAccuracy(const EvaluatedRun& run,
                     const std::vector<FaultGroup>& groups) {
  if (run.indices.fault == 0) {
    return -1.0;
  }
  // A set of several faults of one group is one answer.
  std::set<FaultGroup> named;
  for (const int fault : run.indices.final_set) {
    named.insert(GroupOf(fault, groups));
  }
  return named.contains(GroupOf(run.indices.fault, groups))
             ? 1.0 / static_cast<double>(named.size())
             : 0.0;
}

StudyFigures StudyFiguresOf(const std::vector<EvaluatedRun>& runs,
                            const std::vector<FaultGroup>& groups) {
  StudyFigures figures;
  int detected = 0;
  double accuracy = 0.0;
  double group_accuracy = 0.0;
  for (const EvaluatedRun& run : runs) {
    if (!run.has_truth || run.indices.fault == 0) {
      continue;
    }
    figures.max_r_fd = std::max(figures.max_r_fd, run.indices.r_fd);
    const double d_acc = GroupAccuracy(run, groups);
    figures.contained_group += d_acc > 0.0;
    figures.exact_group += d_acc == 1.0;
    if (run.indices.detected) {
      ++detected;
      accuracy += run.indices.d_acc;
      group_accuracy += d_acc;
    }
  }
  if (detected > 0) {
    figures.mean_d_acc = accuracy / detected;
    figures.mean_d_acc_group = group_accuracy / detected;
  }
  return figures;
}

std::vector<EvaluatedRun> RunsOf(const FaultGroup& group,
                                 const std::vector<EvaluatedRun>& runs) {
  std::vector<EvaluatedRun> chosen;
  std::copy_if(runs.begin(), runs.end(), std::back_inserter(chosen),
               [&](const EvaluatedRun& run) {
                 return run.has_truth &&
                        std::find(group.begin(), group.end(),
                                  run.indices.fault) != group.end();
               });
  return chosen;
}

ConfusionMatrix BuildConfusion(const std::vector<EvaluatedRun>& runs,
                               const std::vector<FaultGroup>& groups) {
  // Every group that was true has a row and a column, every other group that
  // was named a column. The last two columns count runs that were detected
  // without a fault being named, and those without an alarm.
  std::set<FaultGroup> rows;
  std::set<FaultGroup> columns;
  for (const EvaluatedRun& run : runs) {
    if (run.has_truth) {
      rows.insert(GroupOf(run.indices.fault, groups));
      for (const int fault : FinalSet(run)) {
        columns.insert(GroupOf(fault, groups));
      }
      if (run.indices.fault != 0) {
        columns.insert(GroupOf(run.indices.fault, groups));
      }
    }
  }
  ConfusionMatrix matrix;
  matrix.rows.assign(rows.begin(), rows.end());
  matrix.columns.assign(columns.begin(), columns.end());
  matrix.counts.assign(rows.size(), std::vector<double>(columns.size() + 2));
  for (const EvaluatedRun& run : runs) {
    if (!run.has_truth) {
      continue;
    }
    std::vector<double>& counts =
        matrix.counts[IndexIn(rows, GroupOf(run.indices.fault, groups))];
    const std::vector<int>& outcome = FinalSet(run);
    if (outcome.empty()) {
      counts[columns.size() + (IsDetected(run) ? 0 : 1)] += 1.0;
    }
    for (const int fault : outcome) {
      counts[IndexIn(columns, GroupOf(fault, groups))] +=
          1.0 / static_cast<double>(outcome.size());
    }
  }
  return matrix;
}

}  // namespace fdi::trainer::study
