// onboard --plant: rows that cannot be used, and that the others go on. The
// script bench/plant_table.sh measures what it makes of valves with a type.
#include <cmath>
#include <cstdio>
#include <map>

#include <gmock/gmock.h>

#include "storage/models/plant_loops.h"
#include "tests/programs/trainer/fixture.h"

namespace fdi::trainer {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;

constexpr const char* kHeader = "name,op,pv,sp,mode,service,type,x,from,auto\n";

class PlantTest : public TrainerProgram {
 protected:
  // Loops A and B in AUTO; C has a constant PV, D words of its own for the
  // mode, E has OP and PV exchanged.
  void SetUp() override {
    std::string csv = "t_s";
    for (const char loop : {'A', 'B', 'C', 'D', 'E'}) {
      for (const char* tag : {".OP", ".PV", ".SP"}) {
        csv += std::string(",") + loop + tag;
      }
    }
    csv += ",D.MODE,D.MODE2\n";
    std::string dated = "time,A.OP,A.PV,A.SP\n";
    double pv = 20.0;
    double integral = 40.0;
    for (int k = 0; k < 900; ++k) {
      const double sp = (k / 150) % 2 == 0 ? 20.0 : 24.0;
      integral += 0.05 * (sp - pv);
      const double op = integral + 0.6 * (sp - pv) + 0.05 * std::sin(1.7 * k);
      pv += 0.1 * (0.5 * op - pv) + 0.02 * std::sin(2.3 * k);
      const std::string one = Cells(op, pv, sp);
      csv += std::to_string(k) + one + one + Cells(op, 7.5, sp) + one +
             Cells(pv, op, sp) + ",PROG,PROG\n";
      char time[32];
      std::snprintf(time, sizeof time, "2026-03-10 09:%02d:%02d", k / 60,
                    k % 60);
      dated += time + one + '\n';
    }
    Write("day.csv", csv);
    Write("dated.csv", dated);
  }

  static std::string Cells(double op, double pv, double sp) {
    return "," + std::to_string(op) + "," + std::to_string(pv) + "," +
           std::to_string(sp);
  }

