#pragma once

#include <string>

#include "tests/programs/trainer/trained_runs.h"

namespace fdi::trainer::study {

/// Runs the built fdi-study beside fdi-trainer, in one folder.
template <typename Trainer>
class WithStudy : public Trainer {
 protected:
  Outcome Study(const std::string& arguments) const {
    return this->Run(arguments, "data", FDI_STUDY_PROGRAM);
  }
  nlohmann::json StudyJson(const std::string& arguments) const {
    return this->RunJson(arguments, "data", FDI_STUDY_PROGRAM);
  }
};

using StudyProgram = WithStudy<TrainerProgram>;
using StudyOfRuns = WithStudy<TrainedRuns>;

}  // namespace fdi::trainer::study
