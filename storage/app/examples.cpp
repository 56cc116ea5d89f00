#include "storage/app/examples.h"

namespace fdi::storage {
namespace {

std::vector<cli::VerbExamples> HistoryExamples() {
  return {
      {"history",
       {{"What happened in the last two hours",
         "fdi-store history list --since 2h"},
        {"A picture of the newest episode for a report",
         "fdi-store history plot last -o evidence.png"}}},
      {"history list",
       {{"What nobody has acknowledged yet of the valves FV-1...",
         "fdi-store history list --valve 'FV-1*' --state unacked"},
        {"A day of one fault as CSV",
         "fdi-store history list --fault f19 --since 2026-11-20 --until "
         "2026-11-21 --csv > f19.csv"}}},
      {"history show",
       {{"The newest episode, and what to check in the field",
         "fdi-store history show last"},
        {"The beginning of an id will do, as JSON",
         "fdi-store history show 06b84b --json"}}},
      {"history stats",
       {{"A month: how often, how long, chattering, false alarms",
         "fdi-store history stats --since 30d"},
        {"Of one valve", "fdi-store history stats --valve FV-101"}}},
      {"history ack",
       {{"I know of it",
         "fdi-store history ack last --comment 'fitter is on the way'"},
        {"All of one valve that are open or unacknowledged",
         "fdi-store history ack --all --valve FV-101"}}},
      {"history label",
       {{"The answer was right", "fdi-store history label last true"},
        {"It was another fault, as the fitter found",
         "fdi-store history label 06b84b f3 --comment 'seat eroded'"}}},
      {"history shelve",
       {{"Not again before the next shift",
         "fdi-store history shelve FV-101 --for 8h --comment 'on the list'"},
        {"Only one answer, for a week",
         "fdi-store history shelve FV-101 --fault f19 --for 7d"}}},
      {"history unshelve",
       {{"By its number", "fdi-store history unshelve 3"},
        {"All of a valve", "fdi-store history unshelve --valve FV-101"}}},
      {"history shelf",
       {{"What is shelved now", "fdi-store history shelf"},
        {"What ever was", "fdi-store history shelf --all"}}},
      {"history export",
       {{"The samples and decision factors of an episode",
         "fdi-store history export last -o trace.csv"},
        {"All episodes of a year",
         "fdi-store history export --since 2026-01-01 -o episodes.csv"}}},
      {"history plot",
       {{"For a report", "fdi-store history plot last -o evidence.png"},
        {"From a minute before to ten minutes after the start",
         "fdi-store history plot last --from -60 --to 600 -o evidence.svg"}}},
      {"history shadow",
       {{"Where the candidate differed today",
         "fdi-store history shadow --since 1d"},
        {"Of one candidate as CSV",
         "fdi-store history shadow --candidate paper@2 --csv"}}},
  };
}

std::vector<cli::VerbExamples> RunExamples() {
  return {
      {"runs",
       {{"What is stored of a valve", "fdi-store runs list --valve FV-101"},
        {"A picture of ten minutes",
         "fdi-store runs plot 1a2b@600:1200 -o run.png"}}},
      {"runs import",
       {{"A healthy record from the plant",
         "fdi-store runs import fv101.csv --valve FV-101 --assume-normal"},
        {"With other column names and units",
         "fdi-store runs import fv101.csv --valve FV-101 --map tags.toml"}}},
      {"runs export",
       {{"From the tenth minute on as CSV",
         "fdi-store runs export 1a2b@600: --output run.csv"},
        {"Into another program", "fdi-store runs export 1a2b | head"}}},
      {"runs label",
       {{"The flow transmitter was off for five minutes",
         "fdi-store runs label 1a2b@300:600 f19 --strength 0.5"},
        {"Nothing was wrong", "fdi-store runs label 1a2b normal"}}},
      {"runs plot",
       {{"All signals of a run", "fdi-store runs plot 1a2b -o run.png"},
        {"Ten minutes of it", "fdi-store runs plot 1a2b@600:1200 -o run.svg"}}},
      {"models",
       {{"What was trained, and how well it fits", "fdi-store models list"},
        {"Let version 2 answer from now on",
         "fdi-store models activate paper@2"}}},
      {"models export",
       {{"Take a set to another machine",
         "fdi-store models export paper@2 --output paper-2.fdm"},
        {"The version that is active",
         "fdi-store models export paper --output paper.fdm"}}},
      {"types",
       {{"The types that were saved", "fdi-store types list"},
        {"One of them", "fdi-store types show dn50-air"}}},
  };
}

std::vector<cli::VerbExamples> PlantExamples() {
  return {
      {"valves",
       {{"Which entry and model set a valve gets",
         "fdi-store valves show FV-101"},
        {"All valves of a unit get one set",
         "fdi-store valves assign 'FV-1*' paper@2"}}},
      {"valves add",
       {{"A valve without pressure transmitters",
         "fdi-store valves add FV-101 --signals CV,X,F"},
        {"A unit that measures flow in t/h",
         "fdi-store valves add 'FV-2*' --flow-unit t/h"}}},
      {"valves event",
       {{"It was replaced: what was learned of it no longer holds",
         "fdi-store valves event FV-101 --kind replaced --note 'new trim'"},
        {"Last week",
         "fdi-store valves event FV-101 --kind repacked --at "
         "2026-11-14T08:00:00Z"}}},
      {"faults",
       {{"All faults in plain words", "fdi-store faults"},
        {"What to check for one of them", "fdi-store faults f19"}}},
      {"health",
       {{"What three months did to a valve",
         "fdi-store health show --valve FV-101 --since 90d"},
        {"When its flow will be 10 % short",
         "fdi-store health trend --valve FV-101 --limit F=-10%"}}},
      {"worklist",
       {{"Which valves to open at the next stop", "fdi-store worklist"},
        {"For the instrument shop, as CSV",
         "fdi-store worklist --discipline instrument --csv > work.csv"}}},
      {"doctor",
       {{"Are the files sound?", "fdi-store doctor"},
        {"For a script: exit code 3 if not",
         "fdi-store doctor --data /var/lib/fdi --json"}}},
      {"backup",
       {{"While the monitor runs", "fdi-store backup /mnt/backup/fdi-today"},
        {"Of another data directory",
         "fdi-store backup copy --data /var/lib/fdi"}}},
      {"migrate",
       {{"After an update", "fdi-store migrate"},
        {"Of another data directory",
         "fdi-store migrate --data /var/lib/fdi"}}},
      {"prune",
       {{"What would go",
         "fdi-store prune --runs-age 90d --history-age 1000d --dry-run"},
        {"Keep the newest 20 GB of samples",
         "fdi-store prune --runs-size 20GB"}}},
  };
}

}  // namespace

std::vector<cli::VerbExamples> Examples() {
  std::vector<cli::VerbExamples> all = {
      {"",
       {{"What happened since yesterday, and how sure were we",
         "fdi-store history list --since 1d"},
        {"Draw the newest episode", "fdi-store history plot last -o last.png"},
        {"What is in the data directory, and is it sound",
         "fdi-store doctor --data fdi-data"}}}};
  for (const auto& part : {HistoryExamples(), RunExamples(), PlantExamples()}) {
    all.insert(all.end(), part.begin(), part.end());
  }
  return all;
}

}  // namespace fdi::storage
