#pragma once

#include <string>

#include "tests/programs/trainer/fixture.h"

namespace fdi::trainer::study {

/// Runs the built fdi-study beside fdi-trainer, in one folder.
class StudyProgram : public TrainerProgram {
 protected:
  Outcome Study(const std::string& arguments) const {
    return Run(arguments, "data", FDI_STUDY_PROGRAM);
  }
  nlohmann::json StudyJson(const std::string& arguments) const {
    return RunJson(arguments, "data", FDI_STUDY_PROGRAM);
  }
};

}  // namespace fdi::trainer::study
