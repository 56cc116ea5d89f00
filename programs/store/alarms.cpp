// fdi-store history: operator actions on episodes (ack, label) and on alarms
// (shelve).
#include <limits>
#include <set>

#include "base/error.h"
#include "base/suggestion.h"
#include "diagnosis/records/valve_glob.h"
#include "programs/store/verbs.h"
#include "storage/history/history_editor.h"
#include "storage/history/history_reader.h"

namespace fdi::storage {
namespace {

using report::Format;

struct AckOptions {
  std::vector<std::string> ids;
  EpisodeOptions filter;
  NoteOptions note;
};

// The selected episodes: those named, or all unacknowledged ones that pass the
// filter.
std::vector<Episode> Chosen(const AckOptions& options, HistoryReader& reader,
                            const Context& context) {
  if (options.filter.given() != options.ids.empty()) {
    throw ConfigError(
        "name episodes, or say which: --valve GLOB ('*': all), --fault, "
        "--state, --from, --to");
  }
  std::vector<Episode> episodes;
  if (options.filter.given()) {
    episodes = reader.List(options.filter.Filter(context));
    std::erase_if(episodes, [](const Episode& episode) {
      return episode.acked_by.has_value();
    });
  }
  for (const std::string& id : options.ids) {
    episodes.push_back(reader.Show(id));
  }
  return episodes;
}

Report Acknowledge(const AckOptions& options, const Context& context) {
  const auto path = DataOf(context).history();
  // The reader is opened first, because an editor would create a missing file.
  HistoryReader reader(path);
  // All ids are looked up before the first episode is acknowledged.
  auto episodes = Chosen(options, reader, context);
  HistoryEditor editor(path);
  const OperatorNote note = options.note.Note();
  Report report;
  for (Episode& episode : episodes) {
    editor.Acknowledge(episode.episode_id, note);
    episode = reader.Show(episode.episode_id);
    report.Line(episode.episode_id + ' ' + episode.valve_id +
                " acknowledged by " + note.who);
  }
  if (episodes.empty()) {
    report.Line("no episode to acknowledge");
  }
  NameFaults(episodes, context);
  report.document["episodes"] =
      Rows(reader.Alarms(std::move(episodes), NowNs()),
           [valves = NotesOf(context)](const Alarm& alarm) {
             return EpisodeJson(alarm, valves);
           });
  return report;
}

struct EpisodeLabelOptions {
  std::string id;
  std::string label;
  NoteOptions note;
};

Report LabelEpisode(const EpisodeLabelOptions& options,
                    const Context& context) {
  const auto path = DataOf(context).history();
  HistoryReader reader(path);
  HistoryEditor editor(path);
  const std::uint64_t id =
      editor.Label(options.id, options.label, options.note.Note());
  std::vector<Episode> labelled{reader.Show(EpisodeIdText(id))};
  NameFaults(labelled, context);
  const Alarm alarm = reader.Alarms(std::move(labelled), NowNs()).front();
  const Episode& episode = alarm.episode;
  Report report;
  report.document = EpisodeJson(alarm, NotesOf(context));
  return report.Line(episode.episode_id + " labelled " +
                     episode.label.value_or(""));
}

Report ShelfReport(const std::vector<Shelf>& shelves, const Context& context) {
  Report report;
  report.document["shelf"] = Rows(shelves, ShelfJson);
  const bool utc = context.options.utc;
  const auto fault = [](const Json& shelf) {
    return shelf["fault"].is_null() ? "any" : shelf["fault"].get<std::string>();
  };
  const auto ended = [utc](const Json& shelf) -> std::string {
    if (shelf["ended_utc"].is_null()) {
      return "-";
    }
    const std::int64_t ns =
        ParseTime(shelf["ended_utc"].get<std::string>(), true);
    return FormatTime(ns, utc) + " by " + shelf["ended_by"].get<std::string>();
  };
  const auto comment = [](const Json& shelf) {
    return shelf["comment"].is_null() ? ""
                                      : shelf["comment"].get<std::string>();
  };
  return report.Table("shelf",
                      {{"id", "shelf_id"},
                       {"valve", "valve_id"},
                       TextColumn("fault", fault),
                       {"from", "from_utc", Format::kTime, 0, 2},
                       {"until", "until_utc", Format::kTime},
                       {"by", "who"},
                       TextColumn("ended", ended, 1),
                       {"from where", "origin", Format::kPlain, 0, 3},
                       TextColumn("comment", comment)},
                      "nothing is shelved");
}

struct ShelveOptions {
  std::string valve;
  std::string fault;
  bool off{false};
  std::string from;
  std::string duration{"8h"};
  NoteOptions note;
};

// Warns about a valve that was never seen, which may be a typing error.
void WarnIfUnknown(const std::string& valve, HistoryReader& reader,
                   const Context& context) {
  std::set<std::string> known;
  for (const CoverageTime& time : reader.Coverage()) {
    known.insert(time.valve_id);
  }
  for (const auto& [id, figures] : reader.AlarmFigures({}, NowNs()).valves) {
    known.insert(id);
  }
  if (!known.contains(valve)) {
    const auto meant = Suggest(valve, {known.begin(), known.end()});
    context.log(LogLevel::kWarning,
                "valve_unknown valve=" + valve +
                    (meant ? " did_you_mean=" + *meant : ""));
  }
}

// Takes the alarms of the valve, or those of one fault, off the shelf early.
Report EndShelves(const ShelveOptions& options, const Context& context) {
  const auto path = DataOf(context).history();
  HistoryReader reader(path);
  const OperatorNote note = options.note.Note();
  std::vector<Shelf> shelves = reader.Shelves(note.now_ns);
  std::erase_if(shelves, [&options](const Shelf& shelf) {
    return shelf.valve_id != options.valve ||
           (!options.fault.empty() && shelf.fault != options.fault);
  });
  if (shelves.empty()) {
    throw NotFoundError("nothing of " + options.valve + " is shelved");
  }
  HistoryEditor editor(path);
  for (Shelf& shelf : shelves) {
    shelf = editor.EndShelf(shelf.shelf_id, note);
  }
  return ShelfReport(shelves, context);
}

Report Shelve(const ShelveOptions& options, const Context& context) {
  if (options.off) {
    return EndShelves(options, context);
  }
  const OperatorNote note = options.note.Note();
  if (options.duration.find_first_not_of("0123456789.") == std::string::npos) {
    throw ConfigError("--for " + options.duration +
                      ": expected a time with its unit, such as 30min, 8h or "
                      "3d");
  }
  const auto from_ns =
      options.from.empty()
          ? std::nullopt
          : std::optional(ParseTime(options.from, context.options.utc));
  const std::int64_t until_ns =
      from_ns.value_or(note.now_ns) + ParseDuration(options.duration);
  // Makes folder and history where no monitor has run yet.
  const auto path = WritableDataOf(context).history();
  HistoryEditor editor(path);
  HistoryReader reader(path);
  WarnIfUnknown(options.valve, reader, context);
  const Shelf shelf = editor.Shelve(
      options.valve,
      options.fault.empty() ? std::nullopt : std::optional(options.fault),
      until_ns, note, from_ns);
  return ShelfReport({shelf}, context);
}

}  // namespace

Report ListShelf(History& history, const EpisodeFilter& filter,
                 const Context& context) {
  const bool former =
      filter.since_ns > std::numeric_limits<std::int64_t>::min();
  std::vector<Shelf> shelves =
      history.Shelves(former ? std::nullopt : std::optional(NowNs()));
  std::erase_if(shelves, [&filter](const Shelf& shelf) {
    return !GlobMatches(filter.valve_glob, shelf.valve_id) ||
           shelf.ended_ns.value_or(shelf.until_ns) < filter.since_ns;
  });
  return ShelfReport(shelves, context);
}

void AddAlarmVerbs(report::Program& program, CLI::App& group) {
  auto [ack, acked] =
      AddVerb(program, group, "ack",
              "Acknowledge episodes: those named, or all that the options find "
              "and that nobody has acknowledged yet",
              Acknowledge);
  ack.add_option("episodes", acked.ids,
                 "IDs, unique beginnings of them, or last");
  acked.filter.AddTo(ack);
  acked.note.AddTo(ack);

  auto [label, labelled] = AddVerb(
      program, group, "label",
      "Say what an episode really was, for the next training", LabelEpisode);
  AddEpisode(label, labelled.id);
  label
      .add_option("label", labelled.label,
                  "true (the answer was right), false (there was no fault), "
                  "or the fault it was")
      ->required();
  labelled.note.AddTo(label);

  auto [shelve, shelved] = AddVerb(
      program, group, "shelve",
      "Set the alarms of a valve aside for a while; they are recorded all "
      "the same",
      Shelve);
  shelve.add_option("valve", shelved.valve, "Valve id")->required();
  shelve.add_option("--fault", shelved.fault,
                    "Only alarms of this fault: f19, 'f3|f6', unknown");
  CLI::Option* const from =
      shelve
          .add_option("--from", shelved.from,
                      "Planned: from this time on, '2026-11-27 06:00' (default "
                      "now; 90 days ahead at most)")
          ->type_name("TIME");
  CLI::Option* const duration = shelve.add_option(
      "--for", shelved.duration, "How long: 8h, 30min, 3d; 90 days at most");
  shelve.add_flag("--off", shelved.off, "Take them off the shelf early")
      ->excludes(from)
      ->excludes(duration);
  shelved.note.AddTo(shelve);
}

}  // namespace fdi::storage
