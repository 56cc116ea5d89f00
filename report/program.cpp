#include "report/program.h"

#include <algorithm>
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <iostream>
#include <iterator>
#include <new>
#include <stdexcept>
#include <system_error>
#include <utility>
#include <variant>

#include <CLI/CLI.hpp>

#include "base/error.h"
#include "base/passing_error.h"
#include "base/printable.h"
#include "base/suggestion.h"
#include "base/text.h"
#include "report/help.h"
#include "report/logging.h"
#include "report/output_patience.h"
#include "report/removed_words.h"

namespace fdi::report {
namespace {

// Without memory or threads the DDS library throws where nobody can catch, e.g.
// in destructors: this ends with an error message, other terminations abort.
[[noreturn]] void EndTerminated() {
  const auto end = [](const char* what) {
    for (const char* part :
         {"error: out of memory, address space or threads (", what, ")\n"}) {
      WriteToStderr(part);
    }
    std::_Exit(kExitFailure);
  };
  try {
    if (const std::exception_ptr error = std::current_exception()) {
      std::rethrow_exception(error);
    }
  } catch (const std::bad_alloc& error) {
    end(error.what());
  } catch (const std::system_error& error) {
    end(error.what());
  } catch (...) {
  }
  std::abort();
}

// Thrown by --check-examples.
struct ExampleCheckRequest {};

// The chosen verb, or group if no verb was given.
const CLI::App& Chosen(const CLI::App& app) {
  const auto chosen = app.get_subcommands();
  return chosen.empty() ? app : Chosen(*chosen.front());
}

// "history list"; empty for the program.
std::string PathOf(const CLI::App& app) {
  const CLI::App* parent = app.get_parent();
  if (parent == nullptr) {
    return "";
  }
  const std::string path = PathOf(*parent);
  return path + (path.empty() ? "" : " ") + app.get_name();
}

std::vector<std::string> VerbNames(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::App* verb : app.get_subcommands({})) {
    names.push_back(verb->get_name());
  }
  return names;
}

// Options of the verb, its group and the program, all of which may follow the
// verb.
std::vector<std::string> OptionNames(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::App* level = &app; level != nullptr;
       level = level->get_parent()) {
    for (const CLI::Option* option : level->get_options()) {
      for (const std::string& name : option->get_lnames()) {
        names.push_back("--" + name);
      }
    }
  }
  return names;
}

// The unknown word, with a suggestion.
std::string Unexpected(const CLI::App& app, const std::string& word) {
  const bool is_option = word.size() > 1 && word.front() == '-';
  const std::vector<std::string> verbs = VerbNames(app);
  if (!is_option && verbs.empty()) {
    return "unexpected argument '" + word + "'";
  }
  const std::string kind = is_option ? "option" : "verb";
  const auto names = is_option ? OptionNames(app) : verbs;
  const auto meant = Suggest(word.substr(0, word.find('=')), names);
  std::string message = "unknown " + kind + " '" + word + "'";
  if (meant) {
    return message + ": did you mean '" + *meant + "'?";
  }
  return is_option ? message : message + "; there are " + JoinText(names);
}

// One line for an error of CLI11. Unparsed words are more informative than its
// own message: if a verb is mistyped, it reports a missing verb.
std::string Explain(const CLI::App& root, const CLI::ParseError& error) {
  const CLI::App& app = Chosen(root);
  const std::vector<std::string> left = root.remaining(true);
  const bool verb_missing = !VerbNames(app).empty();
  const bool left_over =
      dynamic_cast<const CLI::ExtrasError*>(&error) != nullptr;
  if (!left.empty() && (left_over || verb_missing)) {
    return Unexpected(app, left.front());
  }
  if (dynamic_cast<const CLI::RequiredError*>(&error) != nullptr &&
      verb_missing) {
    return "a verb is needed: " + JoinText(VerbNames(app));
  }
  return error.what();
}

