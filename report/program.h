#pragma once

#include <exception>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "base/log.h"
#include "report/examples.h"
#include "report/global_options.h"
#include "report/report.h"

namespace CLI {
class App;
}

namespace fdi::report {

/// Exit codes of every program; see also kExitPassing in passing_error.h.
enum ExitCode : int {
  kExitOk = 0,
  kExitFailure = 1,
  kExitUsage = 2,      ///< Usage or configuration, including CLI11's errors.
  kExitData = 3,       ///< Data, database or permission.
  kExitTransport = 4,  ///< DDS.
  kExitNotFound = 5,
};

/// The arguments of a verb.
struct Context {
  const GlobalOptions& options;
  LogSink log;               ///< To stderr, lines `event key=value`.
  std::string software;      ///< SoftwareVersion().
  std::string command_line;  ///< As typed; recorded with runs.
};

/// Body of a verb that prints its own output; returns the exit code.
using PrintAction = std::function<int(const Context&)>;
/// Body of a verb that returns data, which are printed as text or as requested
/// by --json, --csv (AllowCsv()) and --utc.
using ReportAction = std::function<Report(const Context&)>;
using VerbAction = std::variant<ReportAction, PrintAction>;

/// A sentence for `name`, which is of a component that this build was made
/// without. @param option of CMake that brings it back.
std::string LeftOut(const std::string& name, const std::string& option);

/// A command-line program: global options, verbs, error reporting. Use:
///
///     int main(int argc, char** argv) {
///       fdi::report::Program program("fdi-store", "Runs, models, history");
///       fdi::storage::AddRunsVerbs(program);
///       program.MapError<fdi::idl::TransportError>(fdi::report::kExitTransport);
///       return program.Run(argc, argv);
///     }
///     void AddRunsVerbs(Program& program) {
///       CLI::App& runs = program.AddGroup("runs", "Stored runs");
///       auto [list, options] =
///           AddVerb(program, runs, "list", "List the runs", List);
///       list.add_option("--valve", options.valve, "Glob over valve ids");
///       program.AllowCsv(list, "One line per run as CSV");
///     }
class Program {
 public:
  Program(std::string name, std::string description);
  ~Program();
  Program(const Program&) = delete;
  Program& operator=(const Program&) = delete;

  /// Adds --domain, --interface, --transport and --qos, for programs that use
  /// DDS.
  void AddBusOptions();

  /// The parser with its global options, for special needs.
  CLI::App& root();

  /// A group of verbs, e.g. `runs`.
  CLI::App& AddGroup(const std::string& name, const std::string& description);
  /// A verb of the program, or of a group.
  CLI::App& AddVerb(const std::string& name, const std::string& description,
                    VerbAction action);
  CLI::App& AddVerb(CLI::App& group, const std::string& name,
                    const std::string& description, VerbAction action);
  /// Adds --csv to a verb that returns a Report with a table.
  void AllowCsv(CLI::App& verb, const std::string& description);

  /// Refuses a verb, or an option of it, if its component is not in this
  /// build; see LeftOut(). @param verb that has the option; "" for a
  /// verb of the program.
  void AddLeftOut(const std::string& verb, const std::string& name,
                  const std::string& option);

  /// Appends examples to the help of verbs, groups (both named by path,
  /// "history list") and, for "", the program; ignores those of a verb, or with
  /// an option, that is left out. Call after adding the verbs.
  /// @throws std::logic_error for an unknown verb.
  void AddExamples(std::vector<VerbExamples> examples);

  /// Exceptions of type E, or derived from it, end with `code`. Predefined:
  /// ConfigError and std::invalid_argument 2, DataError, filesystem and system
  /// errors 3, NotFoundError 5; others 1.
  template <typename E>
  void MapError(int code) {
    mappers_.push_back([code](const std::exception& error) {
      return dynamic_cast<const E*>(&error) != nullptr
                 ? std::optional<int>(code)
                 : std::nullopt;
    });
  }

  /// Parses, runs the verb and reports an error in one line on stderr. Never
  /// throws. @returns the exit code.
  int Run(int argc, const char* const* argv) noexcept;

 private:
  struct Verb {
    CLI::App* app;
    VerbAction action;
  };
  int ParseAndRun(int argc, const char* const* argv);
  int ReportExamples();
  int RunVerb(int argc, const char* const* argv);
  int ExitCodeOf(const std::exception& error) const;
  int Print(const Report& report) const;
  /// The message about the first word of the command line that was removed or
  /// left out.
  std::optional<std::string> MissingWord() const;
  void RefuseUnknownVerb() const;
  void PrintError(const std::string& message) const;

  std::unique_ptr<CLI::App> app_;
  GlobalOptions options_;
  bool csv_{false};  // For the chosen verb.
  bool help_prepared_{false};
  std::vector<Verb> verbs_;
  std::vector<VerbExamples> examples_;
  std::map<std::pair<std::string, std::string>, std::string> left_out_;
  std::vector<std::function<std::optional<int>(const std::exception&)>>
      mappers_;
};

/// Adds a verb of a group, or of the program. The action receives the Options
/// that the caller binds to command-line options:
///
///     auto [verb, options] = AddVerb(program, group, "list", "...", List);
///     verb.add_option("--valve", options.valve, "Glob over valve ids");
///
/// CLI11 fills them when it parses, after the caller has returned: the action
/// owns them. It returns a Report, or prints and returns the exit code.
template <typename Options, typename Result>
std::pair<CLI::App&, Options&> AddVerb(Program& program, CLI::App& group,
                                       const std::string& name,
                                       const std::string& description,
                                       Result (*action)(const Options&,
                                                        const Context&)) {
  auto options = std::make_shared<Options>();
  CLI::App& verb =
      program.AddVerb(group, name, description,
                      std::function<Result(const Context&)>(
                          [options, action](const Context& context) {
                            return action(*options, context);
                          }));
  return {verb, *options};
}
template <typename Options, typename Result>
std::pair<CLI::App&, Options&> AddVerb(
    Program& program, const std::string& name, const std::string& description,
    Result (*action)(const Options&, const Context&)) {
  return AddVerb(program, program.root(), name, description, action);
}

}  // namespace fdi::report
