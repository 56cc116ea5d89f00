#include <vector>

#include "idl/participant.h"
#include "programs/monitor/verbs.h"
#include "report/examples.h"
#include "report/program.h"
#include "storage/database/database.h"

namespace {

// Shown by --help and in the manual pages.
std::vector<fdi::report::VerbExamples> Examples() {
  return {
      {"",
       {{"Diagnose what is on the bus, with a page to look at",
         "fdi-monitor run --model-set paper --console"},
        {"The same, and store the samples",
         "fdi-monitor run --model-set paper --record"},
        {"Watch it in another terminal", "fdi-monitor watch --table"}}},
      {"run",
       {{"Every valve with the set that is assigned to it; store the samples",
         "fdi-monitor run --record"},
        {"One set for the valves FV-1..., open to the plant network",
         "fdi-monitor run --model-set paper@2 --valve 'FV-1*' --interface "
         "all"},
        {"A page behind nginx, through which people acknowledge and label",
         "fdi-monitor run --console --console-proxy proxy-secret"}}},
      {"watch",
       {{"All fault events as JSON lines", "fdi-monitor watch --events --json"},
        {"How many vectors come in ten seconds",
         "fdi-monitor watch --totals --for 10"},
        {"A table of the valves, the worst first; for a script",
         "fdi-monitor watch --table --for 3 --valve 'FV-1*'"}}},
      {"console",
       {{"One page of all monitors, with the plant's history",
         "fdi-monitor console --db postgresql://screen@db.example/plant"},
        {"On another port, of one hall",
         "fdi-monitor console --db postgresql://screen@db.example/plant "
         "--listen 8082 --valve 'H1-*'"}}},
  };
}

}  // namespace

int main(int argc, char** argv) {
  fdi::report::Program program("fdi-monitor",
                               "Recognises which fault a control valve has");
  program.AddBusOptions();
  program.MapError<fdi::storage::SqliteError>(fdi::report::kExitData);
  program.MapError<fdi::idl::TransportError>(fdi::report::kExitTransport);
  fdi::monitor::AddRunVerb(program);
  fdi::monitor::AddWatchVerb(program);
  fdi::monitor::AddConsoleVerb(program);
  program.AddExamples(Examples());
  return program.Run(argc, argv);
}