// The ranges of CLI11 accept NaN, which is neither below nor above a limit.
// Call before PrepareHelp(), which takes the checks out of the types.
void RefuseNan(CLI::App& app) {
  for (CLI::Option* option : app.get_options()) {
    const std::string type = option->get_type_name();
    if (type.find("FLOAT") == std::string::npos &&
        type.find("POSITIVE") == std::string::npos &&
        type.find("NONNEGATIVE") == std::string::npos) {
      continue;
    }
    option->check([](const std::string& text) {
      double value = 0.0;
      const bool is_nan =
          CLI::detail::lexical_cast(text, value) && std::isnan(value);
      return is_nan ? text + " is no number" : std::string();
    });
  }
  for (CLI::App* verb : app.get_subcommands({})) {
    RefuseNan(*verb);
  }
}

// Scripts and logs rely on one line per error.
std::string OneLine(std::string text) {
  while (!text.empty() && text.back() == '\n') {
    text.pop_back();
  }
  std::replace(text.begin(), text.end(), '\n', ';');
  return text;
}

std::string CommandLine(int argc, const char* const* argv) {
  std::string line;
  for (int i = 0; i < argc; ++i) {
    line += (i == 0 ? "" : " ");
    line += argv[i];
  }
  return line;
}

}  // namespace

std::string LeftOut(const std::string& name, const std::string& option) {
  return name + " is not in this build: it takes one that was made with -D" +
         option + "=ON";
}

Program::Program(std::string name, std::string description)
    : app_(
          std::make_unique<CLI::App>(std::move(description), std::move(name))) {
  MapError<std::system_error>(kExitData);  // And std::filesystem.
  MapError<DataError>(kExitData);
  MapError<NotFoundError>(kExitNotFound);
  MapError<std::invalid_argument>(kExitUsage);
  MapError<fdi::ConfigError>(kExitUsage);
  MapError<PassingError>(kExitPassing);
  AddGlobalOptions(*app_, options_);
  // For tests; hidden from --help.
  app_->add_flag_callback(
          "--check-examples", [] { throw ExampleCheckRequest(); },
          "Check that the examples in --help are understood")
      ->configurable(false)
      ->group("");
  app_->fallthrough();  // Options of the program may follow the verb.
  app_->require_subcommand(1);
  app_->failure_message({});
}

Program::~Program() = default;

CLI::App& Program::root() {
  return *app_;
}

void Program::AddBusOptions() {
  report::AddBusOptions(*app_, options_);
}

CLI::App& Program::AddGroup(const std::string& name,
                            const std::string& description) {
  CLI::App& group = *app_->add_subcommand(name, description);
  group.require_subcommand(1);
  return group;
}

CLI::App& Program::AddVerb(const std::string& name,
                           const std::string& description, VerbAction action) {
  return AddVerb(*app_, name, description, std::move(action));
}

CLI::App& Program::AddVerb(CLI::App& group, const std::string& name,
                           const std::string& description, VerbAction action) {
  CLI::App& verb = *group.add_subcommand(name, description);
  verb.require_subcommand(0);
  verbs_.push_back({&verb, std::move(action)});
  return verb;
}

void Program::AllowCsv(CLI::App& verb, const std::string& description) {
  verb.add_flag("--csv", csv_, description);
}

void Program::AddLeftOut(const std::string& verb, const std::string& name,
                         const std::string& option) {
  left_out_[{verb, name}] = LeftOut(name, option);
}

std::optional<std::string> Program::MissingWord() const {
  const std::string verb = PathOf(Chosen(*app_));
  for (const std::string& word : app_->remaining(true)) {
    const std::string name = word.substr(0, word.find('='));
    if (const auto found = left_out_.find({verb, name});
        found != left_out_.end()) {
      return found->second;
    }
    if (auto removed = RemovedWord(app_->get_name(), verb, name)) {
      return removed;
    }
  }
  return std::nullopt;
}

void Program::AddExamples(std::vector<VerbExamples> examples) {
  std::erase_if(examples, [this](const VerbExamples& of) {
    return left_out_.contains({"", of.verb.substr(0, of.verb.find(' '))});
  });
  for (VerbExamples& of : examples) {
    std::erase_if(of.examples, [this](const Example& example) {
      return std::ranges::any_of(left_out_, [&](const auto& gone) {
        return gone.first.second.starts_with("--") &&
               (example.command + " ").find(" " + gone.first.second + " ") !=
                   std::string::npos;
      });
    });
  }
  SetExamples(*app_, examples);
  std::ranges::move(examples, std::back_inserter(examples_));
}

