#pragma once

#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <sys/wait.h>

#include "tests/storage/temporary_directory.h"

namespace fdi::trainer {

struct Outcome {
  int code{-1};
  std::string out;
  std::string err;
};

/// Runs the built program in a fresh folder with the data directory `data`.
class TrainerProgram : public ::testing::Test {
 protected:
  std::filesystem::path Path(const std::string& name) const {
    return directory_.path() / name;
  }
  void Write(const std::string& name, const std::string& text) const {
    std::ofstream(Path(name)) << text;
  }
  std::string Read(const std::string& name) const {
    std::ostringstream text;
    text << std::ifstream(Path(name), std::ios::binary).rdbuf();
    return text.str();
  }

  Outcome Run(const std::string& arguments, const std::string& data = "data",
              const std::string& program = FDI_TRAINER_PROGRAM) const {
    const std::string command = "cd " + directory_.path().string() + " && \"" +
                                program + "\" --data " + data + " " +
                                arguments + " >out.txt 2>err.txt";
    const int status = std::system(command.c_str());
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, Read("out.txt"),
            Read("err.txt")};
  }
  nlohmann::json RunJson(
      const std::string& arguments, const std::string& data = "data",
      const std::string& program = FDI_TRAINER_PROGRAM) const {
    const Outcome outcome = Run(arguments + " --json", data, program);
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    return outcome.code == 0 ? nlohmann::json::parse(outcome.out)
                             : nlohmann::json();
  }

  /// The head of a campaign that trains in about a second.
  static std::string Quick(const std::string& name = "quick") {
    return "name = \"" + name +
           "\"\n[training]\nmax_rules = 1\nmax_regressors = 2\nstarts = 1\n"
           "[scenario]\nparameters = \"paper-operating-point\"\n"
           "excitation = {name = \"operating-point\", amplitude_pct = 8, "
           "period_s = 80}\nduration_s = 300\nseed = 1\n";
  }
  /// Normal operation and a flow sensor that reads half.
  static std::string TwoConditions() {
    return "[[run]]\nsimulate = {duration_s = 900}\n"
           "[[run]]\nsimulate = {}\nfaults = [\"f19\"]\nstrengths = [0.5]\n";
  }

  storage::TemporaryDirectory directory_;
};

}  // namespace fdi::trainer
