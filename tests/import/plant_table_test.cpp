// A table of a plant's loops, its tags, and the columns of one loop out of a
// file of many.
#include "import/plant_table.h"

#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "import/column_index.h"
#include "tests/storage/temporary_directory.h"

namespace fdi::importer {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class PlantTableTest : public ::testing::Test {
 protected:
  std::filesystem::path Write(const std::string& name,
                              const std::string& text) {
    const auto path = directory_.path() / name;
    std::ofstream(path) << text;
    return path;
  }
  storage::TemporaryDirectory directory_;
};

constexpr const char* kToml = R"(
files = ["day.csv"]
[defaults]
document = "https://d/{loop}"
costs = ["12.5 EUR/t", "350 EUR"]
op = "{loop}.OP"
sense = "opening"
[group.boiler]
x = "{loop}.ZT"
op_range = [0, 1]
[[loop]]
name = "FIC1"
group = "boiler"
service = "f"
grade = 2
description = "Feed"
location = "Hall 2"
type = "lublin-actuator-3"
[[loop]]
name = "LIC2"
service = "L"
type = "data only"
)";
constexpr const char* kCsv =
    "name,group,op,x,op_range,sense,service,grade,type,description,location,"
    "document,costs\n"
    "*,,{loop}.OP,,,opening,,,,,,https://d/{loop},\"12.5 EUR/t,350 EUR\"\n"
    "*,boiler,,{loop}.ZT,0..1,,,,,,,,\n"
    "FIC1,boiler,,,,,f,2,lublin-actuator-3,Feed,Hall 2,,\n"
    "LIC2,,,,,,L,,data only\n";

// As in plants that number their loops so.
TEST_F(PlantTableTest, ARowWhoseNameBeginsWithAHashIsNotLeftOutInSilence) {
  const PlantTable table = ReadPlantTable(Write("p.csv",
                                                "# loops of the boiler\n"
                                                "name,op,pv,service\n"
                                                "#12,A.OP,A.PV,F\n"
                                                "# 13, not used any more\n"
                                                "\"#14\",B.OP,B.PV,F\n"));
  ASSERT_EQ(table.rows.size(), 2U);
  EXPECT_THAT(table.rows[0].error, HasSubstr("it begins with #"));
  EXPECT_EQ(table.rows[1].name, "#14");
  EXPECT_EQ(table.rows[1].error, "");
}

TEST_F(PlantTableTest, TomlAndCsvSayTheSame) {
  for (const auto& path : {Write("p.toml", kToml), Write("p.csv", kCsv)}) {
    const PlantTable table = ReadPlantTable(path);
    ASSERT_EQ(table.rows.size(), 2U);
    const PlantRow& first = table.rows[0];
    EXPECT_THAT(first.error, IsEmpty());
    EXPECT_EQ(first[LoopTag::kOp].pattern, "FIC1.OP");
    EXPECT_FALSE(first[LoopTag::kOp].own);
    EXPECT_EQ(first[LoopTag::kX].pattern, "FIC1.ZT");
    EXPECT_EQ(first[LoopTag::kOp].range, std::pair(0.0, 1.0));
    EXPECT_EQ(first.sense, Sense::kOpening);
    EXPECT_EQ(first.service, "F");
    EXPECT_EQ(first.grade, 2);
    EXPECT_EQ(first.description, "Feed");
    EXPECT_EQ(first.location, "Hall 2");
    EXPECT_EQ(first.document, "https://d/FIC1");
    EXPECT_EQ(first.costs, "12.5 EUR/t,350 EUR");
    EXPECT_EQ(first.type, "lublin-actuator-3");
    const PlantRow& second = table.rows[1];
    EXPECT_EQ(second[LoopTag::kOp].pattern, "LIC2.OP");
    EXPECT_THAT(second[LoopTag::kX].pattern, IsEmpty());
    EXPECT_THAT(second.type, IsEmpty());
  }
}

TEST_F(PlantTableTest, WhatIsWrongWithARowIsOfThatRow) {
  const PlantTable table =
      ReadPlantTable(Write("p.csv",
                           "name,op,grade,service,op_range\n"
                           "A,A.OP,4,,\n"
                           "B,{tag}.OP,,,\n"
                           "C,C.OP,,Q,\n"
                           "D,D.OP,,,5..1\n"
                           ",E.OP,,,\n"
                           "F,F.OP,,,\n"));
  ASSERT_EQ(table.rows.size(), 6U);
  EXPECT_THAT(table.rows[0].error, HasSubstr("grade is \"4\""));
  EXPECT_THAT(table.rows[1].error, HasSubstr("{loop}"));
  EXPECT_THAT(table.rows[2].error, HasSubstr("F, P, L, T or A"));
  EXPECT_THAT(table.rows[3].error, HasSubstr("LOW..HIGH"));
  EXPECT_THAT(table.rows[4].error, HasSubstr("no name"));
  EXPECT_THAT(table.rows[5].error, IsEmpty());
  EXPECT_THROW(ReadPlantTable(Write("q.csv", "name,opp\nA,A.OP\n")), DataError);
}

