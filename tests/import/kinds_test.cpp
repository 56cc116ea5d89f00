// Exports of every kind, as their users have them: what sniff writes, the
// importer reads, and both find the same readings.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <zlib.h>

#include "base/error.h"
#include "import/csv.h"
#include "import/sniff.h"
#include "import/tag_map.h"
#include "tests/storage/temporary_directory.h"

namespace fdi::importer {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr std::size_t kRows = 120;
// date -d 2026-03-10T09:00:00Z +%s
constexpr std::int64_t kStart = 1'773'133'200;

/// A healthy valve in % of opening: a moving command, a rod that lags behind,
/// and a flow in t/h that rises with the opening.
struct Valve {
  std::array<double, kRows> cv{};
  std::array<double, kRows> x{};
  std::array<double, kRows> f{};

  Valve() {
    double rod = 38.0;
    for (std::size_t k = 0; k < kRows; ++k) {
      const auto t = static_cast<double>(k);
      cv[k] = 38.0 + 7.0 * std::sin(0.7 * t) + 3.0 * std::sin(0.11 * t);
      rod += 0.6 * (cv[k] - rod);
      x[k] = rod;
      f[k] = 0.011 * rod * rod;
    }
  }
};
const Valve kValve;

std::string Fixed(double value, int decimals = 3) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.*f", decimals, value);
  return text.data();
}

std::string Comma(double value) {
  std::string text = Fixed(value);
  text.replace(text.find('.'), 1, ",");
  return text;
}

/// strftime() of row k in UTC.
std::string Clock(const char* format, std::size_t k,
                  std::int64_t start = kStart) {
  const std::time_t at = start + static_cast<std::time_t>(k);
  std::tm fields{};
  gmtime_r(&at, &fields);
  std::array<char, 64> text{};
  std::strftime(text.data(), text.size(), format, &fields);
  return text.data();
}
std::string Iso(std::size_t k) {
  return Clock("%Y-%m-%dT%H:%M:%SZ", k);
}

using Row = std::function<std::string(std::size_t)>;
std::string Rows(const Row& row, bool backwards = false) {
  std::string text;
  for (std::size_t k = 0; k < kRows; ++k) {
    text += row(backwards ? kRows - 1 - k : k) + "\n";
  }
  return text;
}
std::string Plain(std::size_t k) {
  return Fixed(kValve.cv[k]) + "," + Fixed(kValve.x[k]) + "," +
         Fixed(kValve.f[k]);
}
std::string Wide(const std::string& header, const Row& time) {
  return header + "\n" +
         Rows([&](std::size_t k) { return time(k) + "," + Plain(k); });
}
/// One reading per row and tag; `cell` gets the row, tag and value.
std::string Tall(const std::function<
                     std::string(std::size_t, const std::string&, double)>& row,
                 bool by_tag) {
  std::string text;
  const std::array<std::pair<const char*, const std::array<double, kRows>*>, 3>
      tags{{{"17FC.OP", &kValve.cv},
            {"17ZT.PV", &kValve.x},
            {"17FT.PV", &kValve.f}}};
  for (std::size_t i = 0; i < 3 * kRows; ++i) {
    const auto& [tag, values] = by_tag ? tags[i / kRows] : tags[i % 3];
    const std::size_t k = by_tag ? i % kRows : i / 3;
    text += row(k, tag, (*values)[k]) + "\n";
  }
  return text;
}

struct Kind {
  const char* name;
  std::string text;
  std::set<std::size_t> without_x{};
  std::set<std::size_t> without_f{};
  std::int64_t start{kStart};
  std::size_t samples{kRows};
};

std::set<std::size_t> Range(std::size_t from, std::size_t to) {
  std::set<std::size_t> rows;
  for (std::size_t k = from; k <= to; ++k) {
    rows.insert(k);
  }
  return rows;
}

