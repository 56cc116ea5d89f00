#pragma once

#include "storage/cli/program.h"

namespace fdi::storage {

// Each adds the verbs of one group of fdi-store.
void AddRunsVerbs(cli::Program& program);     ///< runs list|show|import|...
void AddModelsVerbs(cli::Program& program);   ///< models list|show|...
void AddValvesVerbs(cli::Program& program);   ///< valves list|show|add|...
void AddTypesVerbs(cli::Program& program);    ///< types list|show|delete
void AddHistoryVerbs(cli::Program& program);  ///< history list|show|ack|...
/// history export; after AddHistoryVerbs().
void AddEvidenceVerbs(cli::Program& program);
/// history plot, runs plot; after AddHistoryVerbs() and AddRunsVerbs().
void AddPlotVerbs(cli::Program& program);
/// history causes; after AddHistoryVerbs().
void AddCausesVerb(cli::Program& program);
void AddFaultsVerb(cli::Program& program);        ///< faults
void AddHealthVerbs(cli::Program& program);       ///< health show|trend
void AddWorkListVerb(cli::Program& program);      ///< worklist
void AddShadowVerb(cli::Program& program);        ///< history shadow; likewise
void AddMaintenanceVerbs(cli::Program& program);  ///< doctor, backup, migrate
void AddPruneVerb(cli::Program& program);         ///< prune

}  // namespace fdi::storage
