#pragma once

namespace fdi::cli {
class Program;
}

namespace fdi::trainer {

/// One verb of fdi-trainer each; see docs and `--help`.
void AddTrainVerb(cli::Program& program);
void AddEvaluateVerb(cli::Program& program);
void AddCompareVerb(cli::Program& program);
void AddShowVerb(cli::Program& program);
void AddInjectVerb(cli::Program& program);
void AddLimitsVerb(cli::Program& program);
void AddOnboardVerb(cli::Program& program);
void AddCoverageVerb(cli::Program& program);

}  // namespace fdi::trainer
