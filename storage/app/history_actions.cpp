#include <iostream>
#include <memory>

#include <CLI/CLI.hpp>

#include "diagnosis/error.h"
#include "storage/app/episode_text.h"
#include "storage/app/history_options.h"
#include "storage/cli/time_text.h"
#include "storage/history.h"

namespace fdi::storage {
namespace {

using cli::Context;

struct AckOptions {
  std::vector<std::string> ids;
  bool all{false};
  HistoryOptions filter;
  NoteOptions note;
};

struct LabelOptions {
  std::string id;
  std::string label;
  NoteOptions note;
};

// The ids that are meant: those named, or all that the filter finds.
std::vector<std::string> Chosen(const AckOptions& options,
                                HistoryReader& reader, const Context& context) {
  if (options.all != options.ids.empty()) {
    throw ConfigError(
        "name episodes, or give --all (and --valve, --fault, "
        "--state, --since, --until to narrow it)");
  }
  if (!options.all) {
    return options.ids;
  }
  std::vector<std::string> ids;
  for (const Episode& episode : reader.List(options.filter.Filter(context))) {
    if (!episode.acked_by) {
      ids.push_back(episode.episode_id);
    }
  }
  return ids;
}

std::vector<Episode> Resolved(const std::vector<std::string>& ids,
                              HistoryReader& reader) {
  std::vector<Episode> episodes;
  for (const std::string& id : ids) {
    episodes.push_back(reader.Show(id));
  }
  return episodes;
}

int Acknowledge(const AckOptions& options, const Context& context) {
  const auto path = DataOf(context).history();
  HistoryReader reader(path);  // It must be there: an editor would make it.
  // All are there before the first is acknowledged.
  auto episodes = Resolved(Chosen(options, reader, context), reader);
  HistoryEditor editor(path);
  const OperatorNote note = options.note.Note();
  for (Episode& episode : episodes) {
    editor.Acknowledge(episode.episode_id, note);
    episode = reader.Show(episode.episode_id);
  }
  if (context.options.json) {
    cli::PrintJson(std::cout, EpisodesJson(episodes));
    return cli::kExitOk;
  }
  for (const Episode& episode : episodes) {
    std::cout << episode.episode_id << ' ' << episode.valve_id
              << " acknowledged by " << note.who << '\n';
  }
  if (episodes.empty()) {
    std::cout << "no episode to acknowledge\n";
  }
  return cli::kExitOk;
}

int Label(const LabelOptions& options, const Context& context) {
  const auto path = DataOf(context).history();
  HistoryReader reader(path);
  HistoryEditor editor(path);
  const std::uint64_t id =
      editor.Label(options.id, options.label, options.note.Note());
  const Episode episode = reader.Show(EpisodeIdText(id));
  if (context.options.json) {
    cli::PrintJson(std::cout, EpisodeJson(episode));
  } else {
    std::cout << episode.episode_id << " labelled "
              << episode.label.value_or("") << '\n';
  }
  return cli::kExitOk;
}

}  // namespace

void NoteOptions::AddTo(CLI::App& verb) {
  verb.add_option("--by", who, "Who says so");
  verb.add_option("--comment", comment, "Why");
}

OperatorNote NoteOptions::Note() const {
  return {who, comment, Origin(), cli::NowNs()};
}

void AddHistoryActions(cli::Program& program, CLI::App& group) {
  auto ack = std::make_shared<AckOptions>();
  CLI::App& acknowledge = program.AddVerb(
      group, "ack", "Acknowledge episodes: somebody knows of them",
      [ack](const Context& c) { return Acknowledge(*ack, c); });
  acknowledge.add_option("episodes", ack->ids,
                         "IDs, unique beginnings of them, or last");
  acknowledge.add_flag("--all", ack->all,
                       "All that the options below find and that are not "
                       "acknowledged yet");
  ack->filter.AddTo(acknowledge);
  ack->note.AddTo(acknowledge);

  auto options = std::make_shared<LabelOptions>();
  CLI::App& label = program.AddVerb(
      group, "label", "Say what an episode really was, for the next training",
      [options](const Context& c) { return Label(*options, c); });
  AddEpisode(label, options->id);
  label
      .add_option("label", options->label,
                  "true (the answer was right), false (there was no fault), "
                  "or the fault it was")
      ->required();
  options->note.AddTo(label);
}

}  // namespace fdi::storage
