#include <cmath>
#include <cstdlib>
#include <fstream>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "trainer/evaluation.h"
#include "trainer/training.h"

namespace fdi::trainer {
namespace {

// Columns t_s, CV, P1, P2, T1, X, F and, in valve-reference, the truth.
TrainingRun ReadRun(const std::string& path, bool labelled, double from_s,
                    double to_s) {
  std::ifstream file(path);
  std::string line;
  std::getline(file, line);
  TrainingRun run;
  run.id = path;
  run.flow_unit = FlowUnit::kTPerHour;
  while (std::getline(file, line)) {
    std::vector<double> cells;
    std::istringstream text(line);
    for (std::string cell; std::getline(text, cell, ',');) {
      cells.push_back(std::stod(cell));
    }
    if (cells[0] < from_s || cells[0] >= to_s) {
      continue;
    }
    LabelledSample row;
    row.sample.stamp_ns = std::llround(cells[0] * 1e9);
    row.sample.source_id = 1;
    row.sample.seq = run.samples.size();
    row.sample.flow_unit = run.flow_unit;
    for (std::size_t i = 0; i < 6; ++i) {
      row.sample.Set(static_cast<Signal>(i), cells[i + 1]);
    }
    row.truth = labelled ? FaultTruth{static_cast<int>(cells[7]), cells[8]}
                         : FaultTruth{};
    run.samples.push_back(row);
  }
  return run;
}

class ReferenceDiagnosisTest : public ::testing::Test {
 protected:
  void SetUp() override {
    const char* folder = std::getenv("FDI_REFERENCE_DATA");
    if (folder == nullptr) {
      GTEST_SKIP() << "FDI_REFERENCE_DATA is not set";
    }
    folder_ = folder;
  }

  TrainingRun Reference(const std::string& name) const {
    return ReadRun(folder_ + "/valve-reference/plant_" + name + ".csv", true,
                   0.0, 1e9);
  }

  TrainingRun Plant(double from_s, double to_s) const {
    return ReadRun(
        folder_ + "/plant/lublin_actuator3_2001-10-11_first40min.csv", false,
        from_s, to_s);
  }

  static std::shared_ptr<const ModelSet> Train(
      const std::vector<TrainingRun>& runs) {
    TrainingOptions options = PresetOptions("paper");
    options.name = "reference";
    return std::make_shared<const ModelSet>(TrainModelSet(runs, options));
  }

  std::string folder_;
};

TEST_F(ReferenceDiagnosisTest, FiveFaultsAreNamedAloneInOneEpisodeEach) {
  std::vector<TrainingRun> runs{Reference("faultfree_211")};
  for (const char* name :
       {"f01_medium", "f02_big", "f07_small", "f18_small", "f19_medium"}) {
    runs.push_back(Reference(name));
  }
  const auto models = Train(runs);
  for (std::size_t i = 1; i < runs.size(); ++i) {
    const RunIndices indices = ComputeIndices(ScoreRun(models, runs[i]));
    EXPECT_EQ(indices.episodes, 1) << runs[i].id;
    EXPECT_EQ(indices.final_set, std::vector<int>{indices.fault});
    EXPECT_EQ(indices.wrong_isolations, 0) << runs[i].id;
    // f7 fits once the rod, which follows the flow loop, has arrived.
    EXPECT_LE(indices.t_it, 150.0) << runs[i].id;
  }
  const RunIndices healthy =
      ComputeIndices(ScoreRun(models, Reference("faultfree_212")));
  EXPECT_EQ(healthy.episodes, 0);
}

TEST_F(ReferenceDiagnosisTest, RealValveStaysSilentAfterTwentyFiveMinutes) {
  const auto models = Train({Plant(0.0, 1500.0)});
  EXPECT_EQ(ComputeIndices(ScoreRun(models, Plant(1500.0, 2400.0))).episodes,
            0);
  EXPECT_GT(models->observers[0].channels[1].validation.vaf, 84.0);
}

}  // namespace
}  // namespace fdi::trainer
