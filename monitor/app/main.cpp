#include "idl/participant.h"
#include "monitor/app/examples.h"
#include "monitor/app/verbs.h"
#include "storage/cli/program.h"

int main(int argc, char** argv) {
  fdi::cli::Program program("fdi-monitor",
                            "Recognises which fault a control valve has");
  program.MapError<fdi::idl::TransportError>(fdi::cli::kExitTransport);
  fdi::monitor::AddRunVerb(program);
  fdi::monitor::AddWatchVerb(program);
  fdi::monitor::AddTopVerb(program);
  program.AddExamples(fdi::monitor::Examples());
  return program.Run(argc, argv);
}
