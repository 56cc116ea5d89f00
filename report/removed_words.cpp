#include "report/removed_words.h"

#include <algorithm>
#include <array>

namespace fdi::report {
namespace {

struct Removed {
  std::string_view program;
  std::string_view verb;  ///< "*": any verb of the program.
  std::string_view name;
  std::string_view instead;
};

constexpr std::string_view kStudyEvaluate =
    "fdi-study evaluate has it, which the source tree builds with "
    "-DFDI_BENCH=ON";
constexpr std::string_view kStudyBaseline =
    "it is fdi-study baseline, which the source tree builds with "
    "-DFDI_BENCH=ON";
constexpr std::string_view kStudyReduce =
    "it is fdi-study reduce, which the source tree builds with -DFDI_BENCH=ON";
constexpr std::string_view kWorkOrders =
    "score each file with --file, or replay it into a monitor (fdi-simulator "
    "replay --file FILE) and compare fdi-store history list with the work "
    "orders";
constexpr std::string_view kCompare =
    "record with --record, then compare the two sets with fdi-trainer compare "
    "SET@1 SET@2 --runs ID,...";
constexpr std::string_view kElsewhere =
    "let a cluster manager start the monitor on another host with a copy of "
    "its data folder: docs/operations.md, Another host takes over";
constexpr std::string_view kUsers =
    "nginx asks for names and passwords, and proves itself by --console-proxy "
    "FILE (docs/console.md, The page beyond this host)";
constexpr std::string_view kCertificate =
    "nginx has the certificate (docs/console.md, The page beyond this host)";

constexpr std::string_view kEpisodesAsCsv =
    "fdi-store history list --csv writes the list";
constexpr std::string_view kDecimal =
    "decimal = \",\" under [file] of --map (fdi-store runs sniff writes it)";
constexpr std::string_view kDate =
    "date = \"d/m/y\" under [time] of --map (fdi-store runs sniff writes it)";
constexpr std::string_view kSkip =
    "skip = 3 under [file] of --map (fdi-store runs sniff writes it)";

// In the order of programs and verbs; "*" is any program.
constexpr auto kRemoved = std::to_array<Removed>({
    {"*", "*", "--decimal", kDecimal},
    {"*", "*", "--date", kDate},
    {"*", "*", "--skip", kSkip},
    {"*", "*", "--fault-catalogue",
     "faults.toml in the data directory has names and advice of your own"},
    {"*", "*", "--print-config", "--help-all has every option and its value"},
    {"fdi-simulator", "", "faults", "fdi-store faults lists them"},
    {"fdi-simulator", "run", "--valves", "--count N"},
    {"fdi-simulator", "run", "--export", "-o FILE"},
    {"fdi-simulator", "run", "--cold-start", "--set cold_start=true"},
    {"fdi-simulator", "*", "--end-now",
     "at any speed the last stamp is the present time, unless --start states "
     "the first"},
    {"fdi-simulator", "replay", "--csv", "--file FILE"},
    {"fdi-simulator", "replay", "--period",
     "a file tells its period; samples that arrive one by one are readings for "
     "fdi-gateway in --lines -"},
    {"fdi-store", "", "keys",
     "the script fdi-keys makes, renews and lists keys"},
    {"fdi-store", "", "migrate",
     "fdi-store doctor brings the databases up to date"},
    {"fdi-store", "", "report",
     "fdi-store worklist --html FILE writes the page"},
    {"fdi-store", "*", "--since", "--from TIME"},
    {"fdi-store", "*", "--until", "--to TIME"},
    {"fdi-store", "runs sniff", "--map-output", "-o FILE"},
    {"fdi-store", "valves", "event", "fdi-store valves repaired VALVE WHAT"},
    {"fdi-store", "valves add", "--model-set", "fdi-store valves assign"},
    {"fdi-store", "valves add", "--epoch",
     "fdi-store valves repaired begins the next epoch"},
    {"fdi-store", "valves move", "--to", "the folder follows the valve"},
    {"fdi-store", "types", "delete",
     "a type is written over by fdi-trainer onboard --save-type"},
    {"fdi-store", "history", "unshelve",
     "fdi-store history shelve VALVE --off"},
    {"fdi-store", "history", "shelf", "fdi-store history list --shelved"},
    {"fdi-store", "history list", "--limit", "--rows N"},
    {"fdi-store", "history ack", "--all", "--valve '*'"},
    {"fdi-store", "history ack", "--limit", "--from TIME"},
    {"fdi-store", "history export", "--limit", kEpisodesAsCsv},
    {"fdi-store", "history export", "--valve", kEpisodesAsCsv},
    {"fdi-store", "history export", "--fault", kEpisodesAsCsv},
    {"fdi-store", "history export", "--state", kEpisodesAsCsv},
    {"fdi-store", "history export", "--from", kEpisodesAsCsv},
    {"fdi-store", "history export", "--to", kEpisodesAsCsv},
    {"fdi-store", "health", "show", "fdi-store health --valve ID"},
    {"fdi-store", "health", "trend",
     "fdi-store health --valve ID --limit NAME=VALUE"},
    {"fdi-store", "worklist", "--top", "--rows N"},
    {"fdi-store", "worklist", "--horizon",
     "trends that reach their limit after 180 days are left out"},
    {"fdi-store", "runs", "plot",
     "fdi-store runs export writes its samples as CSV"},
    {"fdi-store", "history", "shadow",
     "fdi-trainer compare compares two model sets on recorded runs"},
    {"fdi-store", "history", "stats",
     "fdi-store worklist has the figures of the alarms (--json, --html)"},
    {"fdi-store", "history", "causes",
     "fdi-store worklist has common causes (--json, --html)"},
    {"fdi-store", "history", "report",
     "print the episode on the page of the monitor; fdi-store history show "
     "says the same in text, and fdi-store history plot draws its picture"},
    {"fdi-store", "ship", "--to", "--db URL"},
    {"fdi-store", "ship", "--prune", "fdi-store prune --db URL"},
    {"fdi-store", "ship", "--history-age", "fdi-store prune --db URL"},
    {"fdi-store", "ship", "--health-age", "fdi-store prune --db URL"},
    {"fdi-store", "prune", "--shadow-age",
     "differences of a candidate are no longer recorded"},
    {"fdi-store", "audit", "--ps",
     "stroke tests are no longer evaluated; fdi-store health has dead time, "
     "T63 and T86 of ordinary steps"},
    {"fdi-trainer", "", "coverage",
     "fdi-trainer onboard --dry-run --signals CV,X,... shows what could be "
     "seen"},
    {"fdi-trainer", "*", "--threads", "--jobs N"},
    {"fdi-trainer", "onboard", "--rows", "--valve GLOB"},
    {"fdi-trainer", "onboard", "--gains",
     "--dry-run with --signals CV,X,F and with --signals CV,X,F,P1 show what "
     "P1 would add"},
    {"fdi-trainer", "train", "--print-campaign",
     "fdi-store runs show ID has the scenario of each run"},
    {"fdi-trainer", "onboard", "--no-fit",
     "a type that was stored with --save-type is taken as it is"},
    {"fdi-trainer", "", "inject",
     "it is fdi-study inject, which the source tree builds with "
     "-DFDI_BENCH=ON"},
    {"fdi-trainer", "", "limits",
     "fdi-trainer relearn VALVE sets the limits by what was recorded since"},
    {"fdi-trainer", "train", "--from-labels",
     "fdi-trainer relearn VALVE learns from what episodes were labelled"},
    {"fdi-trainer", "onboard", "--shard",
     "--valve GLOB takes a part of the table, and processes may work on one "
     "data directory at a time"},
    {"fdi-trainer", "onboard", "--extend",
     "fdi-trainer relearn VALVE --models makes the models anew with more "
     "hours"},
    {"fdi-trainer", "onboard", "--accept",
     "fdi-trainer relearn VALVE --activate takes a set that is worse"},
    {"fdi-trainer", "evaluate", "--campaign", kStudyEvaluate},
    {"fdi-trainer", "evaluate", "--seed-offset", kStudyEvaluate},
    {"fdi-trainer", "evaluate", "--report", kStudyEvaluate},
    {"fdi-trainer", "evaluate", "--vectors", kStudyEvaluate},
    {"fdi-trainer", "evaluate", "--no-second-look", kStudyEvaluate},
    {"fdi-trainer", "evaluate", "--leave-one-out",
     "it is fdi-study leave-one-out, which the source tree builds with "
     "-DFDI_BENCH=ON"},
    {"fdi-trainer", "evaluate", "--seeds",
     "it is fdi-study seeds, which the source tree builds with "
     "-DFDI_BENCH=ON"},
    {"fdi-trainer", "evaluate", "--verdicts",
     "it is fdi-study verdicts, which the source tree builds with "
     "-DFDI_BENCH=ON"},
    {"fdi-trainer", "evaluate", "--baseline", kStudyBaseline},
    {"fdi-trainer", "evaluate", "--train-runs", kStudyBaseline},
    {"fdi-trainer", "evaluate", "--train-file", kStudyBaseline},
    {"fdi-trainer", "evaluate", "--without", kStudyReduce},
    {"fdi-trainer", "evaluate", "--without-channels", kStudyReduce},
    {"fdi-trainer", "evaluate", "--history", kWorkOrders},
    {"fdi-trainer", "evaluate", "--work-orders", kWorkOrders},
    {"fdi-trainer", "evaluate", "--horizon", kWorkOrders},
    {"fdi-trainer", "compare", "--campaign",
     "fdi-study evaluate --campaign scores one set after the other, and "
     "stores the runs, which --runs compares"},
    {"fdi-trainer", "compare", "--seed-offset", kStudyEvaluate},
    {"fdi-trainer", "show", "--pictures",
     "it is fdi-study pictures, which the source tree builds with "
     "-DFDI_BENCH=ON"},
    {"fdi-monitor", "*", "--valves", "--valve GLOB"},
    {"fdi-monitor", "console", "--from", "--db URL"},
    {"fdi-monitor", "watch", "--count", "--totals"},
    {"fdi-monitor", "watch", "--idle", "--for S"},
    {"fdi-monitor", "run", "--trace-before",
     "evidence of 1800 s before a detection is kept"},
    {"fdi-monitor", "run", "--on-event-timeout",
     "a delivery is abandoned after 10 s"},
    {"fdi-monitor", "", "top", "fdi-monitor watch --table shows the valves"},
    {"fdi-monitor", "", "console-user",
     "users are in a file of nginx, which htpasswd makes, and their roles in a "
     "second one (docs/console.md, The page beyond this host)"},
    {"fdi-monitor", "run", "--allow-host",
     "nginx answers under other names (docs/console.md, The page beyond this "
     "host)"},
    {"fdi-monitor", "run", "--shadow", kCompare},
    {"fdi-monitor", "run", "--shadow-valves", kCompare},
    {"fdi-monitor", "run", "--pair", kElsewhere},
    {"fdi-monitor", "run", "--rank", kElsewhere},
    {"fdi-monitor", "run", "--pair-patience", kElsewhere},
    {"fdi-monitor", "*", "--console-users", kUsers},
    {"fdi-monitor", "*", "--console-proxy-user", kUsers},
    {"fdi-monitor", "*", "--console-proxy-from", kUsers},
    {"fdi-monitor", "*", "--console-write", kUsers},
    {"fdi-monitor", "*", "--console-tls", kCertificate},
    {"fdi-monitor", "*", "--console-key", kCertificate},
});

}  // namespace

std::optional<std::string> RemovedWord(std::string_view program,
                                       std::string_view verb,
                                       std::string_view name) {
  const auto found = std::ranges::find_if(kRemoved, [&](const Removed& row) {
    return (row.program == program || row.program == "*") && row.name == name &&
           (row.verb == verb || row.verb == "*");
  });
  if (found == kRemoved.end()) {
    return std::nullopt;
  }
  return std::string(name) + " is gone: " + std::string(found->instead);
}

}  // namespace fdi::report
