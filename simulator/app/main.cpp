#include "idl/participant.h"
#include "simulator/app/examples.h"
#include "simulator/app/sample_publisher.h"
#include "simulator/app/verbs.h"
#include "storage/cli/program.h"

int main(int argc, char** argv) {
  using namespace fdi;
  cli::Program program("fdi-simulator",
                       "Control valve with faults: simulates or replays it, "
                       "publishes and records its samples");
  simulator::AddRunVerb(program);
  simulator::AddReplayVerb(program);
  simulator::AddFaultsVerb(program);
  program.MapError<idl::TransportError>(cli::kExitTransport);
  program.MapError<simulator::NoReaderError>(cli::kExitTransport);
  program.AddExamples(simulator::Examples());
  return program.Run(argc, argv);
}
