#include "idl/participant.h"
#include "import/tag_map.h"
#include "programs/simulator/sample_publisher.h"
#include "programs/simulator/verbs.h"
#include "report/program.h"
#include "storage/database/database.h"

namespace fdi::simulator {
namespace {

// Shown by --help and in the manual pages.
std::vector<report::VerbExamples> Examples() {
  return {
      {"",
       {{"A valve whose flow transmitter goes wrong after a minute",
         "fdi-simulator run --valve FV-101 --duration 600 --fault "
         "f19:abrupt@60:strength=0.5"},
        {"The same into a run to train on, without a bus",
         "fdi-simulator run --valve FV-101 --duration 600 --fault "
         "f19:abrupt@60:strength=0.5 --record --no-publish"}}},
      {"run",
       {{"A seat that erodes over 20 minutes, ten times faster than real",
         "fdi-simulator run --valve FV-101 --duration 3600 --fault "
         "f3:incipient@300+1200 --speed 10"},
        {"Ten healthy hours as a run to train on, without a bus",
         "fdi-simulator run --valve FV-101 --duration 36000 --record "
         "--no-publish"},
        {"A hundred valves for a load test",
         "fdi-simulator run --valve FV --count 100 --duration 600"}}},
      {"replay",
       {{"A record of the plant as it was, ten times faster",
         "fdi-simulator replay --file fv101.csv --valve FV-101 --speed 10"},
        {"Part of a stored run", "fdi-simulator replay --run 1a2b@600:1200"}}},
  };
}

}  // namespace
}  // namespace fdi::simulator

int main(int argc, char** argv) {
  namespace report = fdi::report;
  report::Program program("fdi-simulator",
                          "Control valve with faults: simulates or replays it, "
                          "publishes and records its samples");
  program.AddBusOptions();
  fdi::simulator::AddRunVerb(program);
  fdi::simulator::AddReplayVerb(program);
  program.MapError<fdi::storage::SqliteError>(report::kExitData);
  program.MapError<fdi::idl::TransportError>(report::kExitTransport);
  program.MapError<fdi::simulator::NoReaderError>(report::kExitTransport);
  program.AddExamples(fdi::simulator::Examples());
  return program.Run(argc, argv);
}
