// Runs the built programs: all indices, groups, the page.
#include <filesystem>
#include <fstream>
#include <stdexcept>

#include <gmock/gmock.h>
#include <unistd.h>

#include "import/csv.h"
#include "report/fault_texts.h"
#include "storage/models/models.h"
#include "storage/runs/runs.h"
#include "tests/programs/trainer/trained_runs.h"
#include "tests/study/fixture.h"

namespace fdi::trainer::study {
namespace {

using nlohmann::json;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

constexpr std::size_t kBytesPerRun = 100'000;

class StudyReportTest : public WithStudy<TrainedRuns> {
 protected:
  // The model set again, with an f1 that looks like f19.
  void AddTwin() const {
    storage::ModelStore store(Path("data") / "models.db",
                              storage::Access::kOccasionalWriter);
    ModelSet models = store.Load("quick");
    Observer twin = models.observers[1];
    twin.fault = 1;
    twin.name = "f1 0.50";
    models.observers.insert(models.observers.begin() + 1, twin);
    models.faults.insert(models.faults.begin(), 1);
    models.groups = {{1, 19}};
    store.Save(models, storage::Activation::kAlways);
  }
  static std::size_t Count(const std::string& text, const std::string& part) {
    std::size_t count = 0;
    for (std::size_t at = text.find(part); at != std::string::npos;
         at = text.find(part, at + 1)) {
      ++count;
    }
    return count;
  }
};

TEST_F(StudyReportTest, GroupsOfTheSetAreJudgedBesideFaults) {
  WriteFile("f.csv", FaultySamples());
  const std::string call = "evaluate --model-set quick --file f.csv";
  EXPECT_EQ(StudyJson(call)["summary"]["confusion_by_group"],
            StudyJson(call)["summary"]["confusion"]);
  AddTwin();

  const json summary = StudyJson(call)["summary"];

  EXPECT_EQ(summary["exact"], 0);
  EXPECT_EQ(summary["contained"], 1);
  EXPECT_EQ(summary["exact_group"], 1);
  EXPECT_EQ(summary["contained_group"], 1);
  EXPECT_EQ(summary["mean_d_acc"], 0.5);
  EXPECT_EQ(summary["mean_d_acc_group"], 1.0);
  EXPECT_EQ(summary["confusion"]["f19"]["f1"], 0.5);
  EXPECT_EQ(summary["confusion_by_group"]["f1|f19"]["f1|f19"], 1.0);
  EXPECT_THAT(Study(call).out, HasSubstr("truth \\ outcome by group  f1|f19"));
}

TEST_F(StudyReportTest, ReportStandsAloneAndShowsEveryRun) {
  WriteFile("a&b.csv", FaultySamples());
  const Outcome outcome =
      Study("evaluate --model-set quick --file 'a&b.csv' --runs " + RunOf(900) +
            " --report out");

  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const std::string page = Read("out/index.html");
  EXPECT_THAT(page, AllOf(HasSubstr("a&amp;b.csv"), Not(HasSubstr("a&b.csv"))));
  EXPECT_THAT(page, HasSubstr("<th>faults detected</th><td>1 of 1"));
  // Faults by the names that operators see.
  const std::string name = report::FaultTexts(FDI_FAULT_TEXTS).Of(19).name;
  EXPECT_THAT(
      page,
      AllOf(HasSubstr("Confusion by fault"), HasSubstr("Confusion by group"),
            HasSubstr("f19 " + name + ", strength 0.50"),
            HasSubstr("final set f19 " + name), HasSubstr("d_f19 (the fault)"),
            HasSubstr("T = 0.7"), HasSubstr("prefers-color-scheme:dark")));
  // Every index is explained, and measured signals are drawn.
  for (const char* index : {"t_dt [s]", "r_fd", "d_acc", "final set"}) {
    EXPECT_THAT(page, HasSubstr("<dt>" + std::string(index) + "</dt><dd>"))
        << index;
  }
  EXPECT_THAT(page, AllOf(HasSubstr("CV, X [%]"), HasSubstr("F measured")));
  EXPECT_THAT(page, AllOf(Not(HasSubstr("<script")), Not(HasSubstr("src=")),
                          Not(HasSubstr("@import")), Not(HasSubstr("url("))));
  // Nothing but links within the page and the name of the SVG namespace.
  EXPECT_EQ(Count(page, "href="), Count(page, "href=\"#run-"));
  EXPECT_EQ(Count(page, "http"), Count(page, "http://www.w3.org/2000/svg"));
  EXPECT_EQ(Count(page, "Traces of run"), 2U);
  EXPECT_EQ(Count(page, "<svg"), Count(page, "</svg>"));
  EXPECT_EQ(Count(page, "<table"), Count(page, "</table>"));
}

// All traces end at 899 of 900 s, whose x is 889.12. Those of a run whose first
// samples are rejected ended earlier, beside the mark of the fault.
TEST_F(StudyReportTest, TracesBeginWhereTheRunDoes) {
  std::vector<LabelledSample> samples = FaultySamples();
  WriteFile("a.csv", samples);
  for (std::size_t k = 0; k < 200; ++k) {
    samples[k].sample.Set(Signal::kX, 5000.0);
  }
  WriteFile("b.csv", samples);
  const auto ends = [&](const std::string& name) {
    EXPECT_EQ(Study("evaluate --model-set quick --file " + name +
                    ".csv --report " + name)
                  .code,
              0);
    return Count(Read(name + "/index.html"), "889.12,");
  };
  EXPECT_GE(ends("a"), 4U);
  EXPECT_GE(ends("b"), 4U);
}

TEST_F(StudyReportTest, DayLongRunStaysWithinItsBytes) {
  WriteFile("long.csv", FaultySamples(96));  // 86400 samples
  ASSERT_EQ(
      Study("evaluate --model-set quick --file long.csv --report long").code,
      0);
  WriteFile("f.csv", FaultySamples());
  ASSERT_EQ(
      Study("evaluate --model-set quick --file f.csv --report short").code, 0);
  EXPECT_LT(Read("long/index.html").size(), kBytesPerRun);
  EXPECT_GT(Read("short/index.html").size(), 10'000U);
}

TEST_F(StudyReportTest, FolderThatCannotBeMadeIsNamed) {
  WriteFile("f.csv", FaultySamples());
  const std::string call = "evaluate --model-set quick --file f.csv --report ";
  const Outcome missing = Study(call + "no/such");
  EXPECT_EQ(missing.code, 3);
  EXPECT_THAT(missing.err, HasSubstr("no/such"));
  EXPECT_EQ(missing.out, "");
  const Outcome file = Study(call + "f.csv");
  EXPECT_EQ(file.code, 3);
  EXPECT_THAT(file.err, HasSubstr("f.csv"));
  if (geteuid() != 0) {  // Root may write anywhere.
    std::filesystem::create_directory(Path("closed"));
    std::filesystem::permissions(Path("closed"),
                                 std::filesystem::perms::owner_read);
    EXPECT_EQ(Study(call + "closed").code, 3);
    EXPECT_EQ(Study(call + "closed/inner").code, 3);
  }
}

}  // namespace
}  // namespace fdi::trainer::study
