#include <chrono>
#include <memory>
#include <string>

#include <CLI/CLI.hpp>

#include "base/error.h"
#include "base/text.h"
#include "base/time_text.h"
#include "gateway/intake.h"
#include "gateway/line_source.h"
#include "gateway/mqtt_source.h"
#include "gateway/sparkplug_source.h"
#include "programs/gateway/verbs.h"
#include "report/program.h"
#include "report/stop_signals.h"

namespace fdi::gateway {
namespace {

struct InOptions {
  std::string plant;
  std::string lines;
  MqttOptions mqtt;
  std::string lateness{"2s"};
  std::string http;
  bool by_group{false};
  bool tags{false};
};

std::unique_ptr<ReadingSource> OpenSource(const InOptions& options,
                                          const report::Context& context) {
  if (!options.lines.empty()) {
    return std::make_unique<LineSource>(options.lines);
  }
  if (!options.mqtt.sparkplug.empty()) {
    return std::make_unique<SparkplugSource>(
        options.mqtt, std::chrono::nanoseconds(ParseDuration(options.lateness)),
        context.log);
  }
  return std::make_unique<MqttSource>(options.mqtt, context.log);
}

report::Report ListTags(const std::string& plant) {
  const auto tags = TagsOf(ReadLiveTable(plant, false));
  report::Report report;
  report.document["tags"] = tags;
  return report.Line(JoinText(tags, "\n"));
}

report::Report RunIn(const InOptions& options, const report::Context& context) {
  if (options.plant.empty()) {
    throw ConfigError("--plant FILE is missing: the table of valves and tags");
  }
  if (options.tags) {
    return ListTags(options.plant);
  }
  if (options.lines.empty() == options.mqtt.url.empty()) {
    throw ConfigError("in takes one of --lines FILE|- and --mqtt URL");
  }
  Duties duties(options.http);
  report::StopSignals signals(report::StopSignals::HangUp::kReload);
  // A broker that does not answer, a reader that does not read.
  signals.EndWithin(std::chrono::seconds(5));
  const auto source = OpenSource(options, context);
  Intake intake(
      {.plant = options.plant,
       .by_topics = options.lines.empty() && options.mqtt.sparkplug.empty(),
       .by_group = options.by_group,
       .lateness_ns = ParseDuration(options.lateness)},
      *source, context, signals);
  intake.Run(duties);
  report::Report report;
  report.document = intake.Summary();
  return report.Fields("", {{"valves", "valves"},
                            {"readings", "readings"},
                            {"bad", "bad"},
                            {"late", "late"},
                            {"of unknown tags", "unknown"},
                            {"unreadable", "unreadable"},
                            {"dropped", "dropped"},
                            {"samples", "samples"},
                            {"not sent", "not_sent"}});
}

}  // namespace

void AddInVerb(report::Program& program) {
  auto [verb, options] = AddVerb(
      program, "in", "Readings of the plant become samples on the bus", RunIn);
  verb.add_option("--plant", options.plant,
                  "Table of the valves and their tags (docs/plant.md); read "
                  "again on SIGHUP")
      ->type_name("FILE");
  verb.add_option("--lines", options.lines,
                  "Readings, one a line: JSON or CSV (docs/connect.md)")
      ->type_name("FILE|-");
  options.mqtt.AddTo(verb);
  verb.add_option("--lateness", options.lateness,
                  "How long a sample waits for a source that is late")
      ->type_name("DURATION");
  verb.add_flag("--by-group", options.by_group,
                "Publish the valves of each group in the partition of its "
                "name");
  verb.add_flag("--tags", options.tags,
                "Print the tags of the table, one a line, and exit");
  verb.add_option("--http", options.http,
                  "Serve /metrics, /tags and /healthz on loopback")
      ->type_name("PORT|ADDRESS:PORT");
}

}  // namespace fdi::gateway
