// Forty files broken in forty ways: what is said, the exit code, nothing
// stored.
#include <gmock/gmock.h>
#include <sys/resource.h>
#include <zlib.h>

#include "tests/programs/store/store_program_fixture.h"
#include "tests/sanitized.h"

namespace fdi::storage {
namespace {

using testing::AllOf;
using testing::ContainsRegex;
using testing::HasSubstr;
using testing::Not;

constexpr const char* kMap =
    "[time]\ncolumn = 'Zeit'\n"
    "[signal.CV]\ncolumn = 'LC.CV'\nsense = 'opening'\n"
    "[signal.P1]\ncolumn = 'PT1'\nunit = 'bar g'\n"
    "[signal.F]\ncolumn = 'FT'\nunit = 'm3/h'\n";
constexpr const char* kLong =
    "[long]\ntag = 'Tag'\nvalue = 'Wert'\nquality = 'Q'\n";
constexpr const char* kHead = "Zeit;LC.CV;PT1;FT\n";

struct BadTable {
  const char* way;
  std::string bytes;
  std::string map;  // Empty: the names of the contract.
  int code;
  std::string message;  // A part of the one line on stderr.
  std::string options{};
};

// Rows of the contract at 0, 1, ..., with `row` instead of the third.
std::string Contract(const std::string& row) {
  return "t_s,CV_pct,P1_kPa,P2_kPa,T1_degC,X_pct,F_t_h\n"
         "0,40.5,3500,2500,130,41,22\n1,41.5,3500,2500,130,41,22\n" +
         row + "\n3,41.5,3500,2500,130,41,22\n4,41.5,3500,2500,130,41,22\n";
}

// Rows of a plant at whole seconds, with `row` instead of the third.
std::string Plant(const std::string& row) {
  return std::string(kHead) +
         "2026-01-05 10:00:00;40,5;34,1;22,05\n"
         "2026-01-05 10:00:01;41,5;34,1;22,05\n" +
         row +
         "\n2026-01-05 10:00:03;41,5;34,1;22,05\n"
         "2026-01-05 10:00:04;41,5;34,1;22,05\n";
}

std::string Gzip(const std::string& text) {
  const TemporaryDirectory folder;
  const std::string path = (folder.path() / "table.gz").string();
  gzFile file = gzopen(path.c_str(), "wb");
  gzwrite(file, text.data(), static_cast<unsigned>(text.size()));
  gzclose(file);
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

std::vector<BadTable> BadTables() {
  const std::string fine = "2026-01-05 10:00:02;41,5;34,1;22,05";
  const std::string tall = std::string(kMap) + kLong;
  const std::string tags = "Tag;Zeit;Wert;Q\nLC.CV;2026-01-05 10:00:00;1,5;";
  const std::string packed = Gzip(Plant(fine) + std::string(5000, '\n'));
  return {
      {"empty", "", "", 3, "is empty: no header"},
      {"blank lines", "\n\n\n", "", 3, "is empty: no header"},
      {"header alone", kHead, kMap, 3, "has a header but no rows"},
      {"one row", std::string(kHead) + fine, kMap, 3,
       "one row does not tell the sample period; try --period"},
      {"no header", "0,40,3500,2500,130,41,22\n1,40,3500,2500,130,41,22\n", "",
       3, ":1: the first row holds values, not names"},
      {"a column is missing", "t_s,CV_pct,X_pct\n0,1,2\n1,1,2\n", "", 3,
       ":1: missing column P1_kPa"},
      {"a mapped column is missing", "Zeit;LC.CV;FT\n1;2;3\n", kMap, 3,
       ":1: missing column PT1"},
      {"a column twice", "t_s,CV_pct,CV_pct\n0,1,2\n", "", 3,
       ":1: column \"CV_pct\": signal CV occurs twice"},
      {"a mapped column twice", "Zeit;LC.CV;PT1;PT1;FT\n1;2;3;4;5\n", kMap, 3,
       ":1: column \"PT1\" occurs twice"},
      {"text in a number", Contract("2,4o,3500,2500,130,41,22"), "", 3,
       ":4: column \"CV_pct\": \"4o\" is not a finite number; expected digits"},
      {"a unit in a cell", Plant("2026-01-05 10:00:02;41,5 bar;34,1;22,05"),
       kMap, 3, ":4: column \"LC.CV\": \"41,5 bar\" is in \"bar\", expected %"},
      {"infinity", Contract("2,inf,3500,2500,130,41,22"), "", 3,
       ":4: column \"CV_pct\": \"inf\" is not a finite number"},
      {"too large a number", Contract("2,1e999,3500,2500,130,41,22"), "", 3,
       "\"1e999\" is not a finite number"},
      {"hexadecimal", Contract("2,0x10,3500,2500,130,41,22"), "", 3,
       "\"0x10\" is not a finite number"},
      {"thousands with the sign of decimals",
       Plant("2026-01-05 10:00:02;41,5;1,034.1;22,05"), kMap, 3,
       ":4: \"1,034.1\" has thousands separators, and \"40,5\" at "},
      {"thousands that look like decimals",
       Plant("2026-01-05 10:00:02;41,5;1.034;22,05"), kMap, 3,
       ":4: \"1.034\" seems to have a thousands separator"},
      {"both decimal signs", Plant("2026-01-05 10:00:02;41.5;34,1;22,05"), kMap,
       3, ":4: \"41.5\" and cells above differ in the sign of decimals"},
      {"decimals or thousands",
       std::string(kHead) + "2026-01-05 10:00:00;1.234;1.234;22\n"
                            "2026-01-05 10:00:01;1.234;1.234;22\n",
       kMap, 3, ":2: \"1.234\" and all other cells may have decimals"},
      {"decimal commas between commas",
       "t_s,CV_pct,X_pct\n0,40,5,41,2\n1,40,5,41,2\n", "", 3,
       ":1: missing column P1_kPa"},
      {"cells too few", Plant("2026-01-05 10:00:02;41,5;34,1"), kMap, 3,
       ":4: 3 cells, the header has 4"},
      {"cells too many", Contract("2,41,5,3500,2500,130,41,22"), "", 3,
       ":4: 8 cells, the header has 7"},
      {"another separator from a line on", Contract("2;41;3500;2500;130;41;22"),
       "", 3, ":4: 1 cells"},
      {"an open quote", Contract("2,\"41,3500,2500,130,41,22"), "", 3,
       "a quote is not closed"},
      {"time goes back", Plant("2026-01-05 09:59:02;41,5;34,1;22,05"), kMap, 3,
       ":4: time goes back or stands still"},
      {"time stands still", Plant("2026-01-05 10:00:01;41,6;34,1;22,05"), kMap,
       3, ":4: time goes back or stands still"},
      {"a gap",
       Contract("2,41,3500,2500,130,41,22") + "9,41,3500,2500,130,41,22\n", "",
       3, ":7: time jumps by 5 s"},
      {"half a period off", Plant("2026-01-05 10:00:01,3;41,5;34,1;22,05"),
       kMap, 3, ":4: time jumps by 0.3 s"},
      {"not a time", Plant("yesterday;41,5;34,1;22,05"), kMap, 3,
       ":4: column \"Zeit\": \"yesterday\" is not a time; expected"},
      {"no such day", Plant("2026-02-30 10:00:02;41,5;34,1;22,05"), kMap, 3,
       "\"2026-02-30 10:00:02\" is not a time"},
      {"day or month", std::string(kHead) + "05/01/2026 10:00:00;1;2;3\n", kMap,
       3, ":2: column \"Zeit\": \"05/01/2026 10:00:00\" may be day/month"},
      {"an hour that was skipped",
       std::string(kHead) + "2026-03-29 02:30:00;1;2;3\n", kMap, 3,
       "was never shown in zone 'Europe/Warsaw'", "--zone Europe/Warsaw"},
      {"the wrong unit",
       std::string(kHead) + "2026-01-05 10:00:00;1;350000;3\n"
                            "2026-01-05 10:00:01;1;350000;3\n",
       kMap, 3, ":2: P1 is 35000101.325 after conversion"},
      {"an unknown fault",
       "t_s,CV_pct,P1_kPa,P2_kPa,T1_degC,X_pct,F_t_h,fault,fault_strength\n"
       "0,1,2,3,4,5,6,f99,1\n",
       "", 3, ":2: column \"fault\": \"f99\" is not a fault"},
      {"a tag that does not occur", tags + "Good\n", tall, 3,
       "tag \"FT\" does not occur"},
      {"two values at one time",
       tags + "Good\n" +
           "LC.CV;2026-01-05 10:00:00;2,5;"
           "Good\nPT1;2026-01-05 10:00:00;3,5;Good\nFT;2026-01-05 "
           "10:00:00;3,5;Good\n",
       tall, 3, ":3: signal CV has two values at this time"},
      {"quality 0", tags + "0\n", tall, 3,
       ":2: column \"Q\": \"0\" is good in OPC UA and bad in OPC DA"},
      {"damaged gzip", packed.substr(0, packed.size() / 2), kMap, 3,
       "unexpected end of file; try gzip -t"},
      {"a spreadsheet", std::string("PK\x03\x04") + "....", "", 3,
       "is a spreadsheet or zip archive"},
      {"Parquet", "PAR1....", "", 3, "is a Parquet file: docs/import.md"},
      {"binary", std::string("t_s,CV\n0,\0,1\n", 12), "", 3, "is binary"},
      {"an unknown unit", Plant(fine),
       "[signal.P1]\ncolumn = 'PT1'\nunit = 'atm'\n", 2,
       "unknown unit 'atm'; accepted are"},
      {"an unknown zone", Plant(fine), kMap, 2, "zone 'Mars/Base' is not known",
       "--zone Mars/Base"},
      {"resampled by what", Plant(fine), kMap, 2, "accepted are 1s, 1s:hold",
       "--resample 1s:cubic"},
  };
}

TEST_F(FdiStoreTest, BrokenTablesAreRefusedInOneLineAndNothingIsStored) {
  const std::vector<BadTable> tables = BadTables();
  ASSERT_GE(tables.size(), 40U);
  for (const BadTable& table : tables) {
    SCOPED_TRACE(table.way);
    Write("bad.csv", table.bytes);
    Write("tags.toml", table.map);
    const std::string map = table.map.empty() ? "" : " --map tags.toml";

    const Outcome outcome =
        Store("runs import bad.csv --valve V --utc " + table.options + map);

    EXPECT_EQ(outcome.code, table.code) << outcome.err;
    EXPECT_THAT(outcome.err, HasSubstr(table.message));
    EXPECT_THAT(outcome.err, HasSubstr(table.code == 3 ? "bad.csv" : "'"));
    EXPECT_EQ(std::ranges::count(outcome.err, '\n'), 1) << outcome.err;
    EXPECT_FALSE(RunsAreStored());
  }
}

// The largest memory that a program of this test had.
double MegabytesOfPrograms() {
  rusage usage{};
  getrusage(RUSAGE_CHILDREN, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024.0;
}

// Packed to less than a hundredth, so that nothing but its form is wrong.
TEST_F(FdiStoreTest, AGzipTakesLittleMemoryWhateverItUnpacksTo) {
  if (kSanitized) {
    GTEST_SKIP() << "under a sanitizer";
  }
  std::string part;
  for (std::uint32_t i = 0; part.size() < 1U << 20U; i = i * 1664525U + 99U) {
    part += std::to_string(i) + std::string(300, '7') + ',';
  }
  std::string line;
  for (int i = 0; i < 150; ++i) {
    line += part;
  }
  Write("line.csv", Gzip(line));
  std::string rows = "t_s,CV_pct,P1_kPa,P2_kPa,T1_degC,X_pct,F_t_h\n";
  for (int t = 0; t < 1'000'001; ++t) {
    rows += std::to_string(t) + ",1,3,2,1,1,2\n";
  }
  Write("rows.csv", Gzip(rows));

  for (const char* verb : {"runs sniff line.csv", "audit line.csv",
                           "runs import line.csv --valve V"}) {
    const Outcome outcome = Store(verb);
    EXPECT_EQ(outcome.code, 3);
    EXPECT_THAT(outcome.out + outcome.err,
                HasSubstr("line.csv:1: the line is longer than 2 MiB"));
  }
  const Outcome many = Store("runs import rows.csv --valve V");
  EXPECT_EQ(many.code, 3);
  EXPECT_THAT(many.err, HasSubstr("rows.csv: has more than 1000000 rows, which "
                                  "a gzip may not have; try to unpack it"));
  EXPECT_FALSE(RunsAreStored());
  EXPECT_LT(MegabytesOfPrograms(), 300.0);
}

TEST_F(FdiStoreTest, TablesWithoutEndAreRefused) {
  std::string wide = "t_s";
  for (int i = 0; i < 20'001; ++i) {
    wide += ",a" + std::to_string(i);
  }
  Write("wide.csv", wide + '\n' + wide + '\n');
  EXPECT_THAT(Store("runs sniff wide.csv").err,
              HasSubstr("wide.csv:1: 20002 columns; expected at most 20000"));

  std::string quote = "t_s,CV_pct,X_pct\n0,1,2\n1,1,2\n2,\"1,2\n";
  for (int t = 3; t < 300'000; ++t) {
    quote += std::to_string(t) + ",1,2\n";
  }
  Write("quote.csv", quote);
  const Outcome open = Store("runs import quote.csv --valve V --signals CV,X");
  EXPECT_EQ(open.code, 3);
  EXPECT_THAT(open.err, HasSubstr("a quote in it is not closed"));

  Write("twice.csv", Gzip(Gzip(Plant("2026-01-05 10:00:02;41,5;34,1;22,05"))));
  EXPECT_THAT(Store("runs sniff twice.csv").err,
              HasSubstr("twice.csv: is a gzip within a gzip"));
}

// The rows that the table above breaks are read as they are.
TEST_F(FdiStoreTest, TheSameTablesUnbrokenAreRead) {
  Write("tags.toml", kMap);
  Write("plant.csv",
        Gzip(Plant("2026-01-05 10:00:02,2;41,5;I/O Timeout;22,05")));

  const json run = StoreJson(
      "runs import plant.csv --valve V --map tags.toml --zone Europe/Warsaw");

  EXPECT_EQ(run["samples"], 5);
  EXPECT_EQ(run["start_utc"], "2026-01-05T09:00:00Z");
  EXPECT_THAT(run["scenario"].get<std::string>(),
              AllOf(HasSubstr("P1 = PT1 in bar g: 101.325 + 100 x cell"),
                    HasSubstr("CV = LC.CV in %, opening"),
                    HasSubstr("up to 200 ms early or late")));
  EXPECT_EQ(Store("runs export " + run["run_id"].get<std::string>()).out,
            "t_s,CV_pct,P1_kPa,F_m3_h\n"
            "0,59.5,3511.325,22.05\n1,58.5,3511.325,22.05\n2,58.5,,22.05\n"
            "3,58.5,3511.325,22.05\n4,58.5,3511.325,22.05\n");
}

}  // namespace
}  // namespace fdi::storage
