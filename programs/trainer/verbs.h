#pragma once

namespace fdi::report {
class Program;
}

namespace fdi::trainer {

/// One verb of fdi-trainer each; see docs and `--help`.
void AddTrainVerb(report::Program& program);
void AddEvaluateVerb(report::Program& program);
void AddCompareVerb(report::Program& program);
void AddShowVerb(report::Program& program);
void AddOnboardVerb(report::Program& program);
void AddRelearnVerb(report::Program& program);

}  // namespace fdi::trainer
