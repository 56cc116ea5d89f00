// The plant table as the gateway reads it: valves, topics, rows that are
// refused.
#include "gateway/live_table.h"

#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/storage/temporary_directory.h"

namespace fdi::gateway {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

class LiveTableTest : public ::testing::Test {
 protected:
  LiveTable Read(const std::string& text, bool by_topics = false) {
    const auto path = directory_.path() / "plant.toml";
    std::ofstream(path) << text;
    return ReadLiveTable(path, by_topics);
  }
  static std::vector<Signal> SignalsOf(const importer::LiveValve& valve) {
    std::vector<Signal> signals;
    for (const auto& mapping : valve.map.columns) {
      signals.push_back(mapping.signal);
    }
    return signals;
  }
  storage::TemporaryDirectory directory_;
};

TEST_F(LiveTableTest, ARowIsAValveInItsUnits) {
  const LiveTable table = Read(R"(
resample = "500ms"
[defaults]
op = "{loop}.OP"
x = "{loop}.ZT"
mode = "{loop}.MODE"
sense = "opening"
p1 = "PT-100"
p1_unit = "barg"
[[loop]]
name = "FIC101"
group = "unit 1"
service = "F"
pv = "{loop}.PV"
pv_unit = "t/h"
auto = "2"
report = "periodic"
max_age = "5s"
[[loop]]
name = "LIC207"
pv = "{loop}.PV"
sp = "{loop}.SP"
)");
  EXPECT_THAT(table.refused, IsEmpty());
  EXPECT_EQ(table.period_ns, 500'000'000);
  ASSERT_THAT(table.valves, SizeIs(2));
  const importer::LiveValve& flow = table.valves[0];
  EXPECT_EQ(flow.id, "FIC101");
  EXPECT_EQ(flow.group, "unit 1");
  EXPECT_THAT(SignalsOf(flow),
              ElementsAre(Signal::kCv, Signal::kX, Signal::kF, Signal::kP1));
  EXPECT_EQ(flow.map.flow_unit, FlowUnit::kTPerHour);
  EXPECT_EQ(flow.map.columns[0].column, "FIC101.OP");
  EXPECT_EQ(flow.map.columns[0].sense, Sense::kOpening);
  EXPECT_EQ(flow.map.mode_column, "FIC101.MODE");
  EXPECT_EQ(flow.report, importer::Reporting::kPeriodic);
  EXPECT_EQ(flow.max_age_ns, 5'000'000'000);
  EXPECT_EQ(flow.map.mode_words.at("2"), ValveMode::kAuto);
  EXPECT_THAT(SignalsOf(table.valves[1]),
              ElementsAre(Signal::kCv, Signal::kX, Signal::kP1, Signal::kPv,
                          Signal::kSp));
  EXPECT_EQ(table.valves[1].report, importer::Reporting::kException);
}

TEST_F(LiveTableTest, ARowThatIsWrongLeavesTheOthers) {
  const LiveTable table = Read(R"(
[defaults]
op = "{loop}.OP"
pv = "{loop}.PV"
[[loop]]
name = "A"
x = "{loop}.*"
[[loop]]
name = "B"
x_unit = "furlong"
x = "B.X"
[[loop]]
name = "C"
x = "C.X"
[[loop]]
name = "D"
x = "C.X"
[[loop]]
name = "E"
report = "sometimes"
)");
  ASSERT_THAT(table.valves, SizeIs(1));
  EXPECT_EQ(table.valves[0].id, "C");
  ASSERT_THAT(table.refused, SizeIs(4));
  EXPECT_THAT(table.refused[0].why, HasSubstr("state the tag itself"));
  EXPECT_THAT(table.refused[1].why, HasSubstr("furlong"));
  EXPECT_THAT(table.refused[2].why, HasSubstr("x = C.X is that of C, too"));
  EXPECT_THAT(table.refused[3].why, HasSubstr("exception or periodic"));
}

TEST_F(LiveTableTest, ATopicIsThatOfOneSignal) {
  const LiveTable table = Read(R"(
[defaults]
op = "{loop}.OP"
x = "{loop}.ZT"
topic = "plant/{loop}/{signal}"
[[loop]]
name = "A"
value = "val"
[[loop]]
name = "B"
topic = "plant/{loop}"
[[loop]]
name = "C"
topic = "plant/{loop}"
value = "{tag}"
report = "exception"
[[loop]]
name = "D"
topic = "-"
[[loop]]
name = "E"
topic = "plant/+/{signal}"
)",
                               true);
  ASSERT_THAT(table.valves, SizeIs(2));
  EXPECT_EQ(table.valves[0].report, importer::Reporting::kPeriodic);
  EXPECT_EQ(table.valves[1].report, importer::Reporting::kException);
  ASSERT_THAT(table.topics, SizeIs(4));
  EXPECT_EQ(table.topics[1].topic, "plant/A/x");
  EXPECT_EQ(table.topics[1].tag, "A.ZT");
  EXPECT_EQ(table.topics[1].value_key, "val");
  EXPECT_EQ(table.topics[2].topic, "plant/C");
  EXPECT_EQ(table.topics[2].value_key, "C.OP");
  ASSERT_THAT(table.refused, SizeIs(3));
  EXPECT_THAT(table.refused[0].why, HasSubstr("is that of B.OP and B.ZT"));
  EXPECT_THAT(table.refused[1].why, HasSubstr("topic is missing"));
  EXPECT_THAT(table.refused[2].why, HasSubstr("+ or #"));
}

}  // namespace
}  // namespace fdi::gateway
