#include <iostream>
#include <optional>

#include "diagnosis/error.h"
#include "diagnosis/fault_catalogue.h"
#include "storage/cli/output_folder.h"
#include "storage/data_directory.h"
#include "storage/models.h"
#include "trainer/app/evaluate_options.h"
#include "trainer/app/report_page.h"
#include "trainer/app/report_trace.h"
#include "trainer/app/rescore.h"
#include "trainer/app/vectors_csv.h"
#include "trainer/model_reduction.h"
#include "trainer/parallel_for.h"

namespace fdi::trainer {
namespace {

ModelSet LoadWhole(const EvaluateOptions& options,
                   const cli::Context& context) {
  if (options.model_set.empty() == options.valve.empty()) {
    throw ConfigError("either --model-set NAME[@VERSION] or --valve ID");
  }
  const storage::DataDirectory directory{context.options.data_dir};
  storage::ModelStore store(directory.models());
  if (!options.model_set.empty()) {
    return store.Load(options.model_set);
  }
  const auto assigned = store.AssignedModelSet(options.valve);
  if (!assigned) {
    throw NotFoundError("no model set is assigned to valve " + options.valve +
                        ": see fdi-store valves assign");
  }
  return store.Load(*assigned);
}

struct Evaluation {
  std::vector<EvaluatedRun> runs;
  std::vector<RunTrace> traces;  // Of every run if there is a report.
};

// Also fills `trace`, and adds to `vectors`, unless there is none.
EvaluatedRun EvaluateRun(const std::shared_ptr<const ModelSet>& models,
                         const ScoredRun& scored, bool assume_normal,
                         VectorsCsv* vectors, RunTrace* trace) {
  std::optional<RunTraceRecorder> recorder;
  if (trace != nullptr) {
    recorder.emplace(*models, DurationOf(scored.run));
  }
  QualityCount samples;
  const VerdictSink sink = [&](const Sample&, const Verdict& verdict) {
    if (CountsAsTime(verdict)) {
      samples.Add(verdict.quality);
    }
    if (vectors != nullptr) {
      vectors->Add(scored.name, verdict);
    }
    if (recorder) {
      recorder->Add(verdict);
    }
  };
  const std::vector<Indication> indications = Rescore(models, scored.run, sink);
  if (recorder) {
    *trace = recorder->Finish(indications);
  }
  EvaluatedRun evaluated = Evaluated(scored, indications, assume_normal);
  evaluated.seconds.emplace();
  for (std::size_t q = 0; q < kQualityCount; ++q) {
    (*evaluated.seconds)[q] =
        models->sample_period_s *
        static_cast<double>(samples[static_cast<Quality>(q)]);
  }
  return evaluated;
}

Evaluation EvaluateRuns(const EvaluateOptions& options,
                        const std::shared_ptr<const ModelSet>& models,
                        const std::vector<ScoredRun>& runs) {
  std::optional<VectorsCsv> vectors;
  if (!options.vectors.empty()) {
    vectors.emplace(options.vectors, *models);
  }
  Evaluation result;
  result.runs.resize(runs.size());
  result.traces.resize(options.report.empty() ? 0 : runs.size());
  const int threads = vectors ? 1 : 0;  // One file: in the order of the runs.
  ParallelFor(static_cast<int>(runs.size()), threads, [&](int i) {
    const auto r = static_cast<std::size_t>(i);
    result.runs[r] = EvaluateRun(
        models, runs[r], options.assume_normal, vectors ? &*vectors : nullptr,
        result.traces.empty() ? nullptr : &result.traces[r]);
  });
  if (vectors) {
    vectors->Commit();
  }
  return result;
}

}  // namespace

std::shared_ptr<const ModelSet> LoadModels(const EvaluateOptions& options,
                                           const cli::Context& context) {
  std::vector<int> faults;
  for (const std::string& name : options.without) {
    faults.push_back(RequireFault(name));
  }
  return std::make_shared<const ModelSet>(
      WithoutChannels(WithoutFaults(LoadWhole(options, context), faults),
                      options.without_channels));
}

std::string ReductionText(const EvaluateOptions& options) {
  std::string text;
  for (const std::string& fault : options.without) {
    text += (text.empty() ? " without " : ", ") + fault;
  }
  for (const std::string& channel : options.without_channels) {
    text += (text.empty() ? " without channel " : ", channel ") + channel;
  }
  return text;
}

void PrintResult(const EvaluateOptions& options, const cli::Context& context,
                 const Detector& detector,
                 const std::vector<EvaluatedRun>& runs) {
  if (context.options.json) {
    cli::Json json = EvaluationJson(detector, runs);
    if (!options.without.empty()) {
      json["summary"]["without"] = options.without;
    }
    if (!options.without_channels.empty()) {
      json["summary"]["without_channels"] = options.without_channels;
    }
    cli::PrintJson(std::cout, json);
  } else if (options.csv) {
    WriteEvaluationCsv(std::cout, runs);
  } else {
    const std::string reduction = ReductionText(options);
    if (!reduction.empty()) {
      std::cout << detector.name << '@' << detector.version << reduction
                << "\n\n";
    }
    PrintEvaluation(std::cout, detector, runs);
  }
}

int EvaluateModels(const EvaluateOptions& options,
                   const cli::Context& context) {
  if (!options.report.empty()) {
    cli::EnsureFolder(options.report);
  }
  const auto models = LoadModels(options, context);
  const auto [runs, traces] = EvaluateRuns(
      options, models,
      LoadScoredRuns(options.selection, RequiredSignals(*models), context));
  if (!options.report.empty()) {
    cli::WriteFile(options.report / "index.html",
                   ReportPage({*models, runs, traces, context.software,
                               context.command_line}));
  }
  PrintResult(options, context, DetectorOf(*models), runs);
  return cli::kExitOk;
}

}  // namespace fdi::trainer
