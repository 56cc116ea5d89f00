#pragma once

#include <string>
#include <vector>

#include "diagnosis/model_set.h"
#include "trainer/app/evaluated_run.h"
#include "trainer/app/report_trace.h"

namespace fdi::trainer {

/// What the page of `evaluate --report` shows.
struct ReportContent {
  const ModelSet& models;
  const std::vector<EvaluatedRun>& runs;
  const std::vector<RunTrace>& traces;  ///< Parallel to runs.
  std::string software;                 ///< That scored.
  std::string command_line;
};

/// One HTML page that needs nothing beside it and no script: figures over all
/// runs, by fault and by group, indices of every run, confusion by fault and by
/// group, pictures of every run.
std::string ReportPage(const ReportContent& content);

}  // namespace fdi::trainer
