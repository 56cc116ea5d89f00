#include <string>

#include <CLI/CLI.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "storage/cli/manual.h"
#include "storage/cli/program.h"
#include "tests/storage/temporary_directory.h"

namespace fdi::cli {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

class ManualTest : public testing::Test {
 protected:
  ManualTest() : program_("prog", "A program") {
    CLI::App& doors = program_.AddGroup("doors", "What opens");
    CLI::App& open = program_.AddVerb(doors, "open", "Open a door",
                                      [](const Context&) { return kExitOk; });
    open.add_option("door", door_, "Which one")->required();
    open.add_option("--speed", speed_, "How fast")
        ->check(CLI::Range(1, 9))
        ->type_name("N");
    open.add_option("--way", way_, "Where to")
        ->check(CLI::IsMember({"in", "out"}));
    open.add_option("--secret", way_, "Not for everybody")->group("");
    open.footer("Examples:\n  prog doors open front -- .x 'y\\z'");
    open_ = &open;
  }

  std::string Complete() {
    const char* line[] = {"prog", "--completion"};
    testing::internal::CaptureStdout();
    EXPECT_EQ(program_.Run(2, line), kExitOk);
    return testing::internal::GetCapturedStdout();
  }

  Program program_;
  CLI::App* open_{nullptr};
  std::string door_;
  std::string way_;
  int speed_{3};
};

TEST_F(ManualTest, PageOfAVerbIsNamedByItsPath) {
  EXPECT_EQ(ManualPageName(*open_), "prog-doors-open");
  EXPECT_THAT(ManualPage(*open_),
              AllOf(HasSubstr(".TH PROG-DOORS-OPEN 1"),
                    HasSubstr("prog\\-doors\\-open \\- Open a door"),
                    HasSubstr("\\fBprog doors open\\fR [\\fIOPTIONS\\fR] "
                              "\\fIdoor\\fR")));
}

TEST_F(ManualTest, OptionsHaveRangeAndDefault) {
  EXPECT_THAT(ManualPage(*open_),
              AllOf(HasSubstr("\\fB\\-\\-speed\\fR \\fIN\\fR\n"
                              "How fast. Accepted: 1..9. Default: 3."),
                    HasSubstr("Accepted: in,out.")));
}

TEST_F(ManualTest, HiddenOptionsStayHidden) {
  EXPECT_THAT(ManualPage(*open_), Not(HasSubstr("secret")));
  EXPECT_THAT(ManualPage(program_.root()), Not(HasSubstr("man\\-pages")));
  EXPECT_THAT(program_.root().help(), Not(HasSubstr("completion")));
}

TEST_F(ManualTest, FooterBecomesExamplesThatRoffLeavesAlone) {
  EXPECT_THAT(ManualPage(*open_),
              HasSubstr(".SH EXAMPLES\n.nf\n"
                        "  prog doors open front \\-\\- .x 'y\\ez'\n.fi\n"));
}

TEST_F(ManualTest, EachLevelHasAFile) {
  const storage::TemporaryDirectory folder;
  const std::string path = folder.path().string();
  const char* line[] = {"prog", "--man-pages", path.c_str()};

  ASSERT_EQ(program_.Run(3, line), kExitOk);

  for (const char* page : {"prog.1", "prog-doors.1", "prog-doors-open.1"}) {
    EXPECT_TRUE(std::filesystem::exists(folder.path() / page)) << page;
  }
}

TEST_F(ManualTest, FolderThatCannotBeMadeIsADataError) {
  const char* line[] = {"prog", "--man-pages", "/nowhere/man"};

  testing::internal::CaptureStderr();
  EXPECT_EQ(program_.Run(3, line), kExitData);
  EXPECT_THAT(testing::internal::GetCapturedStderr(), HasSubstr("/nowhere"));
}

TEST_F(ManualTest, CompletionKnowsVerbsOptionsAndWords) {
  EXPECT_THAT(
      Complete(),
      AllOf(HasSubstr("_fdi_verbs['prog doors']='open'\n"),
            HasSubstr("_fdi_options['prog doors open']='--help --speed --way'"),
            HasSubstr("_fdi_values['prog doors open --way']='words in out'"),
            HasSubstr("complete -F _fdi_complete prog")));
}

}  // namespace
}  // namespace fdi::cli
