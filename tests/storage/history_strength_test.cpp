#include <gtest/gtest.h>

#include "base/error.h"
#include "diagnosis/model/fault_catalogue.h"
#include "storage/history/strength.h"
#include "tests/storage/history_fixture.h"

namespace fdi::storage {
namespace {

class HistoryStrengthTest : public HistoryFixture {
 protected:
  StrengthPoint Strength(int hour, int fault, double strength) const {
    return {Id(),
            kDetected + hour * 3600 * kSecond,
            fault,
            strength,
            strength - 0.01,
            strength + 0.01,
            Layer::kPhysics};
  }
};

TEST_F(HistoryStrengthTest, PointsAreReadByTimeAsTheyWereStored) {
  HistoryWriter writer(path_);
  RecordEpisode(writer, 0b010);
  StrengthPoint observed = Strength(0, 19, -0.25);
  observed.layer = Layer::kObservers;
  const std::vector<StrengthPoint> points = {observed, Strength(0, 7, 0.125),
                                             Strength(1, 7, 0.25),
                                             Strength(2, kFirstFinding, 0.5)};
  writer.StoreStrength(points[3]);
  writer.StoreStrength(points[2]);
  writer.StoreStrength(Strength(0, 7, 0.5));
  writer.StoreStrength(points[1]);  // Instead of it.
  writer.StoreStrength(points[0]);
  EXPECT_EQ(HistoryReader(path_).Strengths(Id()), points);
  EXPECT_TRUE(HistoryReader(path_).Strengths(Id("LV-2")).empty());
}

TEST_F(HistoryStrengthTest, TheyGoWithTheirEpisodeAndDoNotComeWithoutOne) {
  HistoryWriter writer(path_);
  EXPECT_THROW(writer.StoreStrength(Strength(0, 7, 0.5)), NotFoundError);
  RecordEpisode(writer, 0b010);
  writer.StoreStrength(Strength(0, 7, 0.5));
  {
    Database database(path_, HistorySchema(), Access::kOccasionalWriter);
    Transaction transaction(database);
    database.Run("DELETE FROM episode");
    transaction.Commit();
  }
  EXPECT_EQ(Sql("SELECT count(*) FROM episode_strength"), "0");
}

TEST_F(HistoryStrengthTest, TheFaultsOfTheNameDevelopInItsOrder) {
  Episode episode;
  episode.fault = "f7|f19";
  const std::vector<StrengthPoint> points = {
      Strength(0, 19, 0.5), Strength(0, 1, 0.1), Strength(1, 7, 0.25)};
  const std::vector<Growth> growths = GrowthOf(episode, points);
  ASSERT_EQ(growths.size(), 2U);
  EXPECT_EQ(growths[0].last, points[2]);
  EXPECT_EQ(growths[1].last, points[0]);
  episode.fault = "unknown";
  EXPECT_TRUE(GrowthOf(episode, points).empty());
}

}  // namespace
}  // namespace fdi::storage