int Program::Run(int argc, const char* const* argv) noexcept {
  // Makes writing beyond the file size limit fail like a full disk.
  std::signal(SIGXFSZ, SIG_IGN);
  std::set_terminate(EndTerminated);
  try {
    const int code = ParseAndRun(argc, argv);
    // A full disk or a closed pipe may only show when flushing.
    std::cout.flush();
    if (!std::cout) {
      PrintError("cannot write to standard output");
      return code == kExitOk ? kExitFailure : code;
    }
    return code;
  } catch (const std::exception& error) {
    try {
      PrintError(OneLine(error.what()));
      return ExitCodeOf(error);
    } catch (...) {
      return kExitFailure;
    }
  } catch (...) {
    return kExitFailure;
  }
}

int Program::ParseAndRun(int argc, const char* const* argv) {
  if (!std::exchange(help_prepared_, true)) {
    RefuseNan(*app_);
    PrepareHelp(*app_);
  }
  try {
    app_->parse(argc, argv);
  } catch (const ExampleCheckRequest&) {
    return ReportExamples();
  } catch (const CLI::Success& request) {
    RefuseUnknownVerb();
    return app_->exit(request);  // Prints --help or --version.
  } catch (const CLI::ConfigError& error) {
    const auto* option = app_->get_config_ptr();
    throw fdi::ConfigError(
        "--config " + (option->count() > 0 ? option->results().front() : "") +
        ": " + error.what());
  } catch (const CLI::ParseError& error) {
    throw fdi::ConfigError(MissingWord().value_or(Explain(*app_, error)) +
                           " (see " + app_->get_name() + " --help)");
  }
  return RunVerb(argc, argv);
}

// CLI11 answers --help before it looks at the words that it could not place.
void Program::RefuseUnknownVerb() const {
  const CLI::App& chosen = Chosen(*app_);
  const std::vector<std::string> left = app_->remaining(true);
  if (!VerbNames(chosen).empty() && !left.empty() &&
      !left.front().starts_with('-')) {
    throw fdi::ConfigError(
        MissingWord().value_or(Unexpected(chosen, left.front())) + " (see " +
        app_->get_name() + " --help)");
  }
}

int Program::ReportExamples() {
  const std::vector<std::string> findings = CheckExamples(*app_, examples_);
  for (const std::string& finding : findings) {
    PrintError(finding);
  }
  return findings.empty() ? kExitOk : kExitFailure;
}

int Program::RunVerb(int argc, const char* const* argv) {
  const CLI::App* chosen = &Chosen(*app_);
  const auto verb =
      std::find_if(verbs_.begin(), verbs_.end(),
                   [chosen](const Verb& v) { return v.app == chosen; });
  if (verb == verbs_.end()) {
    throw std::logic_error("verb without an action: " + chosen->get_name());
  }
  if (csv_ && options_.json) {
    throw fdi::ConfigError("--csv and --json exclude each other");
  }
  const Context context{options_, MakeStderrSink(options_.log_level),
                        SoftwareVersion(), CommandLine(argc, argv)};
  if (const auto* print = std::get_if<PrintAction>(&verb->action)) {
    return (*print)(context);
  }
  return Print(std::get<ReportAction>(verb->action)(context));
}

int Program::Print(const Report& report) const {
  const OutputPatience patience;
  if (options_.json) {
    report.PrintJson(std::cout);
  } else if (csv_) {
    report.PrintCsv(std::cout);
  } else {
    report.PrintText(std::cout, {StdoutStyle(), options_.utc});
  }
  std::cout.flush();
  return report.exit_code;
}

int Program::ExitCodeOf(const std::exception& error) const {
  // In reverse order: a program may override a mapping, or map a derived type.
  for (auto mapper = mappers_.rbegin(); mapper != mappers_.rend(); ++mapper) {
    if (const auto code = (*mapper)(error)) {
      return *code;
    }
  }
  return kExitFailure;
}

void Program::PrintError(const std::string& message) const {
  WriteToStderr(app_->get_name() + ": error: " + Printable(message, "\n") +
                "\n");
}

}  // namespace fdi::report
