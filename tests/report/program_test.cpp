#include "report/program.h"

#include <csignal>
#include <cstdlib>
#include <fstream>
#include <stdexcept>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "base/error.h"
#include "base/time_text.h"
#include "report/help.h"
#include "report/stop_signals.h"
#include "tests/storage/temporary_directory.h"

namespace fdi::report {
namespace {

using testing::AllOf;
using testing::EndsWith;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::StartsWith;

struct BusError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

struct Outcome {
  int code{0};
  std::string out;
  std::string err;
  GlobalOptions options;
  std::string who;
  std::string mood{"none"};
  double gain{0.0};
  double size{1.0};
  std::string place;
  std::string file;
  int times{1};
  std::vector<std::string> friends;
  double patience{2.5};
  bool echo{true};
};

// A program with `greet` and `store open`; `greet` runs `action`.
Outcome RunProgram(std::vector<const char*> arguments,
                   const std::function<void()>& action = {}) {
  Outcome outcome;
  arguments.insert(arguments.begin(), "prog");
  Program program("prog", "A program");
  outcome.who = "world";
  outcome.gain = 1.5;
  program.AddBusOptions();
  CLI::App& greet =
      program.AddVerb("greet", "Greets", [&](const Context& context) {
        outcome.options = context.options;
        if (action) {
          action();
        }
        return 0;
      });
  greet.add_option("--who", outcome.who, "Whom");
  greet.add_option("--gain", outcome.gain, "Gain");
  greet.add_option("--size", outcome.size, "Size")
      ->check(CLI::Range(0.5, 2.0))
      ->type_name("M");
  greet.add_option("--mood", outcome.mood, "Mood")
      ->expected(0, 1)
      ->default_str("good")
      ->type_name("[=MOOD]");
  greet.add_option("--at", outcome.place, "Where")
      ->type_name("FLOOR:ROOM")
      ->check(CLI::IsMember({"1:a", "2:b"}));
  greet.add_option("--times", outcome.times, "How often")
      ->check(CLI::Range(1, 9))
      ->excludes("--who");
  greet
      .add_option("--file", outcome.file,
                  "What to read aloud to everybody "
                  "who is there at that time")
      ->check(CLI::ExistingFile)
      ->type_name("FILE.txt");
  greet.add_option("--friend", outcome.friends, "Whom else");
  greet.add_option("--patience", outcome.patience, "How long")->needs("--file");
  greet.add_flag("!--no-echo", outcome.echo, "Do not wait for an echo");
  greet.add_option_function<std::string>(
      "--within", [](const std::string& text) { ParseDuration(text); },
      "How soon");
  CLI::App& store = program.AddGroup("store", "Doors");
  program.AddVerb(store, "open", "Opens", [](const Context&) { return 1; });
  program.MapError<BusError>(kExitTransport);
  program.AddLeftOut("", "paint", "FDI_PAINT");
  program.AddLeftOut("greet", "--card", "FDI_PAINT");
  program.AddExamples({{"paint wall", {{"A wall", "prog paint wall"}}}});
  testing::internal::CaptureStdout();
  testing::internal::CaptureStderr();
  outcome.code =
      program.Run(static_cast<int>(arguments.size()), arguments.data());
  outcome.out = testing::internal::GetCapturedStdout();
  outcome.err = testing::internal::GetCapturedStderr();
  return outcome;
}

// Prints a result into a pipe that is full, after a SIGTERM.
[[noreturn]] void PrintUnread() {
  int pipe_ends[2];
  if (pipe(pipe_ends) != 0) {
    _exit(8);
  }
  dup2(pipe_ends[1], STDOUT_FILENO);
  Program program("prog", "A program");
  program.AddVerb("list", "Lists", [](const Context&) {
    {
      const StopSignals signals;
      std::raise(SIGTERM);
    }
    Report report;
    report.document = {{"text", std::string(1 << 20, 'x')}};
    return report;
  });
  const char* const arguments[] = {"prog", "list", "--json"};
  program.Run(3, arguments);
  _exit(7);
}

TEST(ProgramDeathTest, AResultThatNobodyReadsIsGivenUpAfterAStop) {
  EXPECT_EXIT(PrintUnread(), testing::ExitedWithCode(kExitFailure), "");
}

TEST(ProgramTest, GlobalOptionsAreAcceptedBeforeAndAfterTheVerb) {
  const Outcome before = RunProgram({"--domain", "7", "greet"});
  const Outcome after = RunProgram({"greet", "--domain", "7", "--json"});

  EXPECT_EQ(before.code, kExitOk);
  EXPECT_EQ(before.options.domain, 7);
  EXPECT_FALSE(before.options.json);
  EXPECT_EQ(after.code, kExitOk);
  EXPECT_EQ(after.options.domain, 7);
  EXPECT_TRUE(after.options.json);
}

TEST(ProgramTest, NumbersAreNumbers) {
  for (const char* option : {"--gain", "--size"}) {
    const Outcome outcome = RunProgram({"greet", option, "nan"});

    EXPECT_EQ(outcome.code, kExitUsage);
    EXPECT_THAT(outcome.err,
                HasSubstr(std::string(option) + ": nan is no number"));
  }
  EXPECT_EQ(RunProgram({"greet", "--size", "0.75"}).size, 0.75);
  EXPECT_EQ(RunProgram({"greet", "--who", "nan"}).who, "nan");
}

TEST(ProgramTest, WhatIsLeftOutNamesTheOptionThatBringsItBack) {
  for (const std::vector<const char*>& arguments :
       {std::vector<const char*>{"paint", "wall"}, {"greet", "--card=red"}}) {
    const Outcome outcome = RunProgram(arguments);

    EXPECT_EQ(outcome.code, kExitUsage);
    EXPECT_THAT(outcome.err,
                HasSubstr(" is not in this build: it takes one that was made "
                          "with -DFDI_PAINT=ON"));
  }
}

TEST(ProgramTest, ErrorOfAValueSaysWhatIsAccepted) {
  EXPECT_THAT(RunProgram({"greet", "--size", "1e9"}).err,
              HasSubstr("--size: '1e9' is not accepted; expected 0.5..2"));
  EXPECT_THAT(RunProgram({"greet", "--at", "3:c"}).err,
              HasSubstr("--at: '3:c' is not accepted; expected 1:a|2:b"));
}

TEST(ProgramTest, ValueOfAFlagStandsBehindABlankOrAnEqualsSign) {
  EXPECT_EQ(RunProgram({"greet"}).mood, "none");
  EXPECT_EQ(RunProgram({"greet", "--mood"}).mood, "good");
  EXPECT_EQ(RunProgram({"greet", "--mood=bad"}).mood, "bad");
  EXPECT_EQ(RunProgram({"greet", "--mood", "bad"}).mood, "bad");
  const Outcome both = RunProgram({"greet", "--mood", "--who", "all"});
  EXPECT_EQ(both.mood, "good");
  EXPECT_EQ(both.who, "all");
}

TEST(ProgramTest, LaterOfTwoGlobalOptionsCounts) {
  const Outcome outcome =
      RunProgram({"--domain", "7", "greet", "--domain", "8"});

  EXPECT_EQ(outcome.code, kExitOk) << outcome.err;
  EXPECT_EQ(outcome.options.domain, 8);
}

TEST(ProgramTest, LoopbackAndLocalDataAreTheDefaults) {
  unsetenv("FDI_DATA");
  const Outcome outcome = RunProgram({"greet"});

  EXPECT_EQ(outcome.options.interface, "127.0.0.1");
  EXPECT_EQ(outcome.options.data_dir, "./fdi-data");
  EXPECT_EQ(outcome.options.transport, "udp");
  EXPECT_EQ(outcome.options.domain, 0);
}

TEST(ProgramTest, EnvironmentNamesTheDataDirectoryUnlessAnOptionDoes) {
  setenv("FDI_DATA", "/tmp/from-environment", 1);
  const Outcome environment = RunProgram({"greet"});
  const Outcome option = RunProgram({"greet", "--data", "/tmp/from-option"});
  unsetenv("FDI_DATA");

  EXPECT_EQ(environment.options.data_dir, "/tmp/from-environment");
  EXPECT_EQ(option.options.data_dir, "/tmp/from-option");
}

TEST(ProgramTest, ExceptionsBecomeTheExitCodesOfTheContract) {
  const auto code = [](const std::function<void()>& action) {
    return RunProgram({"greet"}, action).code;
  };

  EXPECT_EQ(code([] { throw std::runtime_error("x"); }), 1);
  EXPECT_EQ(code([] { throw ConfigError("x"); }), 2);
  EXPECT_EQ(code([] { throw std::invalid_argument("x"); }), 2);
  EXPECT_EQ(code([] { throw DataError("x"); }), 3);
  EXPECT_EQ(code([] { throw BusError("x"); }), 4);
  EXPECT_EQ(code([] { throw NotFoundError("x"); }), 5);
  EXPECT_EQ(code([] { throw 42; }), 1);
  EXPECT_EQ(RunProgram({"store", "open"}).code, 1);
}

TEST(ProgramTest, ErrorIsOneLineOnStderr) {
  const Outcome outcome =
      RunProgram({"greet"}, [] { throw DataError("first\nsecond"); });

  EXPECT_EQ(outcome.err, "prog: error: first;second\n");
  EXPECT_THAT(outcome.out, IsEmpty());
}

TEST(ProgramTest, MistypedVerbIsRefusedWithTheOneMeant) {
  EXPECT_THAT(RunProgram({"gret"}).err, HasSubstr("did you mean 'greet'?"));
  EXPECT_THAT(RunProgram({"store", "opne"}).err,
              HasSubstr("did you mean 'open'?"));
  EXPECT_THAT(RunProgram({"xyzzy"}).err,
              HasSubstr("unknown verb 'xyzzy'; there are greet, store"));
  EXPECT_EQ(RunProgram({"gret"}).code, kExitUsage);
}

// The help of something else would hide it.
TEST(ProgramTest, AnUnknownVerbBeforeHelpIsRefused) {
  for (const std::vector<const char*>& words :
       std::vector<std::vector<const char*>>{
           {"xyzzy", "--help"}, {"--help", "xyzzy"}, {"store", "x", "-h"}}) {
    const Outcome outcome = RunProgram(words);
    EXPECT_EQ(outcome.code, kExitUsage) << words.front();
    EXPECT_THAT(outcome.err, HasSubstr("unknown verb 'x"));
    EXPECT_THAT(outcome.out, IsEmpty());
  }
  EXPECT_EQ(RunProgram({"store", "open", "--help"}).code, kExitOk);
  EXPECT_EQ(RunProgram({"store", "--help"}).code, kExitOk);
}

TEST(ProgramTest, MissingVerbIsAUsageErrorThatListsTheVerbs) {
  EXPECT_EQ(RunProgram({}).code, kExitUsage);
  EXPECT_THAT(RunProgram({}).err, HasSubstr("a verb is needed: greet, store"));
  EXPECT_THAT(RunProgram({"store"}).err, HasSubstr("a verb is needed: open"));
}

TEST(ProgramTest, UnknownOptionIsAUsageError) {
  const Outcome outcome = RunProgram({"greet", "--hwo", "x"});

  EXPECT_EQ(outcome.code, kExitUsage);
  EXPECT_THAT(outcome.err,
              AllOf(HasSubstr("'--hwo'"), HasSubstr("did you mean '--who'?")));
}

TEST(ProgramTest, OptionValueOutOfRangeIsAUsageError) {
  EXPECT_EQ(RunProgram({"greet", "--domain", "233"}).code, kExitUsage);
  EXPECT_EQ(RunProgram({"greet", "--domain", "seven"}).code, kExitUsage);
  EXPECT_EQ(RunProgram({"greet", "--transport", "pigeon"}).code, kExitUsage);
}

TEST(ProgramTest, HelpReadsLikeAManualPage) {
  const std::string help = RunProgram({"greet", "--help"}).out;

  // A colon in the name of a value does not cut it.
  EXPECT_THAT(help,
              HasSubstr("  --at FLOOR:ROOM             Where (1:a|2:b)\n"));
  EXPECT_THAT(help, HasSubstr("  --mood[=MOOD]               Mood (without a "
                              "value: good)\n"));
  EXPECT_THAT(help,
              HasSubstr("  --times 1..9                How often (default "
                        "1; not with --who)\n"));
  EXPECT_THAT(help,
              HasSubstr("  --file FILE.txt             What to read aloud "
                        "to everybody who is there at\n"
                        "                              that time\n"));
  EXPECT_THAT(
      RunProgram({"--help"}).out,
      AllOf(HasSubstr("Usage: prog [OPTIONS] VERB\n"),
            HasSubstr("\nVerbs:\n  greet                       Greets\n"),
            HasSubstr("  -h, --help                  Print")));
}

TEST(ProgramTest, WhatFewPlantsNeedIsInHelpAllAlone) {
  const auto help_of = [](const char* flag) {
    Program program("prog", "A program");
    CLI::App& verb = program.AddVerb(
        "greet", "Greets", [](const Context&) { return int{kExitOk}; });
    verb.add_flag("--plain");
    verb.add_flag("--special");
    ShowInHelpAll(verb, {"--special", "--of-a-component-that-is-left-out"});
    const char* arguments[] = {"prog", "greet", flag};
    testing::internal::CaptureStdout();
    EXPECT_EQ(program.Run(3, arguments), kExitOk);
    return testing::internal::GetCapturedStdout();
  };

  EXPECT_THAT(help_of("--help"),
              AllOf(HasSubstr("--plain"), Not(HasSubstr("--special")),
                    EndsWith("\nmore: --help-all\n")));
  EXPECT_THAT(help_of("--help-all"),
              AllOf(HasSubstr("--plain"), HasSubstr("--special"),
                    Not(HasSubstr("more:"))));
  EXPECT_THAT(RunProgram({"greet", "--help"}).out, Not(HasSubstr("more:")));
}

// In a file of --config as on the command line.
TEST(ProgramTest, ARemovedWordNamesWhatReplacesIt) {
  const TemporaryDirectory directory;
  const std::string file = (directory.path() / "c.toml").string();
  std::ofstream(file) << "[run]\nshadow = 'paper'\n";
  const auto error_of = [](std::vector<const char*> words) {
    Program program("fdi-monitor", "A program");
    program.AddVerb("run", "Runs", [](const Context&) { return int{kExitOk}; });
    words.insert(words.begin(), "fdi-monitor");
    testing::internal::CaptureStderr();
    EXPECT_EQ(program.Run(static_cast<int>(words.size()), words.data()),
              kExitUsage);
    return testing::internal::GetCapturedStderr();
  };

  EXPECT_THAT(error_of({"top", "--once"}),
              HasSubstr("top is gone: fdi-monitor watch --table"));
  EXPECT_THAT(error_of({"run", "--shadow=paper"}),
              HasSubstr("--shadow is gone: record with --record"));
  EXPECT_THAT(error_of({"run", "--console-tls", "x"}),
              HasSubstr("--console-tls is gone: nginx"));
  EXPECT_THAT(error_of({"--config", file.c_str(), "run"}),
              HasSubstr("line 2: --shadow is gone: record with --record"));
  EXPECT_THAT(error_of({"run", "--never-there"}), Not(HasSubstr("is gone")));
}

TEST(ProgramTest, OptionsOfTheBusAreForProgramsThatUseIt) {
  Program program("prog", "A program");
  program.AddVerb("greet", "Greets",
                  [](const Context&) { return int{kExitOk}; });
  const char* arguments[] = {"prog", "greet", "--domain", "7"};
  testing::internal::CaptureStderr();

  EXPECT_EQ(program.Run(4, arguments), kExitUsage);

  EXPECT_THAT(testing::internal::GetCapturedStderr(),
              HasSubstr("unknown option '--domain'"));
}

TEST(ProgramTest, HelpAndVersionGoToStdoutAndSucceed) {
  EXPECT_EQ(RunProgram({"--help"}).code, kExitOk);
  EXPECT_THAT(RunProgram({"greet", "--help"}).out, HasSubstr("--who"));
  EXPECT_EQ(RunProgram({"--version"}).out, "prog " + SoftwareVersion() + "\n");
  EXPECT_THAT(SoftwareVersion(), StartsWith("0.1.0+"));
}

class ProgramConfigTest : public testing::Test {
 protected:
  const char* Write(const std::string& text) {
    path_ = (directory_.path() / "c.toml").string();
    std::ofstream(path_) << text;
    return path_.c_str();
  }
  storage::TemporaryDirectory directory_;
  std::string path_;
};

TEST_F(ProgramConfigTest, FileSetsOptionsThatTheCommandLineDoesNot) {
  const char* file = Write("domain = 3\njson = true\n[greet]\nwho = \"you\"\n");

  const Outcome outcome =
      RunProgram({"greet", "--domain", "4", "--config", file});

  EXPECT_EQ(outcome.code, kExitOk) << outcome.err;
  EXPECT_EQ(outcome.options.domain, 4);
  EXPECT_TRUE(outcome.options.json);
  EXPECT_EQ(outcome.who, "you");
}

TEST_F(ProgramConfigTest, UnknownKeyIsRefusedByName) {
  const Outcome outcome =
      RunProgram({"greet", "--config", Write("[greet]\nwhom = \"you\"\n")});

  EXPECT_EQ(outcome.code, kExitUsage);
  EXPECT_THAT(outcome.err,
              AllOf(HasSubstr(path_ + ": line 2: unknown key 'greet.whom': did "
                                      "you mean 'greet.who'?")));
}

TEST_F(ProgramConfigTest, VerbIsATable) {
  const Outcome outcome =
      RunProgram({"greet", "--config", Write("greet = 5\n")});

  EXPECT_EQ(outcome.code, kExitUsage);
  EXPECT_THAT(outcome.err,
              HasSubstr("line 1: greet is a verb: expected a table [greet]"));
}

TEST_F(ProgramConfigTest, SyntaxErrorNamesFileAndLine) {
  const Outcome outcome =
      RunProgram({"greet", "--config", Write("domain = 3\n\nx =")});

  EXPECT_EQ(outcome.code, kExitUsage);
  EXPECT_THAT(outcome.err, AllOf(HasSubstr(path_), HasSubstr("line 3")));
}

// The parser recurses: without a bound such a file ends the process.
TEST_F(ProgramConfigTest, KeysThatAreTooDeepAreAUsageError) {
  std::string key = "domain = 3\na";
  for (int i = 0; i < 1'000'000; ++i) {
    key += ".a";
  }
  const Outcome outcome =
      RunProgram({"greet", "--config", Write(key + " = 1\n")});

  EXPECT_EQ(outcome.code, kExitUsage);
  EXPECT_THAT(outcome.err,
              AllOf(HasSubstr(path_),
                    HasSubstr("line 2: a key has more than 16 parts")));
}

TEST_F(ProgramConfigTest, MissingFileIsAUsageError) {
  EXPECT_EQ(RunProgram({"greet", "--config", "/nowhere/c.toml"}).code,
            kExitUsage);
}

TEST_F(ProgramConfigTest, ConfigIsBlamedOnlyForWhatStandsInIt) {
  const Outcome outcome = RunProgram({"greet", "--within", "5x"});

  EXPECT_EQ(outcome.code, kExitUsage);
  EXPECT_THAT(outcome.err, StartsWith("prog: error: '5x' is not a duration"));
}

TEST(ProgramTest, ExamplesStandBelowTheHelpOfTheirVerb) {
  Program program("prog", "A program");
  program.AddVerb("greet", "Greets", [](const Context&) { return 0; });
  program.AddExamples({{"greet", {{"Say hello", "prog greet"}}}});
  const char* arguments[] = {"prog", "greet", "--help"};
  testing::internal::CaptureStdout();

  EXPECT_EQ(program.Run(3, arguments), 0);

  EXPECT_THAT(testing::internal::GetCapturedStdout(),
              HasSubstr("Examples:\n  # Say hello\n  prog greet\n"));
  EXPECT_THROW(program.AddExamples({{"gret", {}}}), std::logic_error);
}

// The report of --check-examples.
std::string FindingsOf(const std::vector<Example>& examples) {
  Program program("prog", "A program");
  CLI::App& greet =
      program.AddVerb("greet", "Greets", [](const Context&) { return 0; });
  std::string who;
  greet.add_option("--who", who, "Whom")->check(CLI::ExistingFile);
  program.AddExamples({{"", examples}, {"greet", examples}});
  const char* arguments[] = {"prog", "--check-examples"};
  testing::internal::CaptureStderr();
  const int code = program.Run(2, arguments);
  const std::string findings = testing::internal::GetCapturedStderr();
  EXPECT_EQ(code, findings.empty() ? 0 : 1);
  return findings;
}

TEST(ProgramTest, ExamplesThatTheParserRefusesAreFound) {
  const Example good{"Hello", "FDI_DATA=x prog greet --who 'a file' | less"};

  EXPECT_THAT(FindingsOf({good, good}), IsEmpty());
  EXPECT_THAT(FindingsOf({good}), HasSubstr("greet has fewer than two"));
  EXPECT_THAT(FindingsOf({good, {"Old", "prog greet --whom x"}}),
              HasSubstr("prog greet --whom x: "));
  EXPECT_THAT(FindingsOf({good, {"Old", "prog gret"}}), HasSubstr("prog gret"));
  EXPECT_THAT(FindingsOf({good, {"Other", "prig greet"}}),
              HasSubstr("does not call prog"));
}

}  // namespace
}  // namespace fdi::report
