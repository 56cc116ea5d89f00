#include <vector>

#include "idl/participant.h"
#include "programs/gateway/verbs.h"
#include "report/examples.h"
#include "report/program.h"
#include "storage/database/database.h"

namespace {

// Shown by --help and in the manual pages.
std::vector<fdi::report::VerbExamples> Examples() {
  return {
      {"",
       {{"All valves of the table from a client that prints readings",
         "fdi-gateway in --plant plant.toml --lines -"},
        {"What is wrong with which valve, for the plant's own system",
         "fdi-gateway out --mqtt mqtt://127.0.0.1 --site north"}}},
      {"in",
       {{"From a broker, by the topics of the table",
         "fdi-gateway in --plant plant.toml --mqtt mqtts://fdi@broker.example "
         "--password-file password"},
        {"From the Sparkplug B nodes of a group",
         "fdi-gateway in --plant plant.toml --mqtt mqtt://127.0.0.1 "
         "--sparkplug PLANT"},
        {"From a named pipe; what came of each tag is at 127.0.0.1:9465/tags",
         "fdi-gateway in --plant plant.toml --lines readings --http 9465"}}},
      {"out",
       {{"All valves, to a broker on this host",
         "fdi-gateway out --mqtt mqtt://127.0.0.1"},
        {"Those of one hall, encrypted, with a certificate",
         "fdi-gateway out --mqtt mqtts://broker.example --valve 'H1-*' --ca "
         "ca.pem --certificate fdi.pem --key fdi.key"}}}};
}

}  // namespace

int main(int argc, char** argv) {
  fdi::report::Program program(
      "fdi-gateway",
      "The plant's wire: readings of all valves in, findings out");
  program.AddBusOptions();
  program.MapError<fdi::storage::SqliteError>(fdi::report::kExitData);
  program.MapError<fdi::idl::TransportError>(fdi::report::kExitTransport);
  fdi::gateway::AddInVerb(program);
  fdi::gateway::AddOutVerb(program);
  program.AddExamples(Examples());
  return program.Run(argc, argv);
}