TEST_F(PlantTableTest, StarsMatchAndTwoMatchesAreAmbiguous) {
  const TagNames names({"U1_FIC1.op", "U1_FIC1.PV", "U2_FIC1.PV"});
  EXPECT_THAT(names.Find("*FIC1.OP"), ElementsAre("U1_FIC1.op"));
  EXPECT_THAT(names.Find("*FIC1.PV"), ElementsAre("U1_FIC1.PV", "U2_FIC1.PV"));
  EXPECT_THAT(names.Find("FIC1*"), IsEmpty());
}

TEST_F(PlantTableTest, ReadingsOfALoopBeyondTheirRangeAreNone) {
  const PlantTable table = ReadPlantTable(
      Write("p.csv", "name,op,pv,pv_range,sp\nL1,A,B,0..50,C\n"));
  const TagMatch match =
      MatchTags(table.rows[0], TagNames({"A", "B", "C"}), "day.csv");
  const ColumnMap map = LoopColumns(table.rows[0], match, {});
  ASSERT_EQ(map.columns.size(), 3U);
  EXPECT_EQ(map.columns[1].column, "B");
  EXPECT_EQ(map.columns[1].lowest, -5.0);
  EXPECT_EQ(map.columns[1].highest, 55.0);
  EXPECT_EQ(map.columns[1].scale, 1.0);  // It stays in its own unit.
  EXPECT_EQ(map.columns[2].highest, ColumnMapping{}.highest);
}

// A flow at standard conditions: what to type depends on where it is stated.
TEST_F(PlantTableTest, AUnitOfGasSaysHowToLeaveTheFlowOut) {
  const PlantTable table =
      ReadPlantTable(Write("p.csv",
                           "name,op,pv,pv_unit,f,f_unit,service\n"
                           "L1,A,B,Nm3/h,,,F\nL2,A,B,,C,Nm3/h,F\n"));
  const auto refusal = [&](std::size_t row) -> std::string {
    const TagMatch match =
        MatchTags(table.rows[row], TagNames({"A", "B", "C"}), "day.csv");
    try {
      ValveColumns(table.rows[row], match, {});
    } catch (const ConfigError& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_THAT(refusal(0), HasSubstr("pv_unit is \"Nm3/h\""));
  EXPECT_THAT(refusal(0), HasSubstr("type service = -"));
  EXPECT_THAT(refusal(1), HasSubstr("type f = -"));
}

// Lines keep their numbers, quality and quotes their columns.
TEST_F(PlantTableTest, AProjectionIsTheTableOfItsColumns) {
  const auto path = Write("wide.csv",
                          "Export of Monday\n"
                          "time,A.OP,\"B, x\",C\n"
                          "0,1,\"2\",3\n"
                          "1,4,\"5\",6\n"
                          "\n"
                          "2,7,8,9\n"
                          "3,1,1,1\n");
  const ColumnIndex index(path, {});
  EXPECT_THAT(index.tags(), ElementsAre("A.OP", "B, x", "C"));
  EXPECT_EQ(index.Project({"C", "B, x"}),
            "Export of Monday\ntime,\"B, "
            "x\",C\n0,\"2\",3\n1,\"5\",6\n\n2,8,9\n3,1,1\n");
}

TEST_F(PlantTableTest, TagsOfALongTableAreItsColumns) {
  const auto path = Write("long.csv",
                          "time,tag,value\n"
                          "0,A.OP,1\n0,B.OP,2\n1,A.OP,3\n1,B.OP,4\n"
                          "2,A.OP,5\n2,B.OP,6\n");
  const ColumnIndex index(path, {});
  EXPECT_THAT(index.tags(), ElementsAre("A.OP", "B.OP"));
  EXPECT_EQ(index.Project({"B.OP"}),
            "time,tag,value\n\n0,B.OP,2\n\n1,B.OP,4\n\n2,B.OP,6\n");
}

}  // namespace
}  // namespace fdi::importer