  // The rows by name; of rows with one name, the last.
  std::map<std::string, json> Onboard(const std::string& rows,
                                      const std::string& options = "",
                                      const std::string& data = "data") {
    Write("plant.csv", std::string(kHeader) +
                           "*,{loop}.OP,{loop}.PV,{loop}.SP,,F,,,,\n" + rows);
    const json report =
        RunJson("onboard --plant plant.csv --file day.csv " + options, data);
    std::map<std::string, json> by_name;
    for (const json& row : report.value("rows", json::array())) {
      by_name[row["loop"]] = row;
    }
    return by_name;
  }
};

TEST_F(PlantTest, WhatIsWrongWithARowIsSaidAndTheOthersGoOn) {
  const auto rows = Onboard(
      "A,,,,,,,,,\n"
      "UNKNOWN,NOT.OP,,,,,,,,\n"
      "TWO,A.*,,,,,,,,\n"
      "C,,,,,,,,,\n"
      "D,,,,D.MODE,,,,,\n"
      "E,,,,,,,,,\n"
      "LATE,B.OP,B.PV,,,,,,100000,\n"
      "B,,,,,,,,,\n"
      "B,,,,,,,,,\n"
      "TYPED,B.OP,B.PV,,,,no-such-type,B.SP,,\n");
  const auto finding = [&](const std::string& name) {
    return rows.at(name)["finding"].get<std::string>();
  };
  EXPECT_EQ(rows.at("A")["state"], "data_only");
  EXPECT_EQ(rows.at("A")["watched_by"], "audit");
  EXPECT_THAT(finding("UNKNOWN"), HasSubstr("op = NOT.OP is not in day.csv"));
  EXPECT_THAT(finding("TWO"), HasSubstr("op = A.* matches 3 columns"));
  EXPECT_THAT(finding("TWO"), HasSubstr("A.OP,A.PV,A.SP"));
  EXPECT_THAT(finding("C"), HasSubstr("pv is always 7.5"));
  EXPECT_THAT(finding("D"), HasSubstr("\"PROG\""));
  EXPECT_THAT(finding("D"), HasSubstr("type auto ="));
  EXPECT_THAT(finding("E"), HasSubstr("exchange op and pv"));
  EXPECT_THAT(finding("LATE"), HasSubstr("the record is from 0 to 899 s"));
  EXPECT_THAT(finding("B"), HasSubstr("is that of plant.csv:10, too"));
  EXPECT_THAT(finding("TYPED"), HasSubstr("no-such-type"));
  for (const auto& [name, row] : rows) {
    EXPECT_EQ(row["state"], name == "A" ? "data_only" : "refused") << row;
  }
}

TEST_F(PlantTest, WordsOfThePlantAreModes) {
  const auto rows = Onboard("D,,,,D.MODE,,,,,\"prog, auto\"\n");
  EXPECT_EQ(rows.at("D")["state"], "data_only") << rows.at("D");
}

TEST_F(PlantTest, FromAndToAreInTheZoneOfTheTimesOfTheFile) {
  Write("plant.toml",
        "files = [\"dated.csv\"]\n"
        "zone = \"Asia/Tokyo\"\n"
        "[defaults]\n"
        "op = \"A.OP\"\npv = \"A.PV\"\nsp = \"A.SP\"\nservice = \"F\"\n"
        "[[loop]]\nname = \"LOCAL\"\n"
        "from = \"2026-03-10 09:02\"\nto = \"2026-03-10 09:14\"\n"
        "[[loop]]\nname = \"UTC\"\n"
        "from = \"2026-03-10T00:02Z\"\nto = \"2026-03-10T00:14Z\"\n"
        "[[loop]]\nname = \"LATE\"\nfrom = \"2026-03-10 10:00\"\n");
  // --utc is for the times of files and tables that state no zone.
  const json rows = RunJson("onboard --plant plant.toml --utc")["rows"];
  ASSERT_EQ(rows.size(), 3U);
  EXPECT_EQ(rows[0]["state"], "data_only") << rows[0];
  EXPECT_EQ(rows[0]["finding"], rows[1]["finding"]);
  EXPECT_THAT(rows[2]["finding"].get<std::string>(),
              HasSubstr("the record is from 2026-03-10T00:00:00Z"));
}

TEST_F(PlantTest, ARowOfAFolderNamesTheFileAndItsLine) {
  std::filesystem::create_directory(Path("tags"));
  for (const char* tag : {"A.OP", "A.PV", "A.SP"}) {
    std::string csv = "t_s,value\n";
    for (int k = 0; k < 300; ++k) {
      csv += std::to_string(k) + ',' +
             (k == 150 && tag == std::string("A.PV") ? "six" : "40.5") + '\n';
    }
    Write(std::string("tags/") + tag + ".csv", csv);
  }
  Write("plant.toml",
        "[defaults]\n"
        "op = \"{loop}.OP\"\npv = \"{loop}.PV\"\nsp = \"{loop}.SP\"\n"
        "service = \"F\"\n"
        "[[loop]]\nname = \"A\"\nfile = \"tags\"\n"
        "[[loop]]\nname = \"B\"\nfile = \"day.csv\"\n");
  EXPECT_THAT(RunJson("onboard --plant plant.toml")["rows"][0]["finding"]
                  .get<std::string>(),
              HasSubstr("tags/A.PV.csv:152: column \"value\": \"six\""));
}

TEST_F(PlantTest, ASecondRunDoesOnlyRowsThatChanged) {
  Onboard("A,,,,,,,,,\nB,,,,,,,,,\n");
  const auto again = Onboard("A,,,,,,,,,\nB,,,,,,,,300,\n");
  EXPECT_EQ(again.at("A")["unchanged"], true);
  EXPECT_EQ(again.at("B")["unchanged"], false);
}

// `valves add` states it for one valve; the table may say nothing of it.
TEST_F(PlantTest, WhatTheTableDoesNotStateStays) {
  Onboard("A,,,,,,,,,\n");
  const auto described = [this] {
    storage::ModelStore store(Path("data") / "models.db");
    return storage::FindLoop(store, "A");
  };
  {
    storage::ModelStore store(Path("data") / "models.db",
                              storage::Access::kOccasionalWriter);
    auto loop = *storage::FindLoop(store, "A");
    loop.description = "Feed";
    loop.grade = 1;
    store.PutLoop(loop, {});
  }
  for (const char* from : {"", "300"}) {
    const auto again = Onboard("A,,,,,,,," + std::string(from) + ",\n");
    EXPECT_EQ(again.at("A")["unchanged"], from == std::string());
    EXPECT_EQ(described()->description, "Feed");
    EXPECT_EQ(described()->grade, 1);
    EXPECT_EQ(described()->service, "F");
  }
}

TEST_F(PlantTest, ADryRunStoresNothingAndListsTags) {
  const auto rows = Onboard("A,,,,A.NO,,,,,\nB,,,,,,,,,\n", "--dry-run");
  EXPECT_THAT(rows.at("A")["finding"].get<std::string>(), HasSubstr("A.NO"));
  EXPECT_EQ(rows.at("A")["unmatched"], json::array({"mode = A.NO"}));
  EXPECT_EQ(rows.at("B")["tags"],
            json::array({"op = B.OP", "pv = B.PV", "sp = B.SP"}));
  EXPECT_FALSE(std::filesystem::exists(Path("data")));
}

TEST_F(PlantTest, PartsOfTheTableShareADataDirectory) {
  const std::string table = "A,,,,,,,,,\nB,,,,,,,,,\nD,,,,,,,,,\n";
  EXPECT_EQ(Onboard(table, "--valve '[AB]' --jobs 1").size(), 2U);
  const auto all = Onboard(table, "--jobs 2");
  EXPECT_EQ(all.at("A")["unchanged"], true);
  EXPECT_EQ(all.at("B")["unchanged"], true);
  EXPECT_EQ(all.at("D")["unchanged"], false);
  EXPECT_EQ(Run("onboard --plant plant.csv --file day.csv --valve X").code, 2);
}

}  // namespace
}  // namespace fdi::trainer
