#include "report/plot/episode_page.h"

#include <array>
#include <cctype>
#include <string_view>
#include <utility>

#include "base/error.h"
#include "base/time_text.h"
#include "diagnosis/model/fault_catalogue.h"
#include "report/text_table.h"
#include "storage/history/certainty.h"

// The page of an episode, to take to the valve (docs/reports.md, "The page of
// an episode"). `fdi-store history report` and the console make the same page,
// and `history show` has the fields of its first part.
namespace fdi::plot {
namespace {

using report::Column;
using report::Json;
using storage::Alarm;
using storage::Episode;
using storage::HistoryEntry;

// Such that letters are readable on A4.
constexpr double kPictureWidth = 1200.0;  // [px]
constexpr double kLegendWidth = 225.0;    // [px]
constexpr std::size_t kGroups = 720;

std::string ShownTime(std::optional<std::int64_t> stamp_ns, bool utc) {
  return stamp_ns ? FormatTime(*stamp_ns, utc) : "-";
}

Column Field(std::string heading, std::string text) {
  Column column;
  column.heading = std::move(heading);
  column.text = [text = std::move(text)](const Json&) { return text; };
  column.wraps = true;
  return column;
}

std::string_view ByLayer(std::string_view layer) {
  return layer == LayerName(Layer::kPhysics) ? ", by simulation of the valve"
         : layer == LayerName(Layer::kAudit) ? ", by the audit of the loop"
                                             : "";
}

// "likely: Flow transmitter wrong (f19), by simulation of the valve"
std::string FaultLine(const Episode& e, const std::string& name) {
  std::string line(CertaintyName(storage::CertaintyOf(e)));
  line += ": " + name;
  if (!storage::IsNamed(e)) {
    return line;
  }
  line += " (" + *e.fault + ")";
  for (const std::string& other : storage::LookAlikesOf(e)) {
    line += " or " + other;
  }
  line += ByLayer(e.layer.value_or(""));
  if (e.second) {
    line += ", and " + (*e.second == "unknown" ? "a second fault without a name"
                                               : *e.second);
  }
  return line;
}

std::string AlarmLine(const Alarm& alarm, bool utc) {
  std::string line(AlarmStateName(alarm.state));
  if (const auto since = alarm.episode.unconfirmed_ns) {
    line += ", not confirmed since " + ShownTime(since, utc);
  }
  if (alarm.shelf) {
    const storage::Shelf& shelf = *alarm.shelf;
    line += ", shelved by " + shelf.who + " until " +
            ShownTime(shelf.until_ns, utc) +
            (shelf.comment.empty() ? "" : ": " + shelf.comment);
  }
  return line;
}

// "0.42 (0.38 to 0.46), 0.55 at its worst"
std::string StrengthLine(const Episode& e) {
  if (!storage::IsNamed(e)) {
    return "-";
  }
  std::string line = e.lowest && e.highest
                         ? IntervalText(e.strength, *e.lowest, *e.highest, 3)
                         : report::FormatNumber(e.strength, 3);
  if (e.worst_strength && *e.worst_strength != e.strength) {
    line += ", " + report::FormatNumber(*e.worst_strength, 3) + " at its worst";
  }
  return line;
}

// "by anna at 2026-11-20T15:02:11+01:00: on my way"
std::string AckLine(const Episode& e, bool utc) {
  return !e.acked_by
             ? "-"
             : "by " + *e.acked_by + " at " + ShownTime(e.acked_ns, utc) +
                   (e.ack_comment ? ": " + *e.ack_comment : "");
}

// "Flow transmitter wrong (f19)"
std::string NameAndFault(const std::string& fault,
                         const report::FaultTexts& texts) {
  return texts.Words(fault, 0.0).name + " (" + fault + ")";
}

std::string EndText(std::string_view reason) {
  constexpr std::array<std::pair<std::string_view, const char*>, 5> kEnds{
      {{"cleared", "the fault is gone"},
       {"stream_ended", "the valve's data ended"},
       {"stale_timeout", "no data came any more"},
       {"model_changed", "another model set judges the valve"},
       {"superseded",
        "another episode, or a newer source of its data, took over"}}};
  for (const auto& [name, text] : kEnds) {
    if (reason == name) {
      return text;
    }
  }
  return "the monitor no longer followed it";
}

std::string LabelText(const std::string& label,
                      const report::FaultTexts& texts) {
  return label == "true"    ? "right"
         : label == "false" ? "no fault"
                            : NameAndFault(label, texts);
}

std::string ActionSentence(const HistoryEntry& event,
                           const report::FaultTexts& texts) {
  std::string text = event.who;
  text += event.kind == "ACK" ? " acknowledged it"
          : event.kind == "LABEL"
              ? " labelled it: " + LabelText(event.value, texts)
              : " " + event.kind + " " + event.value;
  return text + (event.origin.empty() ? "" : " (" + event.origin + ")") +
         (event.comment.empty() ? "." : ". \"" + event.comment + "\"");
}

Json StoryJson(const EpisodeEvidence& evidence,
               const report::FaultTexts& texts) {
  Json story = Json::array();
  for (const HistoryEntry& event : evidence.events) {
    story.push_back({{"stamp_utc", FormatTime(event.stamp_ns, true)},
                     {"after", FormatDuration(event.stamp_ns -
                                              evidence.episode.detected_ns)},
                     {"text", EventSentence(event, texts)}});
  }
  return story;
}

// What a simulation of the valve found: "f7: 0.50 (0.40 to 0.60), begins ..."
std::string LookText(const EpisodeLook& look, const report::FaultTexts& texts,
                     bool utc) {
  std::string text = "A simulation of the valve explains the data best by ";
  if (look.faults.empty()) {
    return "A simulation of the valve with any known fault does not explain "
           "the data.";
  }
  for (const LookFault& f : look.faults) {
    text += (&f == look.faults.data() ? "" : " and ") +
            NameAndFault(FaultName(f.fault), texts) + " of strength " +
            IntervalText(f.strength, f.lowest, f.highest, 2) + " since " +
            ShownTime(f.begins_ns, utc) + (f.growing ? ", growing" : "");
  }
  return text + ".";
}

// The sentences of `text`: each begins with a capital behind ". ".
std::vector<std::string> Sentences(const std::string& text) {
  std::vector<std::string> sentences;
  std::size_t begin = 0;
  for (std::size_t i = 0; i + 2 < text.size(); ++i) {
    if (text[i] == '.' && text[i + 1] == ' ' &&
        std::isupper(static_cast<unsigned char>(text[i + 2])) != 0) {
      sentences.push_back(text.substr(begin, i + 1 - begin));
      begin = i + 2;
    }
  }
  if (begin < text.size()) {
    sentences.push_back(text.substr(begin));
  }
  return sentences;
}

void AddChecks(const Episode& episode, const report::FaultTexts& texts,
               report::Report& page) {
  std::string rest = episode.fault.value_or("unknown");
  while (!rest.empty()) {
    const std::size_t bar = rest.find('|');
    const std::string fault = rest.substr(0, bar);
    rest = bar == std::string::npos ? "" : rest.substr(bar + 1);
    const report::FaultWords words = texts.Words(fault, episode.strength);
    page.Line((fault == "unknown" ? PlainName(episode, texts)
                                  : words.name + " (" + fault + ")") +
              ", for " + words.discipline + ":");
    page.Checks(Sentences(words.check));
  }
}

// The page is worth printing without its picture, too: what gnuplot lacks or
// refuses becomes a sentence in its place.
void AddPicture(const EpisodeEvidence& evidence,
                const report::FaultTexts& texts, const GnuplotLimits& limits,
                report::Report& page) {
  if (evidence.trace.empty()) {
    page.Line("There is no recording of this episode.");
    return;
  }
  if (!HaveGnuplot()) {
    page.Line(
        "There is no picture, because gnuplot is not installed; on Debian it "
        "is in gnuplot-nox.");
    return;
  }
  EpisodeFigureOptions options;
  options.fault_name = PlainName(evidence.episode, texts);
  Figure figure = EpisodeFigure(evidence, options);
  figure.width = kPictureWidth;
  figure.legend_width = kLegendWidth;
  figure.groups = kGroups;
  try {
    page.Picture("evidence",
                 "Over time: signals, "
                 "residuals with their thresholds, decision factors",
                 SvgElement(figure, limits));
  } catch (const DataError& error) {
    page.Line(error.what());
  }
}

}  // namespace

std::string IntervalText(double value, double lowest, double highest,
                         int decimals, const std::string& unit) {
  const auto number = [decimals](double x) {
    return report::FormatNumber(x, decimals);
  };
  const std::string from = number(lowest);
  const std::string to = number(highest);
  return number(value) + unit +
         (lowest < highest && from != to ? " (" + from + " to " + to + ")"
                                         : "");
}

std::vector<Column> EpisodeFields(const Alarm& alarm,
                                  const report::FaultTexts& texts, bool utc) {
  const Episode& e = alarm.episode;
  const report::FaultWords words =
      texts.Words(e.fault.value_or(""), e.strength, e.priority);
  const auto when = [&](std::optional<std::int64_t> stamp_ns) {
    return ShownTime(stamp_ns, utc) +
           (stamp_ns ? ", after " + FormatDuration(*stamp_ns - e.detected_ns)
                     : "");
  };
  return {{"episode", "episode_id"},
          {"valve", "valve_id"},
          {"source", "source_id"},
          Field("fault", FaultLine(e, PlainName(e, texts))),
          Field("check", words.check),
          Field("severity", std::string(SeverityName(words.severity)) +
                                ", priority " +
                                std::to_string(PriorityOf(words.severity)) +
                                " (" + words.discipline + "; NAMUR NE 107 " +
                                std::string(NamurName(words.namur)) + ")"),
          Field("alarm", AlarmLine(alarm, utc)),
          {"detected", "detected_utc", report::Format::kTime},
          Field("isolated", when(e.isolated_ns)),
          Field("cleared", when(e.cleared_ns)),
          Field("ended", ShownTime(e.ended_ns, utc) + " " +
                             e.end_reason.value_or("(open)")),
          Field("strength", StrengthLine(e)),
          Field("model set",
                e.model_set + " " + storage::EpisodeIdText(e.model_hash)),
          {"label", "label"},
          Field("acknowledged", AckLine(e, utc)),
          {.heading = "trace", .text = [](const Json& episode) {
             return episode["trace_instants"].dump() + " instants";
           }}};
}

// What came on top of the fault that the episode is named after.
std::string SecondSentence(const HistoryEntry& event,
                           const report::FaultTexts& texts) {
  const std::string name = NameAndFault(event.faults, texts);
  return event.value == "none" ? name + " is alone again."
         : event.value == "unknown"
             ? "More than one fault, among them " + name + "."
             : "A second fault on top of " + name + ": " +
                   NameAndFault(event.value, texts) + ".";
}

std::string EventSentence(const HistoryEntry& event,
                          const report::FaultTexts& texts) {
  if (!event.who.empty()) {
    return ActionSentence(event, texts);
  }
  if (event.kind == "DETECTED") {
    return "Detected: the readings no longer agree with the normal model.";
  }
  if (event.kind == "CLEARED") {
    return "The readings agree with the normal model again.";
  }
  if (event.kind == "CLOSED") {
    return "The episode ended: " + EndText(event.reason) + ".";
  }
  if (event.kind == "RESUMED") {
    return "The monitor was started again and went on with the episode.";
  }
  if (event.kind == "SECOND") {
    return SecondSentence(event, texts);
  }
  std::string text = event.kind == "ISOLATED"     ? "Named "
                     : event.kind == "REISOLATED" ? "The name became "
                                                  : "Grown worse: ";
  if (event.faults.empty()) {
    text = event.kind == "REISOLATED" ? "The name was taken back: no" : "No";
    text += " known fault explains the readings";
  } else {
    text += NameAndFault(event.faults, texts);
    text.append(ByLayer(event.layer));
    text += event.value.empty()
                ? ", strength " + report::FormatNumber(event.strength, 2)
                : ": " + event.value;
  }
  const auto severity =
      event.priority ? SeverityOf(*event.priority) : std::nullopt;
  return text +
         (severity ? ", severity " + std::string(SeverityName(*severity))
                   : "") +
         ".";
}

std::string EpisodeTitle(const Episode& episode,
                         const report::FaultTexts& texts) {
  return episode.valve_id + ": " + PlainName(episode, texts);
}

std::string PlainName(const Episode& episode, const report::FaultTexts& texts) {
  const std::string_view no_name = storage::NoNameText(episode);
  return no_name.empty() ? texts.Words(episode.fault.value_or(""), 0.0).name
                         : std::string(no_name);
}

report::Report EpisodePage(const EpisodeEvidence& evidence, const Alarm& alarm,
                           const report::FaultTexts& texts, bool utc,
                           const GnuplotLimits& limits) {
  const Episode& e = evidence.episode;
  report::Report page;
  const auto text_or_null = [](const std::optional<std::string>& text) {
    return text ? Json(*text) : Json();
  };
  page.document = {{"episode_id", e.episode_id},
                   {"valve_id", e.valve_id},
                   {"source_id", storage::EpisodeIdText(e.source_id)},
                   {"detected_utc", FormatTime(e.detected_ns, true)},
                   {"label", text_or_null(e.label)},
                   {"acked_by", text_or_null(e.acked_by)},
                   {"trace_instants", evidence.trace.size()},
                   {"story", StoryJson(evidence, texts)}};
  std::vector<Column> fields = EpisodeFields(alarm, texts, utc);
  // What to check has a part of its own.
  std::erase_if(fields, [](const Column& f) { return f.heading == "check"; });
  page.Fields("", std::move(fields));
  page.Heading("What happened");
  page.Table("story",
             {{"at", "stamp_utc", report::Format::kTime},
              {.heading = "after the start",
               .key = "after",
               .align = report::Align::kRight},
              {.heading = "event", .key = "text", .wraps = true}},
             "No event is stored.");
  if (evidence.look) {
    page.Line(LookText(*evidence.look, texts, utc));
  }
  page.Heading("What to check");
  AddChecks(e, texts, page);
  page.Heading("What was found");
  page.Blanks({"Looked at by", "Date and time", "As found", "Cause",
               "Work done, parts used", "As left"});
  page.Checks({"The name was right.", "There was no fault.",
               "There was another fault: ____________________"});
  page.Line(
      "To record it, so that the next model set learns from it:\n"
      "fdi-store history label " +
      e.episode_id + " true|false|FAULT --by NAME --comment TEXT");
  // Last, so that what is to be done fits on the first sheet.
  AddPicture(evidence, texts, limits, page);
  return page;
}

}  // namespace fdi::plot
