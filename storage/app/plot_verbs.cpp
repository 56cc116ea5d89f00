#include <iostream>
#include <memory>

#include <CLI/CLI.hpp>

#include "storage/app/common.h"
#include "storage/app/history_options.h"
#include "storage/app/verbs.h"
#include "storage/cli/fault_texts.h"
#include "storage/history.h"
#include "storage/plot/episode_figure.h"
#include "storage/plot/run_figure.h"
#include "storage/runs.h"

namespace fdi::storage {
namespace {

using cli::Context;

struct EpisodePlot {
  std::string id;
  std::string output;
  EpisodeFigureOptions options;
};

struct RunPlot {
  std::string selector;
  std::string output;
};

int Drawn(const char* key, const std::string& id,
          const std::filesystem::path& path, const Context& context) {
  if (context.options.json) {
    cli::PrintJson(std::cout, {{key, id}, {"file", path.string()}});
  } else {
    std::cout << "drawn to " << path.string() << '\n';
  }
  return cli::kExitOk;
}

int PlotEpisode(const EpisodePlot& plot, const Context& context) {
  const DataDirectory data = DataOf(context);
  HistoryReader reader(data.history());
  const EpisodeEvidence evidence = LoadEvidence(reader, plot.id, data.models());
  const Episode& episode = evidence.episode;
  EpisodeFigureOptions options = plot.options;
  options.fault_name = cli::LoadFaultTexts(context.options)
                           .Words(episode.fault.value_or(""), episode.strength)
                           .name;
  const std::filesystem::path path =
      plot.output.empty() ? episode.episode_id + ".png" : plot.output;
  DrawFigure(EpisodeFigure(evidence, options), path);
  return Drawn("episode_id", episode.episode_id, path, context);
}

int PlotRun(const RunPlot& plot, const Context& context) {
  const StoredRun run = RunStore(DataOf(context).runs()).Load(plot.selector);
  const std::filesystem::path path =
      plot.output.empty() ? run.info.id + ".png" : plot.output;
  TimeFigure figure = RunFigure(run);
  figure.subtitle = "started " + TimeText(run.info.run.start_ns, context) +
                    ",  " + std::string(RunOriginName(run.info.run.origin)) +
                    ",  " + std::to_string(figure.t_s.size()) + " samples";
  DrawFigure(figure, path);
  return Drawn("run_id", run.info.id, path, context);
}

void AddOutput(CLI::App& verb, std::string& output) {
  verb.add_option("-o,--output", output, "FILE.png or FILE.svg (ID.png)");
}

}  // namespace

void AddPlotVerbs(cli::Program& program) {
  auto episode = std::make_shared<EpisodePlot>();
  CLI::App& history = program.AddVerb(
      *program.root().get_subcommand("history"), "plot",
      "Draw the evidence of an episode for a report, with gnuplot",
      [episode](const Context& c) { return PlotEpisode(*episode, c); });
  AddEpisode(history, episode->id);
  AddOutput(history, episode->output);
  history.add_option("--from", episode->options.from_s,
                     "From so many s after detection on");
  history.add_option("--to", episode->options.to_s,
                     "Up to so many s after detection");

  auto run = std::make_shared<RunPlot>();
  CLI::App& runs = program.AddVerb(
      *program.root().get_subcommand("runs"), "plot",
      "Draw the signals and the truth of a run for a report, with gnuplot",
      [run](const Context& c) { return PlotRun(*run, c); });
  runs.add_option("run", run->selector, "ID or ID@from:to in s")->required();
  AddOutput(runs, run->output);
}

}  // namespace fdi::storage
