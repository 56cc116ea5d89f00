#include "gateway/intake.h"

#include <chrono>
#include <utility>

#include "base/error.h"
#include "base/log.h"
#include "base/time_text.h"
#include "base/time_units.h"

namespace fdi::gateway {
namespace {

using importer::AssemblyNote;
using importer::Taken;
using std::chrono::milliseconds;

// Long enough to cost nothing, short beside a period.
constexpr milliseconds kPoll(50);

importer::ArrivalTime Now() {
  return {NowNs(), std::chrono::duration_cast<std::chrono::nanoseconds>(
                       std::chrono::steady_clock::now().time_since_epoch())
                       .count()};
}

LiveTable ReadTable(const IntakeOptions& options) {
  LiveTable table = ReadLiveTable(options.plant, options.by_topics);
  if (table.valves.empty()) {
    throw ConfigError(options.plant.string() + ": no row is usable; " +
                      table.refused.front().place + ": " +
                      table.refused.front().why);
  }
  return table;
}

}  // namespace

Intake::Intake(const IntakeOptions& options, ReadingSource& source,
               const report::Context& context, report::StopSignals& signals)
    : options_(options),
      source_(source),
      context_(context),
      signals_(signals),
      calm_(context.log),
      table_(ReadTable(options)),
      assembler_({table_.period_ns, options.lateness_ns}, table_.valves,
                 [this](const AssemblyNote& note) { Say(note); }),
      wire_({table_.valves.size(), options.by_group, source.may_wait()},
            context, signals) {
  Use();
}

void Intake::Use() {
  wire_.Use(table_.valves);
  source_.Use(table_);
  for (const RefusedRow& row : table_.refused) {
    context_.log(LogLevel::kWarning,
                 EventLine("row_refused", {{"valve", row.name},
                                           {"place", row.place},
                                           {"reason", row.why}}));
  }
}

// A table that cannot be read leaves the present one in use.
void Intake::Reload() {
  LiveTable table;
  try {
    table = ReadTable(options_);
    if (table.period_ns != table_.period_ns) {
      throw ConfigError(
          "resample has changed, which takes a new start of the gateway");
    }
    if (table.valves.size() > wire_.room()) {
      throw ConfigError(std::to_string(table.valves.size()) +
                        " valves; this gateway was started with room for " +
                        std::to_string(wire_.room()) +
                        ", and more take a new start");
    }
  } catch (const std::exception& error) {
    context_.log(LogLevel::kWarning,
                 EventLine("table_refused", {{"file", options_.plant.string()},
                                             {"reason", error.what()}}));
    return;
  }
  table_ = std::move(table);
  assembler_.Replace(table_.valves);
  Use();
  context_.log(LogLevel::kInfo,
               EventLine("table_read",
                         {{"file", options_.plant.string()},
                          {"valves", std::to_string(table_.valves.size())},
                          {"refused", std::to_string(table_.refused.size())}}));
}

void Intake::Take(const importer::TagReading& reading) {
  ++totals_.readings;
  const std::string tag(reading.tag);
  const auto refuse = [&](const std::string& why) {
    calm_.Warn("reading_refused", tag, {{"tag", tag}, {"reason", why}});
  };
  switch (assembler_.Take(reading, Now())) {
    case Taken::kTaken:
      totals_.bad += reading.quality == SignalQuality::kBad ? 1U : 0U;
      break;
    case Taken::kUnknownTag:
      ++totals_.unknown;
      calm_.Warn("tag_unknown", tag,
                 {{"tag", tag}, {"effect", "no row of the table has it"}});
      break;
    case Taken::kBadStamp:
      ++totals_.bad;
      refuse("its stamp is " + FormatTime(reading.stamp_ns.value_or(0), true) +
             ", before 2000 or more than an hour ahead of this host");
      break;
    case Taken::kBadValue:
      ++totals_.bad;
      refuse(reading.value
                 ? std::to_string(*reading.value) + " is beyond its range"
                 : "'" + std::string(reading.word) +
                       "' is neither a number nor the word of a "
                       "mode");
      break;
    case Taken::kLate:
      ++totals_.late;
      break;
  }
}

void Intake::Say(const AssemblyNote& note) {
  static constexpr struct {
    AssemblyNote::Kind kind;
    const char* event;
    const char* effect;
  } kEvents[] = {
      {AssemblyNote::Kind::kSourceSilent, "source_silent",
       "what it said is not held"},
      {AssemblyNote::Kind::kSourceBack, "source_back", ""},
      {AssemblyNote::Kind::kClockLeaps, "source_clock_leaps", "a gap"},
      {AssemblyNote::Kind::kClockBack, "source_clock_back", "a gap"},
      {AssemblyNote::Kind::kTagSilent, "tag_silent", "the signal is missing"},
      {AssemblyNote::Kind::kTagBack, "tag_back", ""}};
  const auto& event = kEvents[static_cast<std::size_t>(note.kind)];
  const std::string name = note.name.empty() ? std::string("input") : note.name;
  const bool back = *event.effect == '\0';
  if (back) {
    context_.log(LogLevel::kInfo, EventLine(event.event, {{"name", name}}));
    return;
  }
  calm_.Warn(event.event, name,
             {{"name", name},
              {"by", FormatDuration(note.by_ns)},
              {"effect", event.effect}});
}

ReadingHandlers Intake::Handlers() {
  return {[this](const importer::TagReading& reading) { Take(reading); },
          [this](std::string_view source, std::optional<std::int64_t> stamp) {
            assembler_.Alive(source, stamp, Now());
          },
          [this](std::string_view source) { assembler_.End(source); },
          [this](std::string_view about, std::string_view why) {
            ++totals_.wrong;
            calm_.Warn(
                "reading_refused", std::string(about),
                {{"tag", std::string(about)}, {"reason", std::string(why)}});
          }};
}

importer::Assembler::Sink Intake::Sink() {
  return [this](const importer::LiveValve& valve, const Sample& sample) {
    try {
      wire_.Publish(valve.id, sample);
    } catch (const DataError& error) {
      calm_.Warn("sample_refused", valve.id,
                 {{"valve", valve.id}, {"reason", error.what()}});
    }
  };
}

void Intake::Run(Duties& duties) {
  wire_.AwaitReader();
  const std::string ready = EventLine(
      "gateway_ready", {{"valves", std::to_string(table_.valves.size())},
                        {"refused", std::to_string(table_.refused.size())}});
  context_.log(LogLevel::kInfo, ready);
  duties.Ready(ready);
  const ReadingHandlers handlers = Handlers();
  const importer::Assembler::Sink sink = Sink();
  bool more = true;
  while (more) {
    const auto event = signals_.WaitFor(milliseconds(0));
    if (event == report::StopSignals::Event::kStop) {
      break;
    }
    if (event == report::StopSignals::Event::kReload) {
      Reload();
    }
    more = source_.Poll(kPoll, handlers);
    assembler_.Advance(Now(), sink);
    if (duties.Tick([this] { return Metrics(); },
                    [this] { return TagsPage(); })) {
      wire_.RequireInterfaces();
    }
  }
  if (!signals_.stop_requested()) {
    assembler_.Finish(sink);
  }
  wire_.Finish();
}

std::vector<Metric> Intake::Metrics() const {
  const auto [alive, all] = assembler_.sources();
  return {{"readings_total", "Readings that came.", totals_.readings},
          {"bad_readings_total", "Of these without a usable value or stamp.",
           totals_.bad},
          {"late_readings_total", "Of these after their instant was written.",
           totals_.late},
          {"unknown_readings_total", "Of these of tags that no row has.",
           totals_.unknown},
          {"unreadable_total", "Lines and payloads that say nothing.",
           totals_.wrong},
          {"dropped_readings_total",
           "Readings dropped because they came too fast.", source_.dropped()},
          {"samples_total", "Samples that were published.", wire_.sent()},
          {"samples_not_sent_total", "Samples for which there was no room.",
           wire_.not_sent()},
          {"valves", "Rows of the table in use.", assembler_.valves()},
          {"rows_refused", "Rows of the table that are refused.",
           table_.refused.size()},
          {"sources", "Sources that live, or that a tag waits for.", all},
          {"sources_alive", "Of these alive.", alive},
          {"readers", "Readers of the samples.",
           static_cast<std::uint64_t>(wire_.readers())}};
}

std::string Intake::TagsPage() const {
  report::Json tags = report::Json::array();
  for (const auto& [name, counts] : assembler_.tags()) {
    tags.push_back(
        {{"tag", name},
         {"readings", counts.readings},
         {"bad", counts.bad},
         {"late", counts.late},
         {"held", counts.held},
         {"newest_utc", counts.stamp_ns == 0
                            ? report::Json()
                            : report::Json(FormatTime(counts.stamp_ns, true))},
         {"silent", counts.silent}});
  }
  report::Json rows = report::Json::array();
  for (const RefusedRow& row : table_.refused) {
    rows.push_back(
        {{"valve_id", row.name}, {"place", row.place}, {"reason", row.why}});
  }
  return report::JsonText({{"tags", tags}, {"refused", rows}}) + '\n';
}

report::Json Intake::Summary() const {
  return {
      {"valves", assembler_.valves()}, {"rows_refused", table_.refused.size()},
      {"readings", totals_.readings},  {"bad", totals_.bad},
      {"late", totals_.late},          {"unknown", totals_.unknown},
      {"unreadable", totals_.wrong},   {"dropped", source_.dropped()},
      {"samples", wire_.sent()},       {"not_sent", wire_.not_sent()},
      {"readers", wire_.readers()}};
}

}  // namespace fdi::gateway
