#pragma once

namespace fdi::report {
class Program;
}

namespace fdi::trainer::study {

/// The verbs of fdi-study; see docs/evaluation.md and `--help`.
void AddEvaluateVerb(report::Program& program);
void AddAblateVerb(report::Program& program);
void AddScoringVerbs(report::Program& program);
void AddReduceVerb(report::Program& program);
void AddInjectVerb(report::Program& program);
void AddPicturesVerb(report::Program& program);
void AddBudgetVerbs(report::Program& program);

}  // namespace fdi::trainer::study
