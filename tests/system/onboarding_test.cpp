// Onboards valves that were never seen with a fault, and scores faults on them:
// the plant's record, and the recordings of an independent valve model.
#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "tests/study/fixture.h"

namespace fdi::trainer {
namespace {

class OnboardingTest : public study::StudyProgram {
 protected:
  void SetUp() override {
    const char* folder = std::getenv("FDI_REFERENCE_DATA");
    if (folder == nullptr) {
      GTEST_SKIP() << "FDI_REFERENCE_DATA is not set";
    }
    folder_ = folder;
  }
  std::string Plant() const {
    return (folder_ / "plant/lublin_actuator3_2001-10-11_first40min.csv")
        .string();
  }
  std::string Reference(const std::string& name) const {
    return (folder_ / "valve-reference" / (name + ".csv")).string();
  }
  // The recording with a reading of `column` at its end every 211 s.
  void WriteSpoilt(const std::string& name, int column,
                   const std::string& end) const {
    std::ifstream in(Reference(name));
    std::ofstream out(Path("spoilt.csv"));
    std::string line;
    for (int row = 0; std::getline(in, line); ++row) {
      std::stringstream cells(line);
      std::string cell;
      for (int c = 0; std::getline(cells, cell, ','); ++c) {
        const bool wrong = c == column && row > 0 && row % 211 == 0;
        out << (c > 0 ? "," : "") << (wrong ? end : cell);
      }
      out << '\n';
    }
  }
  void Onboard(const std::string& name, const std::string& healthy) const {
    const Outcome outcome = Run("onboard --valve " + name + " --file " +
                                healthy + " --no-coverage --json");
    ASSERT_EQ(outcome.code, 0) << outcome.err;
  }

  std::filesystem::path folder_;
};

bool Contains(const nlohmann::json& run) {
  const auto& set = run["final_set"];
  return run["detected"].get<bool>() &&
         std::find(set.begin(), set.end(), run["fault"]) != set.end();
}

TEST_F(OnboardingTest, FaultsOnARealValveAreSeenAndNamedNarrowly) {
  Onboard("PLANT", Plant() + "@20:1500");
  const nlohmann::json healthy = RunJson(
      "evaluate --valve PLANT --assume-normal --file " + Plant() + "@1500:");
  EXPECT_FALSE(healthy["runs"][0]["detected"].get<bool>());
  for (const std::string fault :
       {"f19:abrupt@1800:strength=0.25", "f19:abrupt@1800:strength=-0.25",
        "f18:abrupt@1800:strength=0.25", "f6:abrupt@1800:strength=0.3",
        "t1:abrupt@1800:strength=0.1"}) {
    SCOPED_TRACE(fault);
    ASSERT_EQ(Study("inject --file " + Plant() + " --fault " + fault +
                    " -o faulty.csv")
                  .code,
              0);
    const nlohmann::json run = StudyJson(
        "evaluate --model-set PLANT --file faulty.csv@1500:")["runs"][0];
    EXPECT_TRUE(run["detected"].get<bool>());
    EXPECT_LE(run["t_dt_first"].get<double>(), 60.0);
    EXPECT_TRUE(Contains(run)) << run["final_set"];
    EXPECT_LE(run["final_set"].size(), 2U) << run["final_set"];
    std::filesystem::remove(Path("faulty.csv"));
  }
}

// No fault run of this valve, nor its model, was used. Every sixth recording,
// all with FDI_ALL_RECORDINGS: each takes a dozen seconds of looks.
TEST_F(OnboardingTest, FaultsOfAnotherModelAreSeenAndNamed) {
  Onboard("REF", Reference("plant_faultfree_211") + "@20:");
  std::vector<std::string> names;
  for (const auto& entry :
       std::filesystem::directory_iterator(folder_ / "valve-reference")) {
    const std::string name = entry.path().stem().string();
    if (name.starts_with("plant_f") && name != "plant_faultfree_211") {
      names.push_back(name);
    }
  }
  ASSERT_EQ(names.size(), 35U);
  std::sort(names.begin(), names.end());
  const bool all = std::getenv("FDI_ALL_RECORDINGS") != nullptr;
  std::string files;
  for (std::size_t i = 0; i < names.size(); i += all ? 1 : 6) {
    files += " --file " + Reference(names[i]);
  }
  int detected = 0;
  int contained = 0;
  int exact = 0;
  const nlohmann::json scored =
      StudyJson("evaluate --model-set REF" + files)["runs"];
  for (const auto& run : scored) {
    SCOPED_TRACE(run["run_id"].get<std::string>());
    if (run["fault"] == nullptr || run["fault"] == "normal") {
      EXPECT_FALSE(run["detected"].get<bool>());
      continue;
    }
    EXPECT_EQ(run["r_fd"], 0.0);
    detected += run["detected"].get<bool>();
    contained += Contains(run);
    exact += run["d_acc"] == 1.0;
  }
  // 27 of the 35, and all of the sixth, move X or F.
  EXPECT_GE(detected, all ? 23 : 5);
  EXPECT_GE(contained, all ? 18 : 5);
  EXPECT_GE(exact, all ? 14 : 4);

  const auto episodes = [&] {
    return RunJson(
        "evaluate --model-set REF --file spoilt.csv")["summary"]
                                                     ["fault_free_episodes"];
  };
  WriteSpoilt("plant_faultfree_212", 2, "5000");
  EXPECT_EQ(episodes(), 0) << "P1";
  WriteSpoilt("plant_faultfree_212", 5, "100");
  EXPECT_EQ(episodes(), 0) << "X";
  WriteSpoilt("plant_faultfree_212", 6, "0");
  EXPECT_EQ(episodes(), 0) << "F";
}

}  // namespace
}  // namespace fdi::trainer
