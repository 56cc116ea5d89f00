#pragma once

#include <cstdlib>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <sys/wait.h>

#include "tests/storage/history_fixture.h"

namespace fdi::storage {

using nlohmann::json;

/// Exit code and output of a program.
struct Outcome {
  int code{-1};
  std::string out;
  std::string err;
};

/// The built fdi-store on a fresh folder.
class FdiStoreTest : public HistoryFixture {
 protected:
  static std::string Slurp(const std::filesystem::path& path) {
    std::ostringstream text;
    text << std::ifstream(path, std::ios::binary).rdbuf();
    return text.str();
  }

  // In the fresh folder, which is the data directory, too, unless a test has
  // another one.
  Outcome Store(const std::string& arguments,
                const std::string& environment = "TZ=UTC") {
    const std::string command = "cd " + directory_.path().string() + " && " +
                                environment +
                                " \"" FDI_STORE_PROGRAM "\" --data " + data_ +
                                " " + arguments + " >out.txt 2>err.txt";
    const int status = std::system(command.c_str());
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -1,
            Slurp(directory_.path() / "out.txt"),
            Slurp(directory_.path() / "err.txt")};
  }
  json StoreJson(const std::string& arguments) {
    const Outcome outcome = Store(arguments + " --json");
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    return outcome.code == 0 ? json::parse(outcome.out) : json();
  }

  void Write(const std::string& name, const std::string& text) {
    std::ofstream(directory_.path() / name) << text;
  }
  bool RunsAreStored() const {
    return std::filesystem::exists(directory_.path() / "runs.db");
  }
  static std::vector<std::string> KeysOf(const json& object) {
    std::vector<std::string> keys;
    for (const auto& [key, value] : object.items()) {
      keys.push_back(key);
    }
    return keys;
  }
  static std::string Rows(int count, int first = 0) {
    std::string rows;
    for (int t = first; t < first + count; ++t) {
      rows += std::to_string(t) + ",40.5,3500,2600,130,41,22.25\n";
    }
    return rows;
  }

  std::string data_{"."};
  const std::string header_ = "t_s,CV_pct,P1_kPa,P2_kPa,T1_degC,X_pct,F_t_h\n";
};

}  // namespace fdi::storage
