#include <gtest/gtest.h>

#include "base/error.h"
#include "diagnosis/model/fault_catalogue.h"
#include "tests/storage/history_fixture.h"

namespace fdi::storage {
namespace {

class HistoryLookTest : public HistoryFixture {
 protected:
  EpisodeLook Look(double misfit) const {
    EpisodeLook look;
    look.episode_id = Id();
    look.first_ns = kDetected - 2 * kSecond;
    look.period_ns = kSecond;
    look.misfit = misfit;
    look.faults = {{19, -0.25, -0.3, -0.2, kDetected, false},
                   {7, 0.5, 0.4, 0.6, kDetected - kSecond, true},
                   {kFirstFinding, 0.5, 0.4, 0.6, kDetected, false}};
    look.x_pct = {50.0, 50.25, 51.0, 52.0};
    look.flow = {20.0, 20.125, 21.0, 22.0};
    return look;
  }
};

TEST_F(HistoryLookTest, TheLastLookIsReadAsItWasStored) {
  HistoryWriter writer(path_);
  RecordEpisode(writer, 0b010);
  HistoryReader reader(path_);
  EXPECT_FALSE(reader.Look(Id()));
  EpisodeLook first = Look(3.0);
  first.faults.clear();
  first.x_pct.resize(2);
  first.flow.resize(2);
  writer.StoreLook(first);
  EXPECT_EQ(reader.Look(Id()), first);
  writer.StoreLook(Look(1.5));
  EXPECT_EQ(reader.Look(Id()), Look(1.5));
}

TEST_F(HistoryLookTest, ItGoesWithItsEpisodeAndDoesNotComeWithoutOne) {
  HistoryWriter writer(path_);
  EXPECT_THROW(writer.StoreLook(Look(1.0)), NotFoundError);
  RecordEpisode(writer, 0b010);
  writer.StoreLook(Look(1.0));
  {
    Database database(path_, HistorySchema(), Access::kOccasionalWriter);
    Transaction transaction(database);
    database.Run("DELETE FROM episode");
    transaction.Commit();
  }
  EXPECT_EQ(Sql("SELECT (SELECT count(*) FROM episode_look) + (SELECT count(*) "
                "FROM episode_look_fault) + (SELECT count(*) FROM "
                "episode_look_row)"),
            "0");
}

TEST_F(HistoryLookTest, ARowIsThatOfTheNearestSample) {
  const EpisodeLook look = Look(1.0);
  EXPECT_EQ(look.RowAt(look.first_ns - 600'000'000), std::nullopt);
  EXPECT_EQ(look.RowAt(look.first_ns - 400'000'000), 0U);
  EXPECT_EQ(look.RowAt(look.first_ns + 1'400'000'000), 1U);
  EXPECT_EQ(look.RowAt(look.first_ns + 3'400'000'000), 3U);
  EXPECT_EQ(look.RowAt(look.first_ns + 3'600'000'000), std::nullopt);
}

}  // namespace
}  // namespace fdi::storage
