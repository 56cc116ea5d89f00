#include <gmock/gmock.h>

#include "base/error.h"
#include "storage/history/history_writer.h"
#include "tests/storage/history_fixture.h"

namespace fdi::storage {
namespace {

using Kind = TransitionKind;

using HistoryTraceTest = HistoryFixture;

TEST_F(HistoryTraceTest, TraceReadsBackBitForBitAcrossChunks) {
  const auto before = Instants(1800, -1800);
  {
    HistoryWriter writer(path_);
    writer.Record(Event(Kind::kDetected, 0, 0, 0.3), kDetected);
    ASSERT_TRUE(writer.AppendTrace(Id(), before));
    for (int k = 0; k < 310; ++k) {  // As it goes: one instant per commit.
      ASSERT_TRUE(writer.AppendTrace(Id(), std::vector{Instant(k)}));
      writer.Commit(kDetected);
    }
    writer.EndTrace(Id());
    writer.EndSession(kDetected, true);
  }

  const auto trace = HistoryReader(path_).Trace(Id());

  ASSERT_EQ(trace.size(), 2110U);
  for (int i = 0; i < 2110; ++i) {
    const auto at = static_cast<std::size_t>(i);
    const TracePoint expected = i < 1800 ? before[at] : Instant(i - 1800);
    ASSERT_EQ(trace[at].sample.stamp_ns, expected.sample.stamp_ns);
    ASSERT_EQ(trace[at].sample.values, expected.sample.values);
    ASSERT_EQ(trace[at].residuals, expected.residuals);
    ASSERT_EQ(trace[at].factors, expected.factors);
    ASSERT_EQ(trace[at].normal_factor, expected.normal_factor);
    ASSERT_EQ(trace[at].state, expected.state);
  }
  EXPECT_EQ(Sql("SELECT count(*) FROM episode_trace"), "8");  // 6 + 1 + 1
}

TEST_F(HistoryTraceTest, TraceOfAnotherModelSetIsNotTaken) {
  HistoryWriter writer(path_);
  writer.Record(Event(Kind::kDetected, 0, 0, 0.3), kDetected);
  TracePoint other = Instant(0);
  other.factors.push_back(0.5);

  EXPECT_FALSE(writer.AppendTrace(Id(), std::vector{other}));
  EXPECT_THROW(writer.AppendTrace(7, {}), NotFoundError);
}

TEST_F(HistoryTraceTest, PeakFactorIsTheLargestOfTheIsolatedSetInTheTrace) {
  HistoryWriter writer(path_);
  writer.Record(Event(Kind::kDetected, 0, 0, 0.3), kDetected);
  writer.Record(Event(Kind::kIsolated, 20, 0b010, 0.8), kDetected);
  TracePoint high = Instant(30);
  high.isolated = 0b010;
  high.factors = {0.99, 0.93, 0.1};  // f1 is higher, but not isolated.
  TracePoint early = Instant(10);    // Before isolation: another question.
  early.factors = {0.0, 0.97, 0.0};

  writer.AppendTrace(Id(), std::vector{early, high});
  writer.Commit(kDetected);

  EXPECT_EQ(Sql("SELECT peak_factor FROM fault_history"), "0.93");
}

TEST_F(HistoryTraceTest, DamagedTraceIsRefusedByName) {
  {
    HistoryWriter writer(path_);
    writer.Record(Event(Kind::kDetected, 0, 0, 0.3), kDetected);
    writer.AppendTrace(Id(), Instants(10, 0));
    writer.Commit(kDetected);
  }
  {
    Database database(path_, HistorySchema(), Access::kOccasionalWriter);
    Transaction transaction(database);
    database.Run(
        "UPDATE episode_trace SET vectors = CAST(substr(vectors, 1, 20) || "
        "x'00' AS BLOB)");
    transaction.Commit();
  }

  EXPECT_THROW(HistoryReader(path_).Trace(Id()), DataError);
}

}  // namespace
}  // namespace fdi::storage
