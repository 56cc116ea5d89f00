// Shared by the verbs: options, JSON values, texts.
#include <filesystem>
#include <sstream>

#include "base/error.h"
#include "base/text.h"
#include "base/time_units.h"
#include "diagnosis/model/fault_catalogue.h"
#include "programs/store/clock.h"
#include "programs/store/verbs.h"
#include "report/fault_texts.h"
#include "storage/history/certainty.h"
#include "storage/history/foreign_history.h"
#include "storage/history/history_reader.h"
#include "storage/models/models.h"
#include "storage/models/repairs.h"

namespace fdi::storage {

DataDirectory DataOf(const Context& context) {
  return {context.options.data_dir};
}

DataDirectory WritableDataOf(const Context& context) {
  DataDirectory data = DataOf(context);
  EnsureExists(data);
  return data;
}

ModelStore WritableModels(const Context& context) {
  return ModelStore(WritableDataOf(context).models(),
                    Access::kOccasionalWriter);
}

void EpisodeOptions::AddTo(CLI::App& verb) {
  verb.add_option("--valve", valve, "Only valves whose ids match: 'FV-1*'")
      ->type_name("GLOB");
  verb.add_option("--fault", fault,
                  std::string(kFaultNames) + ", paper1..paper5 or unknown");
  window.AddTo(verb);
  verb.add_option("--state", state,
                  "open, detected, isolated or closed of the episode; the "
                  "others of the alarm; unacked: unack or rtn_unack")
      ->type_name(JoinText(EpisodeStateNames(), "|"));
}

void ShowWithPlant(CLI::Option* option) {
  if (!ReadsPlants()) {
    option->group("");
  }
}

void PlantOptions::AddTo(CLI::App& verb) {
  ShowWithPlant(verb.add_option("--db", url,
                                "Read the history of the whole plant instead: "
                                "postgresql://user@host/database")
                    ->type_name("URL"));
  ShowWithPlant(verb.add_option("--monitor", monitor,
                                "With --db: only what this monitor recorded")
                    ->type_name("NAME"));
}

bool PlantOptions::asked() const {
  if (url.empty() && !monitor.empty()) {
    throw ConfigError("--monitor " + monitor +
                      ": of the history of a plant, which --db names");
  }
  return !url.empty();
}

std::unique_ptr<History> OpenHistory(const PlantOptions& plant,
                                     const Context& context) {
  if (plant.asked()) {
    auto history = OpenPlant(plant);
    if (auto* foreign = dynamic_cast<ForeignHistory*>(history.get())) {
      foreign->SayTo(context.log);
    }
    return history;
  }
  return std::make_unique<HistoryReader>(DataOf(context).history());
}

EpisodeFilter EpisodeOptions::Filter(const Context& context) const {
  if (!fault.empty() && fault != "unknown" && !ParseFinding(fault)) {
    throw ConfigError("--fault: unknown fault '" + fault + "'" +
                      DidYouMeanFault(fault, {"unknown"}) + ": expected " +
                      std::string(kFaultNames) + ", paper1..paper5 or unknown");
  }
  EpisodeFilter filter;
  filter.valve_glob = valve.empty() ? "*" : valve;
  filter.fault = fault;
  filter.since_ns = window.since_ns(context);
  filter.until_ns = window.until_ns(context);
  filter.state = ParseEpisodeState(state);
  filter.now_ns = NowNs();
  return filter;
}

void RequireSaneClock(const std::string& what, std::int64_t newest_ns) {
  constexpr std::int64_t kFarNs = 31 * kNsPerDay;
  const std::int64_t now_ns = NowNs();
  if (newest_ns != 0 && now_ns - newest_ns > kFarNs) {
    throw DataError("prune: nothing is deleted, because the clock says " +
                    FormatTime(now_ns, true) + ", and the newest of " + what +
                    " came at " + FormatTime(newest_ns, true) +
                    ". If the clock is right, give --trust-clock");
  }
}

void NoteOptions::AddTo(CLI::App& verb) {
  verb.add_option("--by", who, "Who says so");
  verb.add_option("--comment", comment, "Why");
}

OperatorNote NoteOptions::Note() const {
  return {who, comment, report::Origin("fdi-store"), NowNs()};
}

void AddEpisode(CLI::App& verb, std::string& id) {
  verb.add_option("episode", id, "ID, a unique beginning of it, or last")
      ->required();
}

void AddOutput(CLI::App& verb, std::string& output) {
  output = "-";
  verb.add_option("-o,--output", output, "Where to write it; - is stdout")
      ->type_name("FILE");
}

Json TimeJson(const std::optional<std::int64_t>& stamp_ns) {
  return stamp_ns ? Json(FormatTime(*stamp_ns, true)) : Json();
}

Json TextJson(const std::optional<std::string>& text) {
  return text && !text->empty() ? Json(*text) : Json();
}

Json NumberJson(const std::optional<double>& number) {
  return number && std::isfinite(*number) ? Json(*number) : Json();
}

// The VAF of an output that stood still is rounding noise: its variance is some
// 1e-28 of that of the residual. For an output that varies, a model would have
// to be off by 3000 standard deviations to get here.
bool IsVafMeaningful(double vaf) {
  return vaf > -1e9;
}

Json VafJson(double vaf) {
  return IsVafMeaningful(vaf) ? NumberJson(vaf) : Json();
}

ValveNotes NotesOf(const Context& context) {
  const auto models = DataOf(context).models();
  ValveNotes notes;
  notes.about = findings::ReadIdentities(models);
  if (std::filesystem::exists(models)) {
    notes.repairs = ModelStore(models).Repairs();
  }
  return notes;
}

ValveNotes NotesOf(const PlantOptions& plant, const Context& context) {
  return plant.asked() ? ValveNotes{} : NotesOf(context);
}

Json ValveEventJson(const ValveEvent& event) {
  return {{"epoch", event.epoch},
          {"kind", ValveEventKindName(event.kind)},
          {"at_utc", TimeJson(event.at_ns)},
          {"who", event.who},
          {"note", event.note},
          {"order", event.order.empty() ? Json() : Json(event.order)},
          {"expected_utc", TimeJson(event.expected_ns)}};
}

namespace {

// Work on the valve since the episode was detected.
Json RepairsJson(const Episode& episode, const ValveNotes& valves) {
  Json repairs = Json::array();
  for (const auto& [pattern, event] : valves.repairs) {
    if (event.at_ns >= episode.detected_ns &&
        IsAbout(pattern, episode.valve_id)) {
      repairs.push_back(ValveEventJson(event));
    }
  }
  return repairs;
}

}  // namespace

const std::vector<std::string>& EpisodeKeys() {
  static const std::vector<std::string> keys = {
      "episode_id",        "valve_id",  "detected_utc", "isolated_utc",
      "cleared_utc",       "fault",     "peak_factor",  "model_set",
      "end_reason",        "label",     "acked_by",     "strength",
      "worst_strength",    "severity",  "priority",     "unconfirmed_utc",
      "fault_name",        "acked_utc", "ack_comment",  "alarm_state",
      "shelved_until_utc", "second",    "certainty",    "look_alikes",
      "about/description"};
  return keys;
}

// An episode is stored with the name that its fault had in the catalogue at
// that time, which is shown where it was not stored without one.
void NameFaults(std::vector<Episode>& episodes, const Context& context) {
  std::optional<report::FaultTexts> texts;
  for (Episode& episode : episodes) {
    if (episode.fault && !episode.fault_name) {
      if (!texts) {
        texts = report::LoadFaultTexts(context.options);
      }
      const std::string_view no_name = storage::NoNameText(episode);
      episode.fault_name =
          no_name.empty() ? texts->Words(*episode.fault, episode.strength).name
                          : std::string(no_name);
    }
  }
}

// A strength is that of a fault: while there is no name, it is null and not 0.
Json EpisodeJson(const Alarm& alarm, const ValveNotes& valves) {
  const Episode& episode = alarm.episode;
  const bool named = IsNamed(episode);
  const auto severity = episode.priority ? SeverityOf(*episode.priority)
                                         : std::optional<Severity>();
  return {
      {"episode_id", episode.episode_id},
      {"valve_id", episode.valve_id},
      {"about", findings::AboutJson(
                    findings::IdentityOf(valves.about, episode.valve_id))},
      {"detected_utc", episode.detected_utc},
      {"isolated_utc", TextJson(episode.isolated_utc)},
      {"cleared_utc", TextJson(episode.cleared_utc)},
      {"ended_utc", TimeJson(episode.ended_ns)},
      {"returned_utc", TimeJson(ReturnedNs(episode))},
      {"fault", TextJson(episode.fault)},
      {"certainty", CertaintyName(CertaintyOf(episode))},
      {"look_alikes", LookAlikesOf(episode)},
      {"witness", WitnessText(episode)},
      {"peak_factor", episode.peak_factor},
      {"model_set", episode.model_set},
      {"end_reason", TextJson(episode.end_reason)},
      {"label", TextJson(episode.label)},
      {"acked_by", TextJson(episode.acked_by)},
      {"strength", named ? NumberJson(episode.strength) : Json()},
      {"worst_strength", named ? NumberJson(episode.worst_strength) : Json()},
      {"severity", severity ? Json(SeverityName(*severity)) : Json()},
      {"priority", severity ? Json(PriorityOf(*severity)) : Json()},
      {"unconfirmed_utc", TimeJson(episode.unconfirmed_ns)},
      {"fault_name", TextJson(episode.fault_name)},
      {"acked_utc", TimeJson(episode.acked_ns)},
      {"ack_comment", TextJson(episode.ack_comment)},
      {"alarm_state", AlarmStateName(alarm.state)},
      {"shelved_until_utc",
       alarm.shelf ? TimeJson(alarm.shelf->until_ns) : Json()},
      {"second", TextJson(episode.second)},
      {"description", TextJson(episode.description)},
      {"repairs", RepairsJson(episode, valves)},
      {"return_hours", NumberJson(episode.return_hours)}};
}

Json ShelfJson(const Shelf& shelf) {
  return {{"shelf_id", shelf.shelf_id},
          {"valve_id", shelf.valve_id},
          {"fault", TextJson(shelf.fault)},
          {"from_utc", TimeJson(shelf.from_ns)},
          {"until_utc", TimeJson(shelf.until_ns)},
          {"who", shelf.who},
          {"comment", TextJson(shelf.comment)},
          {"origin", shelf.origin},
          {"ended_utc", TimeJson(shelf.ended_ns)},
          {"ended_by", TextJson(shelf.ended_by)},
          {"ended_origin", TextJson(shelf.ended_origin)},
          {"planned_utc", TimeJson(shelf.planned_ns)}};
}

Json HoursJson(const std::vector<CoverageTime>& coverage) {
  Json valves = Json::object();
  for (const CoverageTime& time : coverage) {
    valves[time.valve_id][time.quality] = time.hours;
  }
  return valves;
}

void AddHours(Report& report, const std::vector<CoverageTime>& coverage) {
  if (coverage.empty()) {
    return;
  }
  report::TextTable table({{"valve"},
                           {"quality"},
                           {"hours", report::Align::kRight},
                           {"samples", report::Align::kRight}});
  for (const CoverageTime& time : coverage) {
    table.AddRow({time.valve_id, time.quality,
                  report::FormatNumber(time.hours, 2),
                  std::to_string(time.samples)});
  }
  AddTextTable(report, table);
}

void AddTextTable(Report& report, const report::TextTable& table) {
  std::ostringstream text;
  table.Print(text);
  std::string lines = text.str();
  lines.pop_back();  // Line() adds the last newline.
  report.Line(std::move(lines));
}

std::string TimeText(const std::optional<std::int64_t>& stamp_ns,
                     const Context& context) {
  return stamp_ns ? FormatTime(*stamp_ns, context.options.utc) : "-";
}

report::Column TextColumn(std::string heading,
                          std::function<std::string(const Json& row)> text,
                          int spare, report::Align align) {
  report::Column column;
  column.heading = std::move(heading);
  column.text = std::move(text);
  column.spare = spare;
  column.align = align;
  return column;
}

report::Column TextField(std::string heading, std::string text) {
  return TextColumn(std::move(heading),
                    [text = std::move(text)](const Json&) { return text; });
}

}  // namespace fdi::storage
