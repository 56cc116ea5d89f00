#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "import/tag_map.h"
#include "report/program.h"
#include "report/report.h"
#include "trainer/onboarding/onboarding.h"

namespace CLI {
class App;
}

namespace fdi::trainer {

/// Options of `onboard --plant`.
struct PlantVerbOptions {
  std::filesystem::path plant;
  int jobs{0};             ///< Rows at a time; 0: one per core.
  std::string valve{"*"};  ///< Glob of names.
  bool dry_run{false};

  void AddTo(CLI::App& verb);
};

/// Onboards every row of the table, or says what would be done.
/// @param onboarding of every row; its name and type are those of the row.
/// @param files as --file gives them; none: those of the table.
report::Report OnboardFromTable(const PlantVerbOptions& options,
                                const std::vector<std::string>& files,
                                const importer::TableOptions& form,
                                const OnboardingOptions& onboarding,
                                const report::Context& context);

}  // namespace fdi::trainer