std::vector<Kind> Kinds() {
  const std::string names = "FC17.OUT,ZT17.PV,FT17.PV";
  const auto count = [](std::int64_t per_second, std::int64_t origin) {
    return [=](std::size_t k) {
      return std::to_string((kStart + static_cast<std::int64_t>(k) + origin) *
                            per_second);
    };
  };
  const auto in = [](std::size_t k, std::size_t from, std::size_t to) {
    return k >= from && k <= to;
  };
  std::vector<Kind> kinds = {
      {"months in front, in quotes", Wide("t_stamp," + names,
                                          [](std::size_t k) {
                                            return '"' +
                                                   Clock(
                                                       "%b %d, %Y %I:%M:%S "
                                                       "%p",
                                                       k) +
                                                   '"';
                                          })},
      {"seconds since 1970", Wide("ts," + names, count(1, 0))},
      {"milliseconds since 1970", Wide("ts," + names, count(1000, 0))},
      {"microseconds since 1970", Wide("ts," + names, count(1000000, 0))},
      {"nanoseconds since 1970", Wide("ts," + names, count(1000000000, 0))},
      {"100 ns since 1601",
       Wide("Timestamp," + names, count(10000000, 11644473600))},
      {"no name above the times",
       Wide(",17FC.OP,17ZT.PV,17FT.PV",
            [](std::size_t k) { return Clock("%Y-%m-%d %H:%M:%S", k); })},
      {"newest first",
       "time," + names + "\n" +
           Rows([](std::size_t k) { return Iso(k) + "," + Plain(k); }, true)},
      {"date and time apart, newest first, sums at the end",
       "$DATE,$TIME,FV 17 OUT %,FV 17 POS %,FLOW 17 t/h\n" +
           Rows(
               [](std::size_t k) {
                 return Clock("%d.%m.%Y,%H:%M:%S,", k) + Plain(k);
               },
               true) +
           "Average,,37.00,37.00,80.00\nMax,,50,50,120\n"},
      {"sections, comments and short years",
       "* exported by station 4\n[Data]\nTag,TimeStamp,Value,DataQuality\n" +
           Tall(
               [](std::size_t k, const std::string& tag, double value) {
                 return tag + Clock(",3/%d/%y %H:%M:%S,", k) + Fixed(value) +
                        ",Good";
               },
               false)},
      {"names, units and descriptions",
       "Date;FV6 output;FV6 travel;FT6 flow\n;%;%;t/h\n;to the positioner;of "
       "the stem;behind the valve\n" +
           Rows([](std::size_t k) {
             return Clock("%d.%m.%Y %H:%M:%S;", k) + Comma(kValve.cv[k]) + ";" +
                    Comma(kValve.x[k]) + ";" + Comma(kValve.f[k]);
           })},
      {"units in the cells",
       "\"Time\",\"FV-17 output\",\"FV-17 travel\",\"FT-17 flow\"\n" +
           Rows([](std::size_t k) {
             return Clock("%Y-%m-%d %H:%M:%S,", k) + Fixed(kValve.cv[k]) +
                    "%," + Fixed(kValve.x[k]) + " %," + Fixed(kValve.f[k]) +
                    " t/h";
           })},
      {"thousands",
       "Time,FV-17 output [%],FV-17 travel [%],FT-17 flow [kg/h]\n" +
           Rows([](std::size_t k) {
             const auto flow = std::llround(1e4 * kValve.f[k]);
             return Clock("%Y-%m-%d %H:%M:%S,", k) + Fixed(kValve.cv[k]) + "," +
                    Fixed(kValve.x[k]) + ",\"" + std::to_string(flow / 10000) +
                    "," + std::to_string(1000 + flow / 10 % 1000).substr(1) +
                    "." + std::to_string(flow % 10) + "\"";
           })},
      {"an annotated table of each tag",
       [] {
         std::string text;
         const std::array<
             std::pair<const char*, const std::array<double, kRows>*>, 3>
             tags{{{"FV17.OP", &kValve.cv},
                   {"FV17.ZT", &kValve.x},
                   {"FV17.FT", &kValve.f}}};
         for (const auto& [tag, values] : tags) {
           text +=
               "#datatype,string,dateTime,dateTime,double,string\n"
               "#default,_result,,,,\n,table,_start,_time,_value,_field\n";
           for (std::size_t k = 0; k < kRows; ++k) {
             text += ",0," + Iso(0) + "," + Iso(k) + "," + Fixed((*values)[k]) +
                     "," + tag + "\n";
           }
           text += "\n";
         }
         return text;
       }()},
      {"tags in order, markers, validity",
       "\"VarName\";\"TimeString\";\"VarValue\";\"Validity\";\"Time_ms\"\n" +
           Tall(
               [](std::size_t k, const std::string& tag, double value) {
                 const bool bad = tag == "17ZT.PV" && k >= 30 && k < 40;
                 return '"' + tag + "\";\"" + Clock("%d.%m.%Y %H:%M:%S\";", k) +
                        Comma(value) + (bad ? ";0;" : ";1;") +
                        "46091416666,667";
               },
               true) +
           "\"$RT_OFF$\";\"10.03.2026 09:12:00\";0;2;46091425000,000\n"
           "\"$RT_COUNT$\";2162;;;\n",
       Range(30, 39)},
      {"grades of quality",
       "NAME,TS,VALUE,STATUS\n" +
           Tall(
               [](std::size_t k, const std::string& tag, double value) {
                 const bool bad = tag == "17FT.PV" && k >= 50 && k < 60;
                 return tag + Clock(",%d-%b-%y %H:%M:%S,", k) + Fixed(value) +
                        (bad       ? ",2"
                         : k > 100 ? ",4"
                                   : ",0");
               },
               false),
       {},
       Range(50, 59)},
      {"true where a reading is bad",
       "tag,time,value,questionable\n" +
           Tall(
               [](std::size_t k, const std::string& tag, double value) {
                 const bool bad = tag == "17FT.PV" && k >= 50 && k < 60;
                 return tag + "," + Iso(k) + "," + Fixed(value) +
                        (bad ? ",true" : ",false");
               },
               false),
       {},
       Range(50, 59)},
      {"words of a control system",
       "Tag,Time,Value,Status\n" +
           Tall(
               [](std::size_t k, const std::string& tag, double value) {
                 const bool bad = tag == "17ZT.PV" && k < 10;
                 return tag + "," + Iso(k) + "," + Fixed(value) +
                        (bad ? ",BadSensorFailure" : ",GoodNonCascade");
               },
               false),
       Range(0, 9)},
      {"quality beside each value",
       "Time,FIC17/OP.CV,FIC17/OP.ST,FV17/ZT.CV,FV17/ZT.ST,FT17/PV.CV,"
       "FT17/PV.ST\n" +
           Rows([&](std::size_t k) {
             return Iso(k) + "," + Fixed(kValve.cv[k]) + ",Good," +
                    Fixed(kValve.x[k]) + ",Good," +
                    (in(k, 40, 49) ? "0.0,Bad" : Fixed(kValve.f[k]) + ",Good");
           }),
       {},
       Range(40, 49)},
      {"words for no reading",
       "time,17FC.OP,17ZT.PV,17FT.PV\n" + Rows([&](std::size_t k) {
         return Iso(k) + "," + Fixed(kValve.cv[k]) + "," +
                (in(k, 10, 19)   ? "Inp OutRange"
                 : in(k, 60, 62) ? "Defekt am Geber"
                                 : Fixed(kValve.x[k])) +
                "," + (in(k, 30, 32) ? "Set to Bad" : Fixed(kValve.f[k]));
       }),
       [] {
         auto rows = Range(10, 19);
         rows.merge(Range(60, 62));
         return rows;
       }(),
       Range(30, 32)},
      {"numbers of a state",
       "time,FC2.OP,ZT2.PV,FT2.PV\n" + Rows([&](std::size_t k) {
         return Iso(k) + "," + Fixed(kValve.cv[k]) + "," +
                (in(k, 70, 79) ? k < 75 ? "246.000" : "253.000"
                               : Fixed(kValve.x[k])) +
                "," + Fixed(kValve.f[k]);
       }),
       Range(70, 79)},
      {"blanks between thousands, tabs, decimal commas, brackets",
       "Zeit\tV 17 [Stellgröße] (%)\tV 17 [Stellung] (%)\tF 17 [Durchfluß] "
       "(kg/h)\n" +
           Rows([](std::size_t k) {
             const auto flow = std::llround(1e3 * kValve.f[k]);
             return Clock("%d.%m.%Y %H:%M:%S\t", k) + Comma(kValve.cv[k]) +
                    "\t" + Comma(kValve.x[k]) + "\t" +
                    std::to_string(flow / 1000) + " " +
                    std::to_string(1000 + flow % 1000).substr(1) + ",0";
           })},
      {"100 ns since year 1",
       Wide("Ticks," + names, count(10000000, 62135596800))},
      {"seconds since 1904", Wide("Time," + names, count(1, 2082844800))},
      {"Julian days", Wide("JD," + names,
                           [](std::size_t k) {
                             return Fixed(
                                 2440587.5 + (static_cast<double>(kStart) +
                                              static_cast<double>(k)) /
                                                 86400.0,
                                 8);
                           })},
      {"days of MATLAB", Wide("Time," + names,
                              [](std::size_t k) {
                                return Fixed(
                                    719529.0 + (static_cast<double>(kStart) +
                                                static_cast<double>(k)) /
                                                   86400.0,
                                    8);
                              })},
      {"digits alone",
       Wide("time," + names,
            [](std::size_t k) { return Clock("%Y%m%d%H%M%S", k); })},
      {"blanks between the columns",
       "Date        Time      FV17.OP  FV17.ZT  FT17.PV\n" +
           Rows([](std::size_t k) {
             return Clock("%Y-%m-%d  %H:%M:%S  ", k) + Fixed(kValve.cv[k]) +
                    "   " + Fixed(kValve.x[k]) + " " + Fixed(kValve.f[k]);
           })},
      {"a title of measurement, and a column that no row has",
       "LabVIEW Measurement\t\nWriter_Version\t2\nSeparator\tTab\n"
       "***End_of_Header***\t\nChannels\t3\t\t\t\n"
       "Y_Unit_Label\t%\t%\tt/h\t\nX_Dimension\tTime\tTime\tTime\t\n"
       "Delta_X\t1.0\t1.0\t1.0\t\n***End_of_Header***\t\t\t\t\n"
       "Time\tFV17 Output\tFV17 Position\tFT17 Flow\tComment\n" +
           Rows([](std::size_t k) {
             return Iso(k) + "\t" + Fixed(kValve.cv[k]) + "\t" +
                    Fixed(kValve.x[k]) + "\t" + Fixed(kValve.f[k]);
           })},
      {"a query with a line and a count",
       "         time         |   tag   |  value\n"
       "----------------------+---------+--------\n" +
           Tall(
               [](std::size_t k, const std::string& tag, double value) {
                 return ' ' + Clock("%Y-%m-%d %H:%M:%S+00", k) + " | " + tag +
                        " | " + Fixed(value);
               },
               false) +
           "(360 rows)\n"},
      {"a time beside each value, tags above",
       "17FC101.OP,,17ZT101.PV,,17FT101.PV,\n"
       "Timestamp,Value,Timestamp,Value,Timestamp,Value\n" +
           Rows([](std::size_t k) {
             const std::string time = Clock("%d-%b-%y %H:%M:%S,", k);
             return time + Fixed(kValve.cv[k]) + "," + time +
                    Fixed(kValve.x[k]) + "," + time + Fixed(kValve.f[k]);
           })},
      {"quality under one name", "time,FC17.OUT,Q,ZT17.PV,Q,FT17.PV,Q\n" +
                                     Rows([&](std::size_t k) {
                                       return Iso(k) + "," +
                                              Fixed(kValve.cv[k]) + ",G," +
                                              Fixed(kValve.x[k]) +
                                              (in(k, 5, 9) ? ",B," : ",G,") +
                                              Fixed(kValve.f[k]) + ",G";
                                     }),
       Range(5, 9)},
      {"confidence and units of each reading",
       "Tagname,Timestamp,Value,Confidence,Units\n" +
           Tall(
               [](std::size_t k, const std::string& tag, double value) {
                 const bool bad = tag == "17FT.PV" && k >= 50 && k < 60;
                 return tag + "," + Iso(k) + "," + Fixed(value) +
                        (bad ? ",0," : ",100,") +
                        (tag == "17FT.PV" ? "T/H" : "PCT");
               },
               false),
       {},
       Range(50, 59)},
      {"two columns of quality, one of them known",
       "DateTime|TagName|Value|Quality|OPCQuality\n" +
           Tall(
               [](std::size_t k, const std::string& tag, double value) {
                 const bool bad = tag == "17ZT.PV" && k >= 50 && k < 60;
                 return Iso(k) + "|" + tag + "|" + Fixed(value) +
                        (bad ? "|1|24" : "|0|192");
               },
               false),
       Range(50, 59)},
      {"rows and headers twice",
       [&] {
         std::string text;
         for (std::size_t k = 0; k < kRows; ++k) {
           const std::string row = Iso(k) + "," + Plain(k) + "\n";
           text += k % 40 == 0 ? "time," + names + "\n" : "";
           text += k == 50 ? row + row : row;
         }
         return text;
       }()},
      {"more words for no reading",
       "time,17FC.OP,17ZT.PV,17FT.PV\n" + Rows([&](std::size_t k) {
         static constexpr const char* kWords[] = {
             "<No Data>",    "NO_DATA",     "[-11059] No Good Data",
             "Not Connected", "*****",      "--.-",
             "\\N",          "Bad_Value",   "1.#QNAN",
             "Equip Fail",   "{null}",      "Bad, Device Failure"};
         return Iso(k) + "," + Fixed(kValve.cv[k]) + "," +
                (in(k, 20, 31) ? '"' + std::string(kWords[k - 20]) + '"'
                               : Fixed(kValve.x[k])) +
                "," + Fixed(kValve.f[k]);
       }),
       Range(20, 31)},
      {"settings that look like rows in front of the names",
       "Channels\t3\t\t\nSamples\t120\t120\t120\n"
       "Y_Unit_Label\t%\t%\tt/h\nX_Dimension\tTime\tTime\tTime\n"
       "X0\t0.0\t0.0\t0.0\n***End_of_Header***\t\t\t\t\n"
       "Time\tFV17 Output\tFV17 Position\tFT17 Flow\tComment\n" +
           Rows([](std::size_t k) {
             return Iso(k) + "\t" + Fixed(kValve.cv[k]) + "\t" +
                    Fixed(kValve.x[k]) + "\t" + Fixed(kValve.f[k]);
           })},
      {"a title and the header on each page",
       [&] {
         std::string text;
         for (std::size_t k = 0; k < kRows; ++k) {
           text += k % 50 == 0 ? "\nTrend of unit 3,,,page " +
                                     std::to_string(k / 50 + 1) + "\ntime," +
                                     names + "\n"
                               : "";
           text += Iso(k) + "," + Plain(k) + "\n";
         }
         return text;
       }()},
      {"a clock with its zone, apart from the date",
       "Date,Clock," + names + "\n" + Rows([](std::size_t k) {
         return Clock("%Y-%m-%d,%H:%M:%SZ,", k) + Plain(k);
       })},
      {"weekdays, a unit behind a slash",
       "Zeit;Y/%;X/%;q/(t/h)\n" + Rows([](std::size_t k) {
         return "Di., " + Clock("%d.%m.%Y %H:%M:%S;", k) +
                Fixed(kValve.cv[k], 4) + ";" + Fixed(kValve.x[k], 4) + ";" +
                Fixed(kValve.f[k], 4);
       })},
      {"currents in the cells",
       "Date,Clock,AO1 FV17,AI1 FV17,AI2 flow\n" + Rows([](std::size_t k) {
         return Clock("%Y-%m-%d,%H:%M:%S,", k) +
                Fixed(4.0 + 0.16 * kValve.cv[k], 4) + " mA," +
                Fixed(4.0 + 0.16 * kValve.x[k], 4) + " mA," +
                Fixed(kValve.f[k]) + " t/h";
       })},
      {"qualities of OPC HDA, with the kind of the reading",
       "ItemID\tTimestamp\tQuality\tValue\n" +
           Tall(
               [](std::size_t k, const std::string& tag, double value) {
                 const bool bad = tag == "17ZT.PV" && k >= 50 && k < 60;
                 return tag + "\t" + Iso(k) +
                        (bad ? "\t524288\t" : "\t262336\t") + Fixed(value, 4);
               },
               true),
       Range(50, 59)},
      {"a leap second",
       [&] {
         // date -d 2016-12-31T23:59:00Z +%s
         std::string text = "time," + names + "\n";
         for (std::size_t k = 0; k < kRows; ++k) {
           text +=
               Clock("%Y-%m-%dT%H:%M:%SZ,", k, 1'483'228'740) + Plain(k) + "\n";
           text += k == 59 ? "2016-12-31T23:59:60Z," + Plain(k) + "\n" : "";
         }
         return text;
       }(),
       {},
       {},
       1'483'228'740},
  };
  return kinds;
}

/// The map that sniff writes, read back as a user's file.
ColumnMap MapOf(const std::string& text, const ColumnMap& given = {}) {
  const storage::TemporaryDirectory directory;
  const auto path = directory.path() / "tags.toml";
  std::ofstream(path) << MapText(Sniff(text, "plant.csv", given), "plant.csv");
  return ReadTagMap(path);
}

ColumnMap Utc() {
  ColumnMap map;
  map.zone = "UTC";
  return map;
}

std::string Findings(const std::string& text) {
  const Sniffed found = Sniff(text, "plant.csv", Utc());
  std::string all;
  for (const std::string& finding : found.findings) {
    all += finding + "\n";
  }
  return all;
}

ColumnMap FlowMap(const std::string& keys) {
  const storage::TemporaryDirectory directory;
  const auto path = directory.path() / "tags.toml";
  std::ofstream(path) << "[signal.F]\ncolumn = \"FT3\"\n" << keys;
  return ReadTagMap(path);
}

TEST(TagMapTest, GasAtStandardConditionsBecomesMassByItsMolarMass) {
  struct Case {
    std::string unit;
    double molar_mass;
    double t_h;  // of 1000 in `unit`
  };
  // CO2: 3800 Nm3/h are 7461 kg/h (IEC 60534-2-1, example E3). Air has 1.2923
  // kg/Nm3, 1.2250 kg/Sm3 at 15 degC, and 1.2232 kg/m3 at 60 degF.
  for (const Case& known :
       {Case{"Nm3/h", 44.01, 7.461 / 3.8}, Case{"Nm³/h", 28.965, 1.2923},
        Case{"Sm3/h", 28.965, 1.2250}, Case{"scfh", 28.965, 1.2232 * 0.0283168},
        Case{"MMscfd", 28.965, 1e6 / 24 * 1.2232 * 0.0283168},
        Case{"Nl/min", 28.965, 0.06 * 1.2923}}) {
    const ColumnMap map =
        FlowMap("unit = \"" + known.unit +
                "\"\nmolar_mass = " + std::to_string(known.molar_mass) + "\n");
    EXPECT_EQ(map.flow_unit, FlowUnit::kTPerHour);
    EXPECT_NEAR(1e3 * map.columns.front().scale, known.t_h, 5e-4 * known.t_h)
        << known.unit;
    EXPECT_NO_THROW(CheckGasFlow(map, known.molar_mass));
    EXPECT_THROW(CheckGasFlow(map, 0.0), ConfigError) << "a liquid";
    EXPECT_THROW(CheckGasFlow(map, 18.015), ConfigError) << "another gas";
  }
  EXPECT_THROW(FlowMap("unit = \"Nm3/h\"\n"), ConfigError);
  EXPECT_THROW(FlowMap("unit = \"m3/h\"\nmolar_mass = 28.96\n"), ConfigError);
  EXPECT_NO_THROW(CheckGasFlow(FlowMap("unit = \"m3/h\"\n"), 0.0));
}

TEST(KindsTest, WhatSniffWritesTheImporterReads) {
  for (const Kind& kind : Kinds()) {
    SCOPED_TRACE(kind.name);
    ColumnMap map;
    CsvTable table;
    ASSERT_NO_THROW({
      map = MapOf(kind.text, Utc());
      map.resampling.reset();
      table = ReadCsv(kind.text, {.map = map, .split_gaps = true});
    });

    ASSERT_EQ(table.runs.size(), 1U);
    const auto& samples = table.runs[0].samples;
    EXPECT_EQ(samples.size(), kind.samples);
    EXPECT_EQ(table.runs[0].period_s, 1.0);
    EXPECT_EQ(table.start_ns, kind.start * 1'000'000'000);
    ASSERT_TRUE(table.dated);
    for (std::size_t k = 0; k < samples.size(); ++k) {
      const Sample& sample = samples[k].sample;
      EXPECT_NEAR(100.0 - sample[Signal::kCv], kValve.cv[k], 1e-3) << k;
      ASSERT_EQ(sample.Has(Signal::kX), !kind.without_x.contains(k)) << k;
      ASSERT_EQ(sample.Has(Signal::kF), !kind.without_f.contains(k)) << k;
      if (sample.Has(Signal::kX)) {
        EXPECT_NEAR(100.0 - sample[Signal::kX], kValve.x[k], 1e-3) << k;
      }
      // m3/h where a name states no unit, which sniff marks.
      if (sample.Has(Signal::kF)) {
        EXPECT_NEAR(sample[Signal::kF], kValve.f[k], 2e-3) << k;
      }
    }
  }
}

TEST(KindsTest, AmbiguousDecimalsAndDatesAreMarkedAsChoices) {
  const std::string points =
      "Date;FV6 output;FV6 travel;FT6 flow\n" + Rows([](std::size_t k) {
        return Clock("%d/03/2026 %H:%M:%S;", k) + Fixed(kValve.cv[k]) + ";" +
               Fixed(kValve.x[k]) + ";" + Fixed(10.0 + kValve.f[k]);
      });
  const Sniffed found = Sniff(points, "plant.csv", Utc());
  EXPECT_EQ(found.map.decimal, '.');
  EXPECT_THAT(found.choices, Contains(HasSubstr("decimal: ")));
  EXPECT_THAT(found.choices, Contains(HasSubstr("date: ")));
  EXPECT_THAT(MapText(found, "plant.csv"),
              HasSubstr("decimal = \".\"  # choice: every number"));

  ColumnMap given = Utc();
  given.decimal = '.';
  given.date_order = DateOrder::kMonthFirst;
  EXPECT_TRUE(Sniff(points, "plant.csv", given).choices.empty());
}

// In quotes between commas, as European spreadsheets save them.
TEST(KindsTest, QuotedDecimalCommasAreAChoice) {
  const std::string text = "Time,FC1.OP,ZT1.PV,FT1\n" + Rows([](std::size_t k) {
                             return Iso(k) + ",\"" +
                                    Comma(10.0 + kValve.cv[k]) + "\",\"" +
                                    Comma(10.0 + kValve.x[k]) + "\",\"" +
                                    Comma(1.0 + kValve.f[k]) + '"';
                           });
  EXPECT_THROW(ReadCsv(text, {.map = Utc()}), DataError);
  const Sniffed found = Sniff(text, "plant.csv", Utc());
  EXPECT_EQ(found.map.decimal, ',');
  EXPECT_THAT(found.choices, Contains(HasSubstr("decimal: ")));
  const CsvTable table = ReadCsv(text, {.map = MapOf(text, Utc())});
  EXPECT_NEAR(table.runs.at(0).samples[5].sample[Signal::kCv],
              90.0 - kValve.cv[5], 1e-3);
}

TEST(KindsTest, AColumnNamedUtcNeedsNoZone) {
  const auto zone = [](const std::string& name, const ColumnMap& given) {
    return Sniff(Wide(name + ",FC1.OP,ZT1.PV,FT1",
                      [](std::size_t k) {
                        return Clock("%Y-%m-%d %H:%M:%S", k);
                      }),
                 "plant.csv", given)
        .map.zone;
  };
  EXPECT_EQ(zone("Time (UTC)", {}), "UTC");
  EXPECT_EQ(zone("timestamp_utc", {}), "UTC");
  EXPECT_EQ(zone("Time", {}), "");
  ColumnMap given;
  given.zone = "Europe/Warsaw";
  EXPECT_EQ(zone("UTC Time", given), "Europe/Warsaw");
}

// Nothing in the file says the day: --start does.
TEST(KindsTest, TimesWithoutADateCountFromTheStart) {
  // "23:59:07" of "23:mm:ss", minutes and seconds.
  const auto part = [](std::string form, std::size_t minute,
                       std::size_t second) {
    form.replace(form.find("mm"), 2, std::to_string(100 + minute).substr(1));
    return form.replace(form.find("ss"), 2,
                        std::to_string(100 + second).substr(1));
  };
  struct Case {
    const char* first;
    std::function<std::string(std::size_t)> time;
    double begin_s;
  };
  const std::vector<Case> cases = {
      // Over midnight, and in two rounds of an hour.
      {"23:59:00",
       [&](std::size_t k) {
         return part(k < 60 ? "23:mm:ss" : "00:mm:ss", k < 60 ? 59 : 0, k % 60);
       },
       86340.0},
      {"11:59:00 PM",
       [&](std::size_t k) {
         return part(k < 60 ? "11:mm:ss PM" : "12:mm:ss AM", k < 60 ? 59 : 0,
                     k % 60);
       },
       86340.0},
      {"59:00.0",
       [&](std::size_t k) {
         return part("mm:ss.0", (59 + k / 60) % 60, k % 60);
       },
       3540.0},
      {"25:00:00",
       [&](std::size_t k) { return part("25:mm:ss", k / 60, k % 60); },
       90000.0},
      {"0 days 00:00:00",
       [&](std::size_t k) { return part("0 days 00:mm:ss", k / 60, k % 60); },
       0.0},
      {"0 sec", [](std::size_t k) { return std::to_string(k) + " sec"; }, 0.0}};
  for (const Case& c : cases) {
    SCOPED_TRACE(c.first);
    ASSERT_EQ(c.time(0), c.first);
    const std::string text = Wide("Time,17FC.OP,17ZT.PV,17FT.PV", c.time);
    const ColumnMap map = MapOf(text, Utc());
    EXPECT_EQ(map.time_unit.form, TimeForm::kClock);
    CsvTable table;
    ASSERT_NO_THROW(table =
                        ReadCsv(text, {.map = map, .start_ns = 7'000'000'000}));
    ASSERT_EQ(table.runs.size(), 1U);
    EXPECT_FALSE(table.dated);
    const auto& samples = table.runs[0].samples;
    ASSERT_EQ(samples.size(), kRows);
    EXPECT_EQ(table.runs[0].period_s, 1.0);
    EXPECT_EQ(samples[0].sample.stamp_ns,
              7'000'000'000 + std::llround(c.begin_s * 1e9));
    EXPECT_THAT(Findings(text), HasSubstr("times without a date"));
  }
  EXPECT_THROW(ReadCsv(Wide("Time,17FC.OP,17ZT.PV,17FT.PV",
                            [&](std::size_t k) {
                              return part("09:mm:ss", k / 60,
                                          k == 7 ? 99 : k % 60);
                            }),
                       {.map = Utc()}),
               DataError);
}

// The smallest usual range that command and position fit; whole numbers of a
// flow beside percentages are none.
TEST(KindsTest, CountsAreOfTheSmallestUsualRange) {
  for (const double full : {1000.0, 4095.0, 10000.0, 27648.0}) {
    const std::string text =
        "time,LV1_CMD,LV1_FBK,FT1\n" + Rows([&](std::size_t k) {
          return Iso(k) + "," + Fixed(full / 100.0 * kValve.cv[k], 0) + "," +
                 Fixed(full / 100.0 * kValve.x[k], 0) + "," +
                 Fixed(kValve.f[k]);
        });
    const CsvTable table = ReadCsv(text, {.map = MapOf(text, Utc())});
    const Sample& sample = table.runs.at(0).samples.at(9).sample;
    EXPECT_NEAR(sample[Signal::kCv], 100.0 - kValve.cv[9], 0.06) << full;
    EXPECT_NEAR(sample[Signal::kX], 100.0 - kValve.x[9], 0.06) << full;
    EXPECT_NEAR(sample[Signal::kF], kValve.f[9], 1e-3) << full;
  }
  const Sniffed mass =
      Sniff("time,LV1_CMD,LV1_FBK,FT1\n" + Rows([&](std::size_t k) {
              return Iso(k) + "," + Fixed(kValve.cv[k]) + "," +
                     Fixed(kValve.x[k]) + "," + Fixed(1000.0 * kValve.f[k], 0);
            }),
            "plant.csv", Utc());
  EXPECT_EQ(mass.columns.at(2).signal, Signal::kF);
  EXPECT_EQ(mass.columns.at(2).unit, "kg/h");
  EXPECT_TRUE(mass.columns.at(2).raw.empty());
}

TEST(KindsTest, FlaggedReadingsAreUncertain) {
  const std::string text =
      "time,FC1.OP,ZT1.PV,FT1 [t/h]\n" + Rows([](std::size_t k) {
        return Iso(k) + "," + Fixed(kValve.cv[k]) + "," + Fixed(kValve.x[k]) +
               (k == 7 ? "?" : "") + "," + Fixed(kValve.f[k]) +
               (k == 9 ? "*" : "");
      });
  const ColumnMap map = MapOf(text);
  const auto table = ReadCsv(text, {.map = map});
  const auto& samples = table.runs[0].samples;
  EXPECT_NEAR(100.0 - samples[7].sample[Signal::kX], kValve.x[7], 1e-3);
  EXPECT_EQ(samples[7].sample.quality[Index(Signal::kX)],
            SignalQuality::kUncertain);
  EXPECT_EQ(samples[8].sample.quality[Index(Signal::kX)], SignalQuality::kGood);
  EXPECT_EQ(samples[9].sample.quality[Index(Signal::kF)],
            SignalQuality::kUncertain);
}

TEST(KindsTest, ARefusalNamesTheLikeliestCause) {
  const std::pair<std::string, const char*> files[] = {
      {"Timestamp,Value,Timestamp,Value\n" + Rows([](std::size_t k) {
         return Iso(k) + "," + Fixed(kValve.cv[k]) + "," + Iso(k + k / 7) +
                "," + Fixed(kValve.x[k]);
       }),
       "each value has a time of its own"},
      {"time,CV,X,F\n" + Rows([](std::size_t k) {
         return Clock("%Y-%m-%d %H:%M:%S CST,", k) + Plain(k);
       }),
       "has a zone that is not known, or that several countries use"},
      {"Tag: FC1.OP\nTimestamp,Value\n" + Rows([](std::size_t k) {
         return Iso(k) + "," + Fixed(kValve.cv[k]);
       }) + "\nTag: ZT1.PV\nTimestamp,Value\n" +
           Rows(
               [](std::size_t k) { return Iso(k) + "," + Fixed(kValve.x[k]); }),
       "another table begins here"}};
  for (const auto& [text, says] : files) {
    std::string said;
    try {
      const ColumnMap map = MapOf(text, Utc());
    } catch (const DataError& error) {
      said = error.what();
    }
    EXPECT_THAT(said, HasSubstr(says));
  }
}

// A shut line lasts longer than what shows the sense.
TEST(KindsTest, AFaultThatLastsDoesNotTurnTheSense) {
  std::string text = "time,FC1.OP,ZT1.PV,FT1 [t/h]\n";
  for (std::size_t k = 0; k < 1400; ++k) {
    const std::size_t at = k % kRows;
    text +=
        Clock("%Y-%m-%dT%H:%M:%SZ,", k) +
        (k < 480 ? Plain(at)
                 : "100.000,100.000,0.01" + Fixed(static_cast<double>(at), 0)) +
        "\n";
  }
  const Sniffed found = Sniff(text, "plant.csv", Utc());
  EXPECT_TRUE(found.columns[0].opening);
  EXPECT_TRUE(found.columns[1].opening);
}

TEST(KindsTest, UnknownQualityIsNamedAndRefused) {
  const std::string text =
      "Tag,Time,Value,Quality\n" +
      Tall(
          [](std::size_t k, const std::string& tag, double value) {
            return tag + "," + Iso(k) + "," + Fixed(value) +
                   (k == 3 ? ",Wobbly" : ",Good");
          },
          false);
  const ColumnMap map = MapOf(text);
  try {
    ReadCsv(text, {.map = map});
    FAIL() << "not refused";
  } catch (const DataError& error) {
    EXPECT_THAT(error.what(), HasSubstr("\"Wobbly\" is no known quality"));
  }
  // Also where nothing but the other cells says that it is a quality.
  const std::string beside = "time,FC1.OP,ZT1.PV,Q\n" + Rows([](std::size_t k) {
                               return Iso(k) + "," + Fixed(kValve.cv[k]) + "," +
                                      Fixed(kValve.x[k]) +
                                      (k == 3 ? ",P" : ",G");
                             });
  EXPECT_THAT(Findings(beside), HasSubstr("\"P\" is no known quality"));
  ColumnMap more = map;
  more.quality.uncertain = {"wobbly"};
  const Sample sample = ReadCsv(text, {.map = more}).runs[0].samples[3].sample;
  EXPECT_EQ(sample.quality[Index(Signal::kX)], SignalQuality::kUncertain);
}

TEST(KindsTest, SignalsAreRequiredByReadingsNotByHeaders) {
  const std::string text = "time,CV,X,Q\n" + Rows([](std::size_t k) {
                             return Iso(k) + "," + Fixed(kValve.cv[k]) + "," +
                                    Fixed(kValve.x[k]) + ",bad";
                           });
  ColumnMap map;
  map.columns = {{"CV", Signal::kCv}, {"X", Signal::kX}};
  map.quality_of = {{"X", "Q"}};
  try {
    ReadCsv(text, {.map = map, .required = MaskOf(Signal::kX)});
    FAIL() << "not refused";
  } catch (const DataError& error) {
    EXPECT_THAT(error.what(), HasSubstr("no reading of CV in 120 rows"));
  }
}

// A fifth of the readings of X and F are codes, and two are outliers.
TEST(KindsTest, StateCodesAndOutliersDecideNothing) {
  const auto guess = [](const std::string& names, const Row& x, const Row& f) {
    const Sniffed found =
        Sniff("time," + names + "\n" + Rows([&](std::size_t k) {
                return Iso(k) + "," + Fixed(kValve.cv[k]) + "," +
                       (k % 5 == 2 ? x(k) : Fixed(kValve.x[k])) + "," +
                       (k % 5 == 4 ? f(k) : Fixed(kValve.f[k]));
              }),
              "plant.csv", Utc());
    EXPECT_EQ(found.columns[0].signal, Signal::kCv) << names;
    EXPECT_EQ(found.columns[1].signal, Signal::kX) << names;
    EXPECT_EQ(found.columns[2].signal, Signal::kF) << names;
    EXPECT_EQ(found.columns[1].unit, "%") << names;
    EXPECT_TRUE(found.columns[0].opening && found.columns[1].opening) << names;
    EXPECT_TRUE(found.columns[1].raw.empty()) << names;
  };
  const auto outlier = [](std::size_t k, const std::string& code) {
    return k == 52 || k == 84 ? "1e7" : code;
  };
  guess(
      "FC2.OP,ZT2.PV,FT2 [t/h]",
      [&](std::size_t k) { return outlier(k, k < 60 ? "-9999" : "32767"); },
      [&](std::size_t k) { return outlier(k, "-9999"); });
  // Far on the other side of zero than the readings.
  guess(
      "FC2.OP,ZT2.PV,FT2.PV", [&](std::size_t) { return "-32768"; },
      [&](std::size_t) { return "9999"; });
}

// Numbers that are no codes: what a valve does in a fifth of the time counts.
TEST(KindsTest, RarePositionsAreNotTakenForCodes) {
  const auto unit = [](const Row& x) {
    const std::string text =
        "time,FC2.OP,ZT2.PV,FT2.PV\n" + Rows([&](std::size_t k) {
          return Iso(k) + "," + Fixed(kValve.cv[k]) + "," + x(k) + "," +
                 Fixed(kValve.f[k]);
        });
    return Sniff(text, "plant.csv", Utc()).columns[1].unit;
  };
  EXPECT_EQ(unit([](std::size_t k) {
              return k % 5 == 0 ? "100" : Fixed(0.01 * kValve.x[k]);
            }),
            "%");
  EXPECT_EQ(unit([](std::size_t k) { return Fixed(0.01 * kValve.x[k]); }), "1");
}

TEST(KindsTest, CountsBeyondTheCardAreABrokenWire) {
  const std::string text =
      "time,AO_FV17,AI_ZT17,AI_FT17\n" + Rows([](std::size_t k) {
        const auto counts = [](double percent) {
          return std::to_string(std::llround(276.48 * percent));
        };
        return Iso(k) + "," + counts(kValve.cv[k]) + "," +
               (k >= 45 && k < 50 ? "32767" : counts(kValve.x[k])) + "," +
               counts(kValve.f[k]);
      });
  const ColumnMap map = MapOf(text);
  const auto table = ReadCsv(text, {.map = map});
  const auto& samples = table.runs[0].samples;
  EXPECT_NEAR(100.0 - samples[44].sample[Signal::kX], kValve.x[44], 0.01);
  EXPECT_FALSE(samples[45].sample.Has(Signal::kX));
  EXPECT_FALSE(samples[49].sample.Has(Signal::kX));
  EXPECT_TRUE(samples[50].sample.Has(Signal::kX));
  EXPECT_THAT(table.notes, Contains(HasSubstr("5 cells beyond `raw`")));
}

TEST(KindsTest, UnitsAndRangesBeatLettersOfTags) {
  struct Tag {
    const char* name;
    std::optional<Signal> signal;
  };
  const auto guess = [](const std::string& name, double scale, double offset,
                        const std::string& others = "") {
    const std::string text =
        "time," + name + (others.empty() ? "" : "," + others) + "\n" +
        Rows([&](std::size_t k) {
          return Iso(k) + "," + Fixed(offset + scale * kValve.x[k]) +
                 (others.empty() ? "" : "," + Fixed(kValve.cv[k]));
        });
    return Sniff(text, "plant.csv", {}).columns[0].signal;
  };
  for (const Tag& tag : std::initializer_list<Tag>{
           {"FIC-101.OP", Signal::kCv},
           {"FIC-101/PID1/OUT", Signal::kCv},
           {"FIC-101/PID1/PV", Signal::kF},
           {"17FC.OUT", Signal::kCv},
           {"FY12", Signal::kCv},
           {"FV_211", Signal::kCv},
           {"V17.Stellgröße", Signal::kCv},
           {"Vanne 12 commande", Signal::kCv},
           {"Válvula 12 salida", Signal::kCv},
           {"Zawór 12 sterowanie", Signal::kCv},
           {"MV101.CMD", Signal::kCv},
           {"FV-7.ZT", Signal::kX},
           {"GT 51", Signal::kX},
           {"V17 Rückmeldung", Signal::kX},
           {"Vanne 12 recopie", Signal::kX},
           {"Válvula 12 posición", Signal::kX},
           {"Zawór 12 położenie", Signal::kX},
           {"Retroalimentación válvula", Signal::kX},
           {"RV12 Soll Ventilstellung", Signal::kCv},
           {"Consigne position vanne", Signal::kCv},
           {"Flujo másico", Signal::kF},
           {"Pression sortie [bar]", Signal::kP2},
           {"Presión salida [bar]", Signal::kP2},
           {"Inlet temp [°C]", Signal::kT1},
           {"FT101 [t/h]", Signal::kF},
           {"Durchfluß 3 [m³/h]", Signal::kF},
           {"débit eau", Signal::kF},
           {"Caudal 4", Signal::kF},
           {"Przepływ 5", Signal::kF},
           {"FIC-101.PV", Signal::kF},
           {"PT101 [bar]", Signal::kP1},
           {"Ciśnienie przed zaworem [bar]", Signal::kP1},
           {"Pression aval [bar]", Signal::kP2},
           {"TT12 [°C]", Signal::kT1},
           {"LT7 [%]", std::nullopt},
           {"LIC7.PV", std::nullopt},
           {"FT9 [rpm]", std::nullopt},
           {"FT3 [Nm3/h]", std::nullopt}}) {
    EXPECT_EQ(guess(tag.name, 1.0, 0.0), tag.signal) << tag.name;
  }
  EXPECT_EQ(guess("FV9 I [mA]", 0.16, 4.0), Signal::kCv);
  EXPECT_EQ(guess("FV-7.PV", 1.0, 0.0, "FIC7.OP"), Signal::kX);
  EXPECT_EQ(guess("FV-7.PV", 1.0, 0.0, "FV-7.ZT"), Signal::kCv);
  // Pulses of a flow meter are no opening.
  EXPECT_EQ(guess("FV-7 position", 1000.5, 0.0), std::nullopt);
}

// Whole sets of tags, each with what it is: a wrong guess in silence is worse
// than none.
TEST(KindsTest, TagsOfAPlantAreToldApartTogether) {
  using Tags = std::vector<std::pair<const char*, const char*>>;
  const std::map<std::string, std::optional<Signal>> signals = {
      {"cv", Signal::kCv}, {"x", Signal::kX},   {"f", Signal::kF},
      {"sp", Signal::kSp}, {"p1", Signal::kP1}, {"p2", Signal::kP2}};
  const auto cell = [](const std::string& kind, std::size_t k) {
    return kind == "cv"      ? kValve.cv[k]
           : kind == "x"     ? kValve.x[k]
           : kind == "f"     ? kValve.f[k]
           : kind == "p1"    ? 35.0 - 0.02 * kValve.f[k]
           : kind == "p2"    ? 26.0 + 0.02 * kValve.f[k]
           : kind == "dp"    ? 9.0 - 0.04 * kValve.f[k]
           : kind == "total" ? 1000.0 + static_cast<double>(k / 3)
           : kind == "ends"  ? static_cast<double>(k / 100)
                             : 17.0;
  };
  for (const Tags& tags : std::initializer_list<Tags>{
           {{"FV101.SP", "cv"}, {"FV101.PV", "x"}, {"FT101.PV", "f"}},
           {{"FV101.READVALUE", "x"},
            {"FV101.WRITEVALUE", "cv"},
            {"FT101", "f"}},
           {{"HV12", "x"}, {"HV13", "cv"}, {"FT12", "f"}},
           {{"FIC-17/PID1/OUT.CV", "cv"},
            {"FIC-17/AI1/OUT.CV", "f"},
            {"ZT-17/AI1/OUT.CV", "x"}},
           {{"FIC17.PIDA.OP", "cv"},
            {"ZI17.DACA.PV", "x"},
            {"FIC17.PIDA.PV", "f"},
            {"FIC17.PIDA.SP", ""}},
           {{"FY101", "cv"}, {"FZT101", "x"}, {"FT101", "f"}},
           {{"LMN", "cv"}, {"LMNR_IN", "x"}, {"PV_IN", ""}},
           {{"10LAB30AA101.YQ01", "cv"},
            {"10LAB30AA101.XQ01", "x"},
            {"10LAB30CF001.XQ01", "f"},
            {"10LAB30AP001.XQ01", ""}},
           {{"10 LAB30 AA101 YQ01", "cv"},
            {"10 LAB30 AA101 XQ01", "x"},
            {"10 LAB30 CF001 XQ50", "f"},
            {"10 LAB30 CP001 XQ50", "p1"},
            {"10 LAB40 CP001 XQ50", "p2"}},
           {{"RL30S101 Y", "cv"}, {"RL30S101 X", "x"}, {"RL30F001", "f"}},
           {{"LC-7 Y", "cv"}, {"LV-7 GT", "x"}, {"F-7", "f"}},
           {{"u", "cv"}, {"x", "x"}, {"q", "f"}},
           {{"W.YSOLL", "cv"}, {"W.YIST", "x"}, {"W.QIST", "f"}},
           {{"11FC051.MV", "cv"},
            {"11FC051.PV", "f"},
            {"11FC051.SV", ""},
            {"11FC051.VP", "x"}},
           {{"FC7", "cv"}, {"GI7", "x"}, {"FI7", "f"}},
           {{"FEED WTR CTL VLV DMD", "cv"},
            {"FEED WTR CTL VLV POSN", "x"},
            {"FEED WTR FLOW", "f"}},
           {{"TagA", ""}, {"TagB", ""}, {"TagC", ""}},
           {{"U2_LV7_OUT", "cv"}, {"U2_LV7_POS", "x"}, {"U2_FT7", "f"}},
           {{"OUT%", "cv"}, {"POS%", "x"}, {"flow_tph", "f"}},
           {{"OP", "cv"}, {"PV", ""}, {"SV", "sp"}, {"FB", "x"}},
           {{"Flow Valve Cmd", "cv"},
            {"Flow Valve Pos", "x"},
            {"Flow Rate", "f"}},
           {{"valve_pos_ref", "cv"},
            {"valve_pos_act", "x"},
            {"flow_meas", "f"}},
           {{"ZSO101", "ends"},
            {"FV101.OP", "cv"},
            {"ZT101", "x"},
            {"FT101", "f"}},
           {{"FQI101.PV", "total"},
            {"FT101.PV", "f"},
            {"FV101.OP", "cv"},
            {"FV101.ZT", "x"}},
           {{"PDT101 [bar]", "dp"},
            {"FV101.OP", "cv"},
            {"FV101.ZT", "x"},
            {"FT101", "f"}},
           {{"PIC5.SP", ""}, {"PIC5.OP", "cv"}, {"ZT5", "x"}, {"FT5", "f"}},
           {{"Ventil Sollwert [%]", "cv"},
            {"Ventil Istwert [%]", "x"},
            {"Durchfluss Istwert [m3/h]", "f"}},
           {{"Reglerausgang [%]", "cv"},
            {"Ventilöffnung [%]", "x"},
            {"Massenstrom [t/h]", "f"}},
           {{"Stellbefehl [%]", "cv"},
            {"Rückführung [%]", "x"},
            {"Menge [t/h]", "f"},
            {"Vordruck (bar ü)", "p1"}},
           {{"Ventil Sollwert", "cv"},
            {"Ventil Istwert", "x"},
            {"FT7", "f"},
            {"Druck 2 [bar]", "p2"},
            {"PT7 [bar]", "p1"}},
           {{"consigne vanne", "cv"},
            {"position vanne", "x"},
            {"débit", "f"},
            {"pression amont", "p1"},
            {"pression aval", "p2"}},
           {{"Consigna de posición", "cv"},
            {"Posición real", "x"},
            {"Caudal", "f"},
            {"Presión de salida [bar]", "p2"}},
           {{"Uscita regolatore", "cv"},
            {"Posizione valvola", "x"},
            {"Portata", "f"},
            {"Pressione a monte", "p1"},
            {"Pressione a valle", "p2"}},
           {{"Wartość zadana położenia", "cv"},
            {"Otwarcie rzeczywiste", "x"},
            {"Natężenie przepływu", "f"}}}) {
    std::string header = "time";
    for (const auto& [name, kind] : tags) {
      header += std::string(",") + name;
    }
    const Sniffed found = Sniff(header + "\n" + Rows([&](std::size_t k) {
                                  std::string row = Iso(k);
                                  for (const auto& [name, kind] : tags) {
                                    row += "," + Fixed(cell(kind, k));
                                  }
                                  return row;
                                }),
                                "plant.csv", {});
    for (std::size_t i = 0; i < tags.size(); ++i) {
      const auto known = signals.find(tags[i].second);
      EXPECT_EQ(found.columns[i].signal,
                known == signals.end() ? std::nullopt : known->second)
          << tags[i].first << " beside " << tags[0].first;
    }
  }
}

TEST(KindsTest, WhatValveAndRecordTheModelsAreNotForIsSaid) {
  const auto wide = [](const std::string& header,
                       const std::function<std::string(std::size_t)>& cells) {
    return "time," + header + "\n" +
           Rows([&](std::size_t k) { return Iso(k) + "," + cells(k); });
  };
  EXPECT_THAT(Findings(wide("MV101.CMD,MV101.ZSO,FIT101 [m3/h]",
                            [](std::size_t k) {
                              const bool open = k / 30 % 2 == 1;
                              return open ? "100,100.0,2.4" : "0,0.0,0.0";
                            })),
              HasSubstr("an open/shut valve"));
  EXPECT_THAT(Findings(wide("FC1.OP,ZT1.PV,FT1 [t/h]",
                            [](std::size_t k) {
                              return Fixed(kValve.cv[k]) + "," +
                                     Fixed(kValve.cv[k]) + "," +
                                     Fixed(kValve.f[k]);
                            })),
              HasSubstr("X is a copy of CV"));
  EXPECT_THAT(Findings(wide("LIC7.OP [%],LT7 [%]",
                            [](std::size_t k) {
                              return Fixed(kValve.cv[k]) + "," +
                                     Fixed(50.0 + 0.01 * kValve.x[k]);
                            })),
              HasSubstr("LT7 [%] is a level"));
  EXPECT_THAT(Findings(wide("FIC8.OP [%],FT8 [t/h]",
                            [](std::size_t k) {
                              return Fixed(kValve.cv[k]) + "," +
                                     Fixed(kValve.f[k]);
                            })),
              HasSubstr("no position (X)"));
  const std::string gas = wide("FV3.OP,FV3.ZT,FT3 [Nm3/h]", Plain);
  EXPECT_THAT(Findings(gas), HasSubstr("a flow of gas"));
  EXPECT_THAT(MapText(Sniff(gas, "gas.csv", {}), "gas.csv"),
              HasSubstr("# [signal.F]\n# column = \"FT3 [Nm3/h]\""));
  EXPECT_THAT(
      Findings("time,FC1.OP,ZT1.PV,FT1 [t/h]\n" + Rows([](std::size_t k) {
                 return Clock("%Y-%m-%dT%H:%M:%SZ,", 60 * k) + Plain(k);
               })),
      HasSubstr("a slow record: one row in 60 s"));
  const std::string split =
      wide("PIC5.OP,PV5A.ZT,FT5A [t/h]", [](std::size_t k) {
        const double x = k > 100 ? 100.0 : kValve.x[k];
        return Fixed(k > 100 ? 70.0 : 0.5 * kValve.cv[k]) + "," + Fixed(x) +
               "," + Fixed(kValve.f[k]);
      });
  EXPECT_THAT(Findings(split), HasSubstr("split range"));
  const ColumnMap map = MapOf(split);
  const Sample open = ReadCsv(split, {.map = map}).runs[0].samples[110].sample;
  EXPECT_EQ(open[Signal::kCv], 0.0) << "fully open, not beyond its range";
}

// The files of the reference data: what their table says is right.
TEST(KindsTest, TheReferenceFilesGiveWhatTheirTableSays) {
  const char* folder = std::getenv("FDI_REFERENCE_DATA");
  if (folder == nullptr) {
    GTEST_SKIP() << "FDI_REFERENCE_DATA is not set";
  }
  struct File {
    const char* name;
    std::size_t samples;
    std::set<std::size_t> without_x{};
    std::set<std::size_t> without_f{};
    const char* zone{"UTC"};
    const char* says{""};  // Among the findings.
    std::int64_t start{kStart};
    double period_s{1.0};
  };
  const auto both = [](std::set<std::size_t> a, std::set<std::size_t> b) {
    a.merge(b);
    return a;
  };
  std::set<std::size_t> tens;  // The first ten rows of each hundred.
  for (std::size_t k = 0; k < 700; k += 100) {
    tens.merge(Range(k, k + 9));
  }
  const std::vector<File> files = {
      {"a01_wincc_archive", 720, Range(300, 329), {}, "Europe/Berlin"},
      {"a02_influx_annotated", 720},
      {"a03_influx1_ns", 720},
      {"a05_grafana_units", 720},
      {"a06_thousands", 720},
      {"a08_wide_quality", 720, {}, Range(400, 459)},
      {"a09_ip21_status", 720, {}, Range(500, 519)},
      {"a10_pi_states", 720,
       both(Range(100, 109), both(Range(350, 352), Range(360, 362))),
       both(Range(200, 205), Range(260, 263))},
      {"a11_s7_counts", 720, Range(450, 479)},
      {"a12_dst_tag_major",
       1440,
       {},
       {},
       "Europe/Berlin",
       "",
       1'792'888'200,
       5.0},
      {"a13_date_time_summary", 720},
      {"a14_section_two_digit_year", 720},
      {"a15_filetime", 720},
      {"a16_epoch_us", 720},
      {"a18_utf16_brackets", 720, {}, {}, "Europe/Berlin"},
      {"a19_quality_words_dcs", 700, tens, tens},
      {"b01_split_range", 1500, {}, {}, "UTC", "split range"},
      {"b03_gas_nm3h", 900, {}, {}, "UTC", "a flow of gas"},
      {"b05_no_position", 1800, {}, {}, "UTC", "no position (X)"},
      {"b06_on_off", 1800, {}, {}, "UTC", "an open/shut valve"},
      {"b07_low_flow_cutoff", 1800},
      {"b08_state_numbers", 900, both(Range(300, 329), Range(500, 509))},
      {"b09_units_row", 720},
      {"b10_supply_lost", 1800},
      {"b13_flow_95_t_h", 1501, {}, {}, "UTC", "", 0},
  };
  for (const File& file : files) {
    SCOPED_TRACE(file.name);
    const std::string text =
        ReadTextFile(std::string(folder) + "/cases/" + file.name + ".csv");
    ColumnMap map = Utc();
    map.zone = file.zone;
    std::string findings;
    for (const auto& finding : Sniff(text, file.name, map).findings) {
      findings += finding + "\n";
    }
    EXPECT_THAT(findings, HasSubstr(file.says));
    EXPECT_THAT(findings, Not(HasSubstr("refused as it is")));
    map = MapOf(text, map);
    map.resampling.reset();
    CsvTable table;
    ASSERT_NO_THROW(table = ReadCsv(text, {.map = map}));
    ASSERT_EQ(table.runs.size(), 1U);
    const SampleSeries& run = table.runs[0];
    EXPECT_EQ(run.samples.size(), file.samples);
    EXPECT_EQ(table.start_ns, file.start * 1'000'000'000);
    EXPECT_EQ(run.period_s, file.period_s);
    const bool has_x = (run.signals & MaskOf(Signal::kX)) != 0;
    const bool has_f = (run.signals & MaskOf(Signal::kF)) != 0;
    EXPECT_EQ(has_x, std::string(file.name) != "b05_no_position");
    EXPECT_EQ(has_f, std::string(file.name) != "b03_gas_nm3h");
    for (std::size_t k = 0; k < run.samples.size(); ++k) {
      const Sample& sample = run.samples[k].sample;
      ASSERT_EQ(sample.Has(Signal::kX), has_x && !file.without_x.contains(k))
          << k;
      ASSERT_EQ(sample.Has(Signal::kF), has_f && !file.without_f.contains(k))
          << k;
    }
    if (std::string(file.name).starts_with('a') &&
        std::string(file.name) != "a19_quality_words_dcs") {
      EXPECT_NEAR(run.samples[0].sample[Signal::kCv], 100.0 - 37.461, 0.01);
    }
  }
  const std::pair<const char*, const char*> refused[] = {
      {"a17_etl_headerless", "the first row holds values"},
      {"b04_level_loop", "LT7 [%] is a level"}};
  for (const auto& [name, says] : refused) {
    const std::string text =
        ReadTextFile(std::string(folder) + "/cases/" + name + ".csv");
    try {
      std::string findings;
      for (const auto& finding : Sniff(text, name, Utc()).findings) {
        findings += finding + "\n";
      }
      EXPECT_THAT(findings, HasSubstr(says));
    } catch (const DataError& error) {
      EXPECT_THAT(error.what(), HasSubstr(says));
    }
  }
}

// The importer takes the map that sniff writes for a file, or says why not.
TEST(KindsTest, EveryReferenceFileIsReadWithItsMapOrRefusedForAReason) {
  const char* folder = std::getenv("FDI_REFERENCE_DATA");
  if (folder == nullptr) {
    GTEST_SKIP() << "FDI_REFERENCE_DATA is not set";
  }
  const std::map<std::string, const char*> refused = {
      {"a17_etl_headerless.csv", "the first row holds values"},
      {"b04_level_loop.csv", "neither a position (X) nor a flow (F)"},
      {"p02_datalink_pairs.csv", "each value has a time of its own"},
      {"p03_23FIC101.OP.csv", "Try the folder that holds them"},
      {"p03_23FT101.PV.csv", "missing column CV_pct"},
      {"p03_23ZT101.PV.csv", "missing column CV_pct"},
      {"p05_report_by_exception.jsonl", "is JSON lines, not a table"},
      {"p06_minute_stamps.csv", "the seconds are missing"},
      {"p08_niagara_FT101_Flow.csv", "missing column CV_pct"},
      {"p08_niagara_FV101_Cmd.csv", "missing column CV_pct"},
      {"p08_niagara_FV101_Pos.csv", "missing column CV_pct"},
      {"p10_historian_odata.json", "is JSON of OData, not a table"},
      {"p10_lineprotocol.txt", "is line protocol, not a table"},
      // Loops, which are audited.
      {"p11_ahu_0311_cooling_stuck_closed_TIC1C.csv", "neither a position"},
      {"p11_ahu_20080819_healthy_TIC1C.csv", "neither a position"},
      {"p11_ahu_20090503_healthy_TIC1C.csv", "neither a position"},
      {"p12_temperature_slow_load_1.csv", "neither a position"}};
  std::size_t files = 0;
  for (const char* collection : {"/cases", "/cases-4"}) {
    for (const auto& entry : std::filesystem::directory_iterator(
             std::string(folder) + collection)) {
      const std::string name = entry.path().filename();
      if (name.ends_with(".md") || name.ends_with(".toml")) {
        continue;
      }
      SCOPED_TRACE(name);
      ++files;
      std::string said;
      try {
        const TextLines lines = TextLines::OfFile(entry.path());
        ColumnMap zone = Utc();
        zone.zone = name.starts_with("a12") ? "Europe/Berlin" : "UTC";
        const ColumnMap map =
            ReadTagMapText(MapText(Sniff(lines, zone), name), "map of " + name);
        const CsvTable table =
            ReadCsv(lines, {.map = map, .required = 0, .split_gaps = true});
        EXPECT_FALSE(table.runs.empty());
      } catch (const DataError& error) {
        said = error.what();
      }
      const auto reason = refused.find(name);
      if (reason == refused.end()) {
        EXPECT_EQ(said, "");
      } else {
        EXPECT_THAT(said, HasSubstr(reason->second));
      }
    }
  }
  EXPECT_GE(files, 50U);
}

// A file for each tag, of which the table has readings at different times.
TEST(KindsTest, AFolderOfFilesIsATableOfTheirTags) {
  const char* folder = std::getenv("FDI_REFERENCE_DATA");
  if (folder == nullptr) {
    GTEST_SKIP() << "FDI_REFERENCE_DATA is not set";
  }
  for (const char* kind : {"p03", "p08"}) {
    SCOPED_TRACE(kind);
    const std::filesystem::path path =
        std::filesystem::path(testing::TempDir()) / kind;
    std::filesystem::remove_all(path);
    std::filesystem::create_directory(path);
    for (const auto& entry : std::filesystem::directory_iterator(
             std::string(folder) + "/cases-4")) {
      if (entry.path().filename().string().starts_with(kind)) {
        std::filesystem::copy(entry.path(), path);
      }
    }
    const TextLines lines = TextLines::OfFile(path);
    const Sniffed found = Sniff(lines, Utc());
    SignalMask signals = 0;
    for (const SniffedColumn& column : found.columns) {
      signals = static_cast<SignalMask>(
          signals | (column.signal ? MaskOf(*column.signal) : 0));
    }
    EXPECT_EQ(signals,
              MaskOf(Signal::kCv) | MaskOf(Signal::kX) | MaskOf(Signal::kF));
    const CsvTable table =
        ReadCsv(lines, {.map = ReadTagMapText(MapText(found, kind), kind),
                        .required = 0,
                        .split_gaps = true});
    EXPECT_GT(table.runs.front().samples.size(), 300U);
    std::filesystem::remove_all(path);
  }
}

// Unless 0 of a command in % of closing is the open valve, and its flow is
// lost.
TEST(KindsTest, RowsThatAreZeroInAllColumnsAreNoReadings) {
  const auto table = [](const std::string& sense) {
    std::string text = "t_s,OP,ZT,FT\n";
    for (int k = 0; k < 120; ++k) {
      text += std::to_string(k) + (k / 10 == 3 ? ",0.0,0,0.00\n"
                                   : k == 50   ? ",0.0,0,3.1\n"
                                               : ",40.1,40.2,3.1\n");
    }
    std::string map = "[signal.F]\ncolumn = \"FT\"\nunit = \"t/h\"\n";
    for (const char* pair : {"CV]\ncolumn = \"OP\"", "X]\ncolumn = \"ZT\""}) {
      map += std::string("[signal.") + pair + "\nsense = \"" + sense + "\"\n";
    }
    return ReadCsv(text, {.map = ReadTagMapText(map, "map")});
  };
  const CsvTable opening = table("opening");
  const auto& samples = opening.runs.front().samples;
  for (std::size_t k = 0; k < samples.size(); ++k) {
    EXPECT_EQ(samples[k].sample.Has(Signal::kX), k / 10 != 3) << k;
  }
  EXPECT_THAT(opening.notes,
              Contains("10 of 120 rows are 0 in all columns between open ones, "
                       "taken as no reading"));
  EXPECT_TRUE(table("closing").runs.front().samples[30].sample.Has(Signal::kX));
}

// F is a type there, and no Fahrenheit.
TEST(KindsTest, ARowOfTypesSaysNothingOfUnits) {
  const Sniffed found = Sniff(
      "\"#NAMES\"\n\"t_stamp\",\"FV1/Out\",\"FV1/Pos\",\"FT1/PV\"\n"
      "\"#TYPES\"\n\"date\",\"D\",\"D\",\"F\"\n\"#ROWS\",\"120\"\n" +
          Rows([](std::size_t k) { return Iso(k) + "," + Plain(k); }),
      "plant.csv", Utc());
  EXPECT_EQ(found.columns.at(2).signal, Signal::kF);
  EXPECT_EQ(found.columns.at(2).unit, "m3/h");
}

TEST(KindsTest, WordsOfAModeColumnGoIntoTheMap) {
  const auto text = [](const char* by_hand) {
    return "time,FIC1.OP,ZT1.PV,FT1 [t/h],FIC1.MODE\n" +
           Rows([&](std::size_t k) {
             return Iso(k) + "," + Plain(k) + "," + (k < 60 ? "Auto" : by_hand);
           });
  };
  const ColumnMap map = MapOf(text("Man"), Utc());
  EXPECT_EQ(map.mode_column, "FIC1.MODE");
  const auto mode = [](const std::string& table, const ColumnMap& columns,
                       std::size_t k) {
    return ReadCsv(table, {.map = columns})
        .runs.at(0)
        .samples.at(k)
        .sample.mode;
  };
  EXPECT_EQ(mode(text("Man"), map, 59), ValveMode::kAuto);
  EXPECT_EQ(mode(text("Man"), map, 60), ValveMode::kManual);
  // Words of one plant: the map says what they mean.
  const std::string own = text("Hand");
  EXPECT_EQ(MapOf(own, Utc()).mode_column, "");
  EXPECT_THROW(mode(own, map, 60), DataError);
  const ColumnMap words =
      ReadTagMapText(MapText(Sniff(own, "own.csv", Utc()), "own.csv") +
                         "[mode]\ncolumn = \"FIC1.MODE\"\n"
                         "manual = [\"HAND\"]\n",
                     "own.toml");
  EXPECT_EQ(mode(own, words, 60), ValveMode::kManual);
}

TEST(KindsTest, MillisecondsMayHaveAColumnOfTheirOwn) {
  const std::string text =
      "Time,Milliseconds,FV1 OP,FV1 ZT,FT1 F\n" + Rows([](std::size_t k) {
        return Clock("%Y-%m-%d %H:%M:%S,", k / 2) +
               (k % 2 == 0 ? "0," : "500,") + Plain(k);
      });
  const CsvTable table = ReadCsv(text, {.map = MapOf(text, Utc())});
  ASSERT_EQ(table.runs.size(), 1U);
  EXPECT_EQ(table.runs[0].period_s, 0.5);
  EXPECT_EQ(table.runs[0].samples.size(), kRows);
}

TEST(KindsTest, QualitiesInBracesAreNoTags) {
  const std::string text =
      "Timestamp,Trend Flags,Status,FC1.OP,ZT1.PV,FT1 [t/h],State\n" +
      Rows([](std::size_t k) {
        return Iso(k) + ",{},{ok}," + Plain(k) + (k == 7 ? ",{down}" : ",{ok}");
      });
  ColumnMap map = MapOf(text, Utc());
  map.resampling.reset();
  const auto samples = ReadCsv(text, {.map = map}).runs.at(0).samples;
  EXPECT_TRUE(samples.at(6).sample.Has(Signal::kF));
  EXPECT_FALSE(samples.at(7).sample.Has(Signal::kF));
}

TEST(KindsTest, MinutesWithoutSecondsAndOtherFormsAreRefusedByName) {
  const auto said = [](const std::string& text) {
    try {
      ReadCsv(text, {.map = MapOf(text, Utc())});
    } catch (const DataError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_THAT(
      said(Wide("time,FC1.OP,ZT1.PV,FT1",
                [](std::size_t k) { return Clock("%Y-%m-%d %H:%M", k); })),
      HasSubstr("the seconds are missing"));
  EXPECT_THAT(said("{\"@odata.context\": \"x\", \"value\": []}\n"),
              HasSubstr("is JSON of OData, not a table; try: jq"));
  EXPECT_THAT(said("[{\"time\": 1, \"tag\": 2}]\n"),
              HasSubstr("is JSON, not a table; try: jq"));
  EXPECT_THAT(said("valve,tag=FV1 cv=45.1,x=45.0 1773129600000000000\n"),
              HasSubstr("is line protocol, not a table; try: awk"));
}

// Whatever changes is written, with empty cells beside it: values hold.
TEST(KindsTest, ATableByExceptionIsHeld) {
  std::string text = "time,FC1.OP [%],ZT1.PV [%],FT1 [t/h]\n";
  for (std::size_t k = 0; k < kRows; ++k) {
    const std::size_t at = k + k / 3;
    text += Iso(at) + "," + (k % 2 == 0 ? Fixed(kValve.cv[k]) : "") + "," +
            (k % 5 < 2 ? Fixed(kValve.x[k]) : "") + "," +
            (k % 3 == 0 ? Fixed(kValve.f[k]) : "") + "\n";
  }
  const Sniffed found = Sniff(text, "plant.csv", Utc());
  EXPECT_TRUE(found.compressed);
  EXPECT_EQ(found.resample, "1s:hold:10min");
  EXPECT_THAT(MapText(found, "plant.csv"),
              HasSubstr("resample = \"1s:hold:10min\"  # choice: linear is "));
}

// A position that is polled every fifth second stands in the rows between.
TEST(KindsTest, APolledPositionIsNewAtItsPollsAlone) {
  std::string text = "time,FC1.OP [%],ZT1.PV [%],FT1 [t/h]\n";
  for (std::size_t k = 0; k < kRows; ++k) {
    text += Iso(k) + "," + Fixed(kValve.cv[k]) + "," +
            Fixed(kValve.x[k - k % 5]) + "," + Fixed(kValve.f[k]) + "\n";
  }
  ColumnMap map = Utc();
  map.columns = {{"FC1.OP [%]", Signal::kCv, 1.0, 0.0, Sense::kOpening, "%"},
                 {"ZT1.PV [%]", Signal::kX, 1.0, 0.0, Sense::kOpening, "%"}};
  const CsvTable table = ReadCsv(text, {.source = {"plant.csv"}, .map = map});
  EXPECT_THAT(table.notes,
              Contains(HasSubstr("X is new every 5 s and held between")));
  ASSERT_EQ(table.runs.size(), 1U);
  for (std::size_t k = 0; k < kRows; ++k) {
    const Sample& sample = table.runs[0].samples[k].sample;
    EXPECT_EQ(sample.uncertain(), k % 5 == 0 ? 0 : MaskOf(Signal::kX)) << k;
  }
}

// Three tags at a sample a second, a third of a second apart.
TEST(KindsTest, StampsOfSeveralTagsMakeNoPeriod) {
  const std::string text =
      "Tag,Time,Value\n" +
      Tall(
          [](std::size_t k, const std::string& tag, double value) {
            const char* part = tag == "17FC.OP"   ? ".0"
                               : tag == "17ZT.PV" ? ".365"
                                                  : ".731";
            return tag + "," + Clock("%Y-%m-%dT%H:%M:%S", k) + part + "Z," +
                   Fixed(value);
          },
          false);
  const Sniffed found = Sniff(text, "plant.csv", Utc());
  EXPECT_EQ(found.period_s, 1.0);
  EXPECT_EQ(found.resample, "1s:linear");
  EXPECT_NO_THROW(ReadCsv(text, {.map = MapOf(text, Utc())}));
}

TEST(TagMapTest, TheFlowOfAPressureDifferenceGoesWithItsRoot) {
  const ColumnMap map = ReadTagMapText(
      "[signal.CV]\ncolumn = \"OP\"\n[signal.F]\ncolumn = \"DP\"\n"
      "unit = \"m3/h\"\nraw = [4, 20]\nspan = [0, 40]\nroot = true\n",
      "map");
  const CsvTable table = ReadCsv("t_s,OP,DP\n0,50,8\n1,50,20\n", {.map = map});
  EXPECT_EQ(table.runs.at(0).samples[0].sample[Signal::kF], 20.0);
  EXPECT_EQ(table.runs.at(0).samples[1].sample[Signal::kF], 40.0);
  EXPECT_THROW(FlowMap("unit = \"m3/h\"\nroot = true\n"), ConfigError);
}

// The columns of a loop, by the same evidence as those of a valve.
TEST(LoopGuessTest, FindsOpPvSpXAndMode) {
  struct Case {
    const char* names;
    std::vector<std::string> found;  // OP, PV, SP, X, mode; "-": refused.
  };
  const std::vector<Case> cases = {
      {"FIC7.OP,FIC7.PV,FIC7.SP,FIC7.MODE",
       {"FIC7.OP", "FIC7.PV", "FIC7.SP", "", "FIC7.MODE"}},
      {"CV_pct,P1_kPa,P2_kPa,T1_degC,X_pct,F_t_h",
       {"CV_pct", "F_t_h", "", "X_pct", ""}},
      {"FV101.OP,FV101.PV,FV101.SP",
       {"FV101.OP", "FV101.PV", "FV101.SP", "", ""}},
      {"23FIC101.OP (%),23ZT101.PV (%),23FT101.PV (m3/h),23PT101.PV (bar a)",
       {"23FIC101.OP (%)", "23FT101.PV (m3/h)", "", "23ZT101.PV (%)", ""}},
      {"LIC7.OP [%],LT7 [%]", {"LIC7.OP [%]", "LT7 [%]", "", "", ""}},
      {"P17.FT.F_CV,P17.FV_OP.F_CV,P17.FV_ZT.F_CV",
       {"P17.FV_OP.F_CV", "P17.FT.F_CV", "", "P17.FV_ZT.F_CV", ""}},
      {"FIC1.OP,FIC1.PV,FIC2.OP,FIC2.PV", {"-"}},
      {"OP,remark", {"-"}}};
  for (const Case& c : cases) {
    SCOPED_TRACE(c.names);
    const std::string text =
        "time," + std::string(c.names) + "\n" + Rows([&](std::size_t k) {
          std::string row = Iso(k);
          const std::string names = c.names;
          for (std::size_t i = 0, begin = 0; begin <= names.size(); ++i) {
            const std::size_t end =
                std::min(names.find(',', begin), names.size());
            row +=
                "," +
                (names.substr(begin, end - begin).ends_with("MODE")
                     ? "AUTO"
                     : Fixed(40.0 + kValve.cv[k] / static_cast<double>(i + 1)));
            begin = end + 1;
          }
          return row;
        });
    ColumnMap map;
    std::vector<std::string> found;
    try {
      GuessLoop(ScanColumns(TextLines(text), {}).columns, {}, "loop.csv", map);
      for (const Signal signal :
           {Signal::kCv, Signal::kF, Signal::kSp, Signal::kX}) {
        const auto column =
            std::ranges::find(map.columns, signal, &ColumnMapping::signal);
        found.push_back(column == map.columns.end() ? "" : column->column);
      }
      found.push_back(map.mode_column);
    } catch (const DataError&) {
      found = {"-"};
    }
    EXPECT_EQ(found, c.found);
  }
}

TEST(LoopGuessTest, AnOutputBetweenZeroAndOneIsAShare) {
  const auto scale = [](double of_cells) {
    ColumnMap map;
    const std::string text =
        "time,TIC1.OP,TIC1.PV\n" + Rows([&](std::size_t k) {
          return Iso(k) + "," + Fixed(of_cells * kValve.cv[k], 4) + ",60";
        });
    GuessLoop(ScanColumns(TextLines(text), {}).columns, {}, "loop.csv", map);
    return map.columns.at(0).scale;
  };
  EXPECT_EQ(scale(0.01), 100.0);
  EXPECT_EQ(scale(1.0), 1.0);
}

TEST(KindsTest, AFileWithoutNamesIsRefusedInOneLine) {
  try {
    Sniff(Rows([](std::size_t k) {
            return Iso(k) + ",P17.FV_OP," + Fixed(kValve.cv[k]);
          }),
          "plant.csv", {});
    FAIL() << "not refused";
  } catch (const DataError& error) {
    EXPECT_THAT(error.what(), HasSubstr("plant.csv:1: the first row holds "
                                        "values, not names"));
  }
}

TEST(KindsTest, AGzipThatUnpacksToTooMuchIsRefused) {
  const storage::TemporaryDirectory directory;
  const auto path = directory.path() / "bomb.csv.gz";
  gzFile file = gzopen(path.c_str(), "wb9");
  const std::string rows(1U << 20U, '\n');
  for (int i = 0; i < 64; ++i) {
    gzwrite(file, rows.data(), static_cast<unsigned>(rows.size()));
  }
  gzclose(file);
  try {
    ReadTextFile(path);
    FAIL() << "not refused";
  } catch (const DataError& error) {
    EXPECT_THAT(error.what(), HasSubstr("unpacks to more than 100 times"));
  }
}

// A program that needs more memory for a row takes fewer from a gzip.
TEST(KindsTest, AGzipHasAtMostTheRowsThatAProgramTakes) {
  const storage::TemporaryDirectory directory;
  const std::string text = "t_s,CV_pct,X_pct\n0,1,2\n1,2,3\n2,3,4\n";
  const auto packed = directory.path() / "packed.csv.gz";
  gzFile file = gzopen(packed.c_str(), "wb9");
  gzwrite(file, text.data(), static_cast<unsigned>(text.size()));
  gzclose(file);
  CsvOptions options{.required = MaskOf(Signal::kCv), .max_packed_rows = 3};
  EXPECT_EQ(ReadCsvFile(packed, options).runs[0].samples.size(), 3U);
  options.max_packed_rows = 2;
  try {
    ReadCsvFile(packed, options);
    FAIL() << "not refused";
  } catch (const DataError& error) {
    EXPECT_THAT(error.what(), HasSubstr("has more than 2 rows, which a gzip"));
  }
  EXPECT_EQ(ReadCsv(text, options).runs[0].samples.size(), 3U);
}

// Whoever takes the samples one by one does not have them twice.
TEST(KindsTest, SamplesThatAreTakenAreInNoRun) {
  std::vector<double> taken;
  const CsvTable table =
      ReadCsv("t_s,CV_pct,X_pct\n0,1,2\n1,2,3\n5,3,4\n6,3,5\n",
              {.required = MaskOf(Signal::kCv),
               .split_gaps = true,
               .take = [&taken](const LabelledSample& labelled) {
                 taken.push_back(labelled.sample[Signal::kX]);
               }});
  EXPECT_EQ(taken, (std::vector<double>{2, 3, 4, 5}));
  ASSERT_EQ(table.runs.size(), 2U);
  EXPECT_TRUE(table.runs[0].samples.empty());
  EXPECT_TRUE(table.runs[1].samples.empty());
}

}  // namespace
}  // namespace fdi::importer
