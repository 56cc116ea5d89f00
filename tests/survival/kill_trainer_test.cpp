// fdi-trainer and fdi-store killed while they train and import.

#include <cstdio>
#include <fstream>
#include <iostream>
#include <string>

#include <gtest/gtest.h>

#include "storage/models/models.h"
#include "storage/runs/runs.h"
#include "tests/storage/temporary_directory.h"
#include "tests/survival/kill_rounds.h"

namespace fdi {
namespace {

using std::chrono::milliseconds;

constexpr int kRows = 150'000;

class KilledTrainer : public testing::Test {
 protected:
  static std::filesystem::path Data(const storage::TemporaryDirectory& at) {
    return at.path() / "data";
  }
  std::vector<std::string> Train(const std::filesystem::path& data) const {
    return {FDI_TRAINER_PROGRAM, "--data",
            data.string(),       "train",
            "--campaign",        (files_.path() / "quick.toml").string()};
  }
  std::vector<std::string> Import(const std::filesystem::path& data) const {
    return {FDI_STORE_PROGRAM,
            "--data",
            data.string(),
            "runs",
            "import",
            "--valve",
            "V1",
            (files_.path() / "long.csv").string()};
  }

  // Trains in about a second.
  void WriteCampaign() const {
    std::ofstream(files_.path() / "quick.toml")
        << "name = \"quick\"\n[training]\nmax_rules = 4\nstarts = 4\n"
           "[scenario]\nparameters = \"paper-operating-point\"\n"
           "excitation = {name = \"operating-point\", amplitude_pct = 8, "
           "period_s = 80}\nduration_s = 1200\nseed = 1\n"
           "[[run]]\nsimulate = {duration_s = 3600}\n"
           "[[run]]\nsimulate = {}\nfaults = [\"f19\"]\nstrengths = [0.5]\n";
  }
  void WriteTable() const {
    std::ofstream table(files_.path() / "long.csv");
    table << "t_s,CV_pct,P1_kPa,P2_kPa,T1_degC,X_pct,F_m3_h\n";
    for (int k = 0; k < kRows; ++k) {
      table << k << ',' << 40 + k % 7 << ",3500,2600,132," << 40 + k % 11
            << ".25," << 20 + k % 5 << ".5\n";
    }
  }

  // All that is there is whole. @returns how many versions there are.
  static std::size_t ExpectWholeSets(const std::filesystem::path& data,
                                     std::uint64_t hash) {
    if (!std::filesystem::exists(data / "models.db")) {
      return 0;
    }
    storage::ModelStore store(data / "models.db");
    const std::vector<storage::ModelSummary> sets = store.List();
    for (const storage::ModelSummary& set : sets) {
      EXPECT_EQ(set.content_hash, hash);
      const ModelSet models =
          store.Load(storage::ModelReference{set.name, set.version});
      EXPECT_EQ(static_cast<int>(models.observers.size()), set.observers);
      EXPECT_EQ(store.AssignedModelSet("quick").has_value(), true);
    }
    return sets.size();
  }

  storage::TemporaryDirectory files_;
};

std::uint64_t OnlyHash(const std::filesystem::path& data) {
  storage::ModelStore store(data / "models.db");
  return store.List().at(0).content_hash;
}

TEST_F(KilledTrainer, LeavesNoHalfModelSetAndTrainsTheSameAfterwards) {
  WriteCampaign();
  const storage::TemporaryDirectory whole;
  const Finished reference = RunProgram(Train(Data(whole)));
  ASSERT_EQ(reference.code, 0) << reference.errors;
  const std::uint64_t hash = OnlyHash(Data(whole));

  RandomMoments moments(1);
  const int rounds = KillRounds();
  int killed = 0;
  std::size_t sets = 0;
  for (int round = 0; round < rounds; ++round) {
    SCOPED_TRACE("round " + std::to_string(round));
    const storage::TemporaryDirectory fresh;
    // Every third goes on in a directory that was trained in before.
    const bool used = round % 3 == 2;
    const std::filesystem::path data = used ? Data(whole) : Data(fresh);
    killed += RunAndKill(
        Train(data), moments.Within(milliseconds(1), reference.took * 21 / 20));
    EXPECT_EQ(Doctor(data), "");
    sets += ExpectWholeSets(data, hash) - (used ? 1 : 0);
    if (round + 1 == rounds || round % 10 == 0) {
      const Finished again = RunProgram(Train(data));
      ASSERT_EQ(again.code, 0) << again.errors;
      EXPECT_EQ(Doctor(data), "");
      EXPECT_GE(ExpectWholeSets(data, hash), 1U);
    }
  }
  std::cout << "trainer: " << rounds << " rounds, " << killed
            << " killed within " << reference.took.count() << " ms, " << sets
            << " sets stored before the end\n";
}

TEST_F(KilledTrainer, AnImportIsThereWholeOrNotAtAll) {
  WriteTable();
  const storage::TemporaryDirectory whole;
  const Finished reference = RunProgram(Import(Data(whole)));
  ASSERT_EQ(reference.code, 0) << reference.errors;

  RandomMoments moments(2);
  const int rounds = KillRounds();
  int killed = 0;
  int there = 0;
  for (int round = 0; round < rounds; ++round) {
    SCOPED_TRACE("round " + std::to_string(round));
    const storage::TemporaryDirectory fresh;
    const std::filesystem::path data = Data(fresh);
    killed +=
        RunAndKill(Import(data),
                   moments.Within(milliseconds(1), reference.took * 21 / 20));
    EXPECT_EQ(Doctor(data), "");
    if (std::filesystem::exists(data / "runs.db")) {
      for (const storage::RunInfo& run :
           storage::RunStore(data / "runs.db").List()) {
        EXPECT_EQ(run.samples, kRows);
        ++there;
      }
    }
  }
  std::cout << "import: " << rounds << " rounds, " << killed
            << " killed within " << reference.took.count() << " ms, " << there
            << " runs stored, all whole\n";
}

}  // namespace
}  // namespace fdi
