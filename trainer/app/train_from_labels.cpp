#include <algorithm>
#include <iostream>

#include "diagnosis/fault_catalogue.h"
#include "storage/cli/logging.h"
#include "storage/cli/text_table.h"
#include "storage/data_directory.h"
#include "trainer/app/evidence_runs.h"
#include "trainer/app/label_plan.h"
#include "trainer/app/model_report.h"

namespace fdi::trainer {
namespace {

using storage::TrainingEpisode;

cli::Json EpisodeJson(const LabelledEpisode& episode) {
  const TrainingEpisode& meaning = episode.meaning;
  const bool used = episode.refusal.empty();
  return {{"episode_id", meaning.episode_id},
          {"valve_id", meaning.valve_id},
          {"label", meaning.label},
          {"labelled_by", meaning.labelled_by},
          {"fault", used ? cli::Json(FaultName(meaning.fault)) : cli::Json()},
          {"strength", used ? cli::Json(meaning.strength) : cli::Json()},
          {"samples", meaning.samples},
          {"data", episode.data},
          {"refused", used ? cli::Json() : cli::Json(episode.refusal)}};
}

cli::Json PlanJson(const LabelPlan& plan) {
  cli::Json json = {{"model_set", plan.training.name},
                    {"parent", NameOf(*plan.parent)},
                    {"parent_hash", HashText(plan.parent->content_hash)},
                    {"runs", plan.runs},
                    {"missing_runs", plan.missing},
                    {"episodes", cli::Json::array()}};
  for (const auto* list : {&plan.learnt, &plan.refused}) {
    for (const LabelledEpisode& episode : *list) {
      json["episodes"].push_back(EpisodeJson(episode));
    }
  }
  return json;
}

void PrintPlan(const LabelPlan& plan) {
  std::cout << "next version of " << plan.training.name << ", built on "
            << NameOf(*plan.parent) << "\nruns: " << Joined(plan.runs) << '\n';
  if (!plan.missing.empty()) {
    std::cout << "not in runs.db: " << Joined(plan.missing) << '\n';
  }
  cli::TextTable table({{"episode"},
                        {"valve"},
                        {"label"},
                        {"by"},
                        {"taken as"},
                        {"strength [-]", cli::Align::kRight},
                        {"samples", cli::Align::kRight},
                        {"data"},
                        {"refused because"}});
  for (const auto* list : {&plan.learnt, &plan.refused}) {
    for (const LabelledEpisode& e : *list) {
      const TrainingEpisode& m = e.meaning;
      const bool used = e.refusal.empty();
      table.AddRow(
          {m.episode_id, m.valve_id, m.label, m.labelled_by,
           used ? FaultName(m.fault) : "-",
           used && m.fault != 0 ? cli::FormatNumber(m.strength, 2) : "-",
           std::to_string(m.samples), e.data, e.refusal});
    }
  }
  std::cout << '\n';
  table.Print(std::cout);
}

// The signals that all runs have; BuildConditions() wants them alike.
void KeepCommonSignals(const ModelSet& parent, std::vector<TrainingRun>& runs) {
  SignalMask common = static_cast<SignalMask>(~SignalMask{0});
  for (const TrainingRun& run : runs) {
    for (const LabelledSample& labelled : run.samples) {
      common &= labelled.sample.present;
    }
  }
  const SignalMask required = RequiredSignals(parent);
  if ((common & required) != required) {
    return;  // BuildConditions() names the run.
  }
  for (TrainingRun& run : runs) {
    for (LabelledSample& labelled : run.samples) {
      labelled.sample.present = common;
    }
  }
}

storage::Lineage LineageOf(const LabelPlan& plan,
                           const std::vector<std::string>& runs) {
  storage::Lineage lineage;
  lineage.parent = storage::ParentSet{plan.parent->name, plan.parent->version,
                                      plan.parent->content_hash};
  for (const LabelledEpisode& episode : plan.learnt) {
    lineage.episodes.push_back(episode.meaning);
  }
  for (const TrainingEpisode& before : plan.lineage.episodes) {
    if (std::find(runs.begin(), runs.end(), before.run) != runs.end() &&
        std::none_of(plan.learnt.begin(), plan.learnt.end(),
                     [&](const LabelledEpisode& now) {
                       return now.meaning.episode_id == before.episode_id;
                     })) {
      lineage.episodes.push_back(before);
    }
  }
  return lineage;
}

}  // namespace

int TrainFromLabels(const TrainOptions& options, const cli::Context& context) {
  LabelPlan plan = MakeLabelPlan(options, context);
  if (options.dry_run) {
    context.options.json ? cli::PrintJson(std::cout, PlanJson(plan))
                         : PrintPlan(plan);
    return cli::kExitOk;
  }
  RequireTrainable(options, plan);
  const cli::StopSignals signals;
  const storage::DataDirectory directory{context.options.data_dir};
  for (const LabelledEpisode& episode : plan.refused) {
    context.log(
        LogLevel::kWarning,
        cli::EventLine("episode_refused", {{"reason", RefusalText(episode)}}));
  }
  const int stored =
      KeepEvidence(plan.learnt, *plan.parent, directory, context.software);
  context.log(LogLevel::kInfo,
              cli::EventLine("labels_read",
                             {{"episodes", std::to_string(plan.learnt.size())},
                              {"refused", std::to_string(plan.refused.size())},
                              {"runs_stored", std::to_string(stored)}}));
  std::vector<std::string> selectors = plan.runs;
  for (const LabelledEpisode& episode : plan.learnt) {
    selectors.push_back(episode.meaning.run);
  }
  std::vector<TrainingRun> runs = LoadTrainingRuns(
      selectors, directory.runs(), plan.training.dataset.assume_normal);
  KeepCommonSignals(*plan.parent, runs);
  PrintTrained(TrainAndStore(runs, plan.training, options,
                             LineageOf(plan, plan.runs), signals, context),
               context);
  return cli::kExitOk;
}

}  // namespace fdi::trainer
