#pragma once

#include <string>

#include <nlohmann/json.hpp>

#include "tests/programs/trainer/fixture.h"

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

}  // namespace fdi::trainer::study
