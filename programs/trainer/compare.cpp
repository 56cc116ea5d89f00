#include <memory>

#include <CLI/CLI.hpp>

#include "programs/trainer/verbs.h"
#include "report/program.h"
#include "storage/database/data_directory.h"
#include "storage/models/models.h"
#include "trainer/scoring/comparison.h"
#include "trainer/scoring/scored_runs.h"

namespace fdi::trainer {
namespace {

struct CompareOptions {
  std::string a;
  std::string b;
  RunSelection selection;
  bool assume_normal{false};
  bool all{false};
};

report::Report CompareSets(const CompareOptions& options,
                           const report::Context& context) {
  const storage::DataDirectory directory{context.options.data_dir};
  storage::ModelStore store(directory.models());
  const auto a = std::make_shared<const ModelSet>(store.Load(options.a));
  const auto b = std::make_shared<const ModelSet>(store.Load(options.b));
  // Sets of two flow units have no run in common: scoring refuses that of b.
  const auto runs =
      LoadSelected(options.selection, *a, context, RequiredSignals(*b));
  return ComparisonReport(Compare(a, b, runs, options.assume_normal),
                          options.all);
}

}  // namespace

void AddCompareVerb(report::Program& program) {
  auto [verb, options] =
      AddVerb(program, "compare", "Compare two model sets on the same runs",
              CompareSets);
  verb.add_option("a", options.a, "The set in use")
      ->required()
      ->type_name("NAME[@VERSION]");
  verb.add_option("b", options.b, "The candidate")
      ->required()
      ->type_name("NAME[@VERSION]");
  options.selection.AddTo(verb);
  verb.add_flag("--assume-normal", options.assume_normal,
                "Samples without truth count as free of faults");
  verb.add_flag("--all", options.all, "List runs on which both are alike, too");
}

}  // namespace fdi::trainer
