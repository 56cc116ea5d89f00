#include "diagnosis/error.h"
#include "trainer/app/evaluate_options.h"
#include "trainer/app/verdict_file.h"

namespace fdi::trainer {

int EvaluateVerdicts(const EvaluateOptions& options,
                     const cli::Context& context) {
  const std::vector<ScoredRun> runs =
      LoadScoredRuns(options.selection, 0, context);
  if (runs.size() != options.verdicts.size()) {
    throw ConfigError(std::to_string(options.verdicts.size()) +
                      " files of verdicts for " + std::to_string(runs.size()) +
                      " runs: one for each is needed, in the same order");
  }
  std::vector<EvaluatedRun> results;
  for (std::size_t i = 0; i < runs.size(); ++i) {
    results.push_back(Evaluated(runs[i],
                                ReadVerdicts(options.verdicts[i], runs[i].run),
                                options.assume_normal));
  }
  PrintResult(options, context, {options.verdicts.front(), 0, {}}, results);
  return cli::kExitOk;
}

}  // namespace fdi::trainer
