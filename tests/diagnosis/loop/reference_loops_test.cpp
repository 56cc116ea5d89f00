// Recorded loops with labels, from the folder FDI_REFERENCE_DATA.
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <map>
#include <set>
#include <sstream>
#include <string>
#include <utility>

#include <gtest/gtest.h>

#include "diagnosis/loop/audit.h"
#include "import/csv.h"

namespace fdi::loop {
namespace {

Window ReadWindow(const std::string& path) {
  importer::CsvOptions options;
  options.map.flow_unit = FlowUnit::kM3PerHour;
  options.map.columns = {
      {"OP_pct", Signal::kCv}, {"PV", Signal::kF}, {"SP", Signal::kSp}};
  options.check_values = false;
  options.skip_repeats = true;
  options.split_gaps = true;
  options.map.resampling = importer::Resampling{10.0, false, 30.0};
  if (path.find("LIC63001") != std::string::npos) {
    options.map.resampling->period_s = 60.0;
    options.map.resampling->limit_s = 180.0;
  }
  const importer::CsvTable table = importer::ReadCsvFile(path, options);
  Window window;
  window.period_s = table.runs.at(0).period_s;
  for (const LabelledSample& s : table.runs.at(0).samples) {
    window.op.push_back(s.sample[Signal::kCv]);
    window.pv.push_back(s.sample[Signal::kF]);
    window.sp.push_back(s.sample[Signal::kSp]);
  }
  window.integrating = path.find("LIC") != std::string::npos;
  return window;
}

TEST(ReferenceLoopsTest, FindsStickyWindowsAndLoopsWithoutFalseOnes) {
  const char* folder = std::getenv("FDI_REFERENCE_DATA");
  if (folder == nullptr) {
    GTEST_SKIP() << "FDI_REFERENCE_DATA is not set";
  }
  const std::string loops = std::string(folder) + "/loops/";
  std::ifstream labels(loops + "labels.csv");
  std::string line;
  std::getline(labels, line);
  int found = 0;
  int sure = 0;
  int sticky = 0;
  int wrong = 0;
  int exchanged = 0;
  std::map<std::string, std::pair<int, int>> by_loop;  // Found, windows.
  std::set<std::string> wrong_loops;
  while (std::getline(labels, line)) {
    std::istringstream cells(line);
    std::string file;
    std::string label;
    std::string tag;
    std::getline(cells, file, ',');
    std::getline(cells, label, ',');
    std::getline(cells, tag, ',');
    Window window = ReadWindow(loops + file);
    const Audit audit = AuditWindow(window);
    EXPECT_FALSE(audit.evidence.exchanged) << file;
    std::swap(window.op, window.pv);
    exchanged += AuditWindow(window).evidence.exchanged ? 1 : 0;
    const bool is = audit.verdict == Verdict::kStiction ||
                    audit.verdict == Verdict::kNoResponse;
    if (label == "1") {
      ++sticky;
      found += is ? 1 : 0;
      sure += is && audit.sure ? 1 : 0;
      by_loop[tag].first += is ? 1 : 0;
      ++by_loop[tag].second;
    } else if (is) {
      ++wrong;
      wrong_loops.insert(tag);
    }
  }
  for (const auto& [tag, counts] : by_loop) {
    std::cout << tag << ": " << counts.first << " of " << counts.second
              << " windows\n";
    EXPECT_GT(2 * counts.first, counts.second - 1) << tag;
  }
  std::cout << found << " of " << sticky << " sticky windows (" << sure
            << " sure), " << wrong << " others; " << exchanged
            << " of 43 seen when exchanged\n";
  EXPECT_EQ(sticky, 27);
  EXPECT_GE(found, 24);
  EXPECT_GE(sure, 24);
  EXPECT_EQ(wrong, 0);
  EXPECT_GE(exchanged, 35);
}

}  // namespace
}  // namespace fdi::loop
