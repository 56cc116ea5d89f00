#include "bench/study/paper_indices.h"

#include <gtest/gtest.h>

#include "tests/trainer/indications.h"

namespace fdi::trainer::study {
namespace {

PaperIndices Compute(const std::vector<Indication>& all,
                     double horizon_s = 0.0) {
  return ComputePaperIndices(all, ComputeIndices(all, horizon_s), horizon_s);
}

TEST(PaperIndicesTest, NothingIndicatedMeansMinusOne) {
  const PaperIndices r = Compute(Quiet());
  for (const double index : {r.t_it_first, r.t_exact, r.fs_d, r.fs_i}) {
    EXPECT_EQ(index, -1.0);
  }
  EXPECT_EQ(r.r_td, 0.0);
}

TEST(PaperIndicesTest, SharesAreOfTheirZones) {
  std::vector<Indication> all = Quiet();
  Detect(all, 710, 720);
  Detect(all, 800, 1000);
  Isolate(all, 805, 1000, {3, 6});
  const PaperIndices r = Compute(all);
  EXPECT_NEAR(r.fs_d, 0.101, 1e-12);
  EXPECT_NEAR(r.fs_i, 0.106, 1e-12);
  EXPECT_NEAR(r.r_td, 210.0 / 300.0, 1e-12);
  EXPECT_NEAR(r.r_ti, 195.0 / 300.0, 1e-12);
  EXPECT_NEAR(r.r_mi, 195.0 / 900.0, 1e-12);  // t_on = 100
  EXPECT_EQ(r.t_exact, -1.0);
}

TEST(PaperIndicesTest, NothingBehindTheHorizonCounts) {
  std::vector<Indication> all = Quiet();
  Detect(all, 700, 900);
  EXPECT_NEAR(Compute(all, 850.0).r_td, 1.0, 1e-12);
  all = Quiet();
  Detect(all, 720, 760);
  Detect(all, 860, 1000);
  Isolate(all, 880, 1000, {6});
  const PaperIndices r = Compute(all, 850.0);
  EXPECT_NEAR(r.r_td, 40.0 / 151.0, 1e-12);  // 700..850 s, both ends
  EXPECT_EQ(r.r_mi, 0.0);
  EXPECT_EQ(r.t_it_first, -1.0);
}

TEST(PaperIndicesTest, RunWithoutFaultHasRatesButNoTimes) {
  std::vector<Indication> all = Quiet();
  for (Indication& indication : all) {
    indication.truth = {};
  }
  Detect(all, 100, 110);
  const PaperIndices r = Compute(all);
  for (const double index :
       {r.t_it_first, r.t_exact, r.r_td, r.r_ti, r.fs_d, r.fs_i}) {
    EXPECT_EQ(index, -1.0);
  }
  EXPECT_EQ(r.r_mi, 0.0);
  EXPECT_EQ(r.r_fi, 0.0);
}

TEST(PaperIndicesTest, NameBeforeTheFaultIsNoIsolationOfIt) {
  std::vector<Indication> all = Quiet();
  Detect(all, 400, 460);
  Isolate(all, 430, 460, {6});
  EXPECT_NEAR(Compute(all).r_fi, 30.0 / 600.0, 1e-12);
  EXPECT_EQ(Compute(all).t_it_first, -1.0);
  Isolate(all, 690, 720, {6});  // It stood when the fault came.
  EXPECT_EQ(Compute(all).t_it_first, -1.0);
  Isolate(all, 740, 750, {6});
  EXPECT_EQ(Compute(all).t_it_first, 40.0);
}

TEST(PaperIndicesTest, SetWithoutTheFaultIsNeverIsolated) {
  std::vector<Indication> all = Quiet();
  Detect(all, 720, 1000);
  Isolate(all, 740, 1000, {3, 18});
  const PaperIndices r = Compute(all);
  for (const double index : {r.t_it_first, r.t_exact, r.fs_i}) {
    EXPECT_EQ(index, -1.0);
  }
  EXPECT_EQ(r.r_ti, 0.0);
  EXPECT_NEAR(r.r_mi, 2.0 * 260.0 / 900.0, 1e-12);
}

TEST(PaperIndicesTest, IsolationHasAFirstAndAnExactTime) {
  std::vector<Indication> all = Quiet();
  Detect(all, 710, 1000);
  Isolate(all, 730, 760, {3, 6});
  Isolate(all, 760, 840, {3});
  Isolate(all, 840, 1000, {6});
  const PaperIndices r = Compute(all);
  EXPECT_EQ(r.t_it_first, 30.0);
  EXPECT_EQ(r.t_exact, 140.0);
  EXPECT_NEAR(r.fs_i, 0.141, 1e-12);
}

TEST(PaperIndicesTest, RunThatNeverSettlesHasNoRates) {
  std::vector<Indication> all = Quiet();
  for (Indication& indication : all) {
    indication.settled = false;
    indication.truth = {};
  }
  EXPECT_EQ(Compute(all).r_mi, -1.0);
  EXPECT_EQ(Compute(all).r_fi, -1.0);
  EXPECT_EQ(Compute({}).r_mi, -1.0);
}

}  // namespace
}  // namespace fdi::trainer::study
