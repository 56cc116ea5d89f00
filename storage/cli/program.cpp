#include "storage/cli/program.h"

#include <algorithm>
#include <csignal>
#include <filesystem>
#include <iostream>
#include <stdexcept>
#include <system_error>

#include <CLI/CLI.hpp>

#include "diagnosis/error.h"
#include "diagnosis/suggestion.h"
#include "storage/cli/documentation_options.h"
#include "storage/cli/logging.h"
#include "storage/cli/toml_config.h"
#include "storage/cli/version.h"
#include "storage/database.h"

namespace fdi::cli {
namespace {

// What --check-examples throws.
struct ExampleCheckRequest {};

const CLI::App& Chosen(const CLI::App& app) {
  const auto chosen = app.get_subcommands();
  return chosen.empty() ? app : Chosen(*chosen.front());
}

std::vector<std::string> VerbNames(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::App* verb : app.get_subcommands({})) {
    names.push_back(verb->get_name());
  }
  return names;
}

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

std::string Joined(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) {
    text += (text.empty() ? "" : ", ") + word;
  }
  return text;
}

// What was not understood, with the word that was probably meant.
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
  return is_option ? message : message + "; there are " + Joined(names);
}

// One line for what CLI11 refused.
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
    return "a verb is needed: " + Joined(VerbNames(app));
  }
  std::string message = error.what();
  const std::string ini = "INI was not able to parse ";
  if (message.rfind(ini, 0) == 0) {
    return "unknown key '" + message.substr(ini.size()) + "'";
  }
  return message;
}

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

// Whether a verb has a flag of that name that may have a value: [=VALUE].
bool TakesValue(const CLI::App& app, const std::string& flag) {
  const CLI::Option* option = app.get_option_no_throw(flag);
  if (option != nullptr && option->get_type_name().starts_with("[=")) {
    return true;
  }
  const auto verbs = app.get_subcommands([](const CLI::App*) { return true; });
  return std::any_of(verbs.begin(), verbs.end(), [&flag](const CLI::App* verb) {
    return TakesValue(*verb, flag);
  });
}

// The words of a command line, where such a value may also stand after a blank:
// the parser knows it after "=" alone.
std::vector<std::string> WithValues(const CLI::App& app, int argc,
                                    const char* const* argv) {
  std::vector<std::string> words;
  for (int i = 0; i < argc; ++i) {
    const std::string word = argv[i];
    const bool value = !words.empty() && !word.starts_with("-") &&
                       words.back().starts_with("--") &&
                       words.back().find('=') == std::string::npos &&
                       TakesValue(app, words.back());
    if (value) {
      words.back().append("=").append(word);
    } else {
      words.push_back(word);
    }
  }
  return words;
}

}  // namespace

Program::Program(std::string name, std::string description)
    : app_(std::make_unique<CLI::App>(std::move(description), name)) {
  AddGlobalOptions(*app_, options_);
  AddDocumentationOptions(*app_);
  app_->add_flag_callback(
          "--check-examples", [] { throw ExampleCheckRequest(); },
          "Try whether the examples of --help are understood")
      ->configurable(false)
      ->group("");
  app_->fallthrough();
  app_->require_subcommand(1);
  app_->failure_message({});
}

Program::~Program() = default;

CLI::App& Program::root() {
  return *app_;
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

void Program::AddExamples(std::vector<VerbExamples> examples) {
  examples_ = std::move(examples);
  SetExamples(*app_, examples_);
}

int Program::Run(int argc, const char* const* argv) noexcept {
  // At a limit of file size a write fails, as on a full disk.
  std::signal(SIGXFSZ, SIG_IGN);
  try {
    const int code = ParseAndRun(argc, argv);
    std::cout.flush();
    if (!std::cout) {
      Report("cannot write to standard output");
      return code == kExitOk ? kExitFailure : code;
    }
    return code;
  } catch (const std::exception& error) {
    try {
      Report(OneLine(error.what()));
      return ExitCodeOf(error);
    } catch (...) {
      return kExitFailure;
    }
  } catch (...) {
    return kExitFailure;
  }
}

int Program::ParseAndRun(int argc, const char* const* argv) {
  const auto in_config = [this] {
    const auto* option = app_->get_config_ptr();
    return "--config " + (option->count() > 0 ? option->results().front() : "");
  };
  try {
    const std::vector<std::string> words = WithValues(*app_, argc, argv);
    std::vector<const char*> pointers;
    for (const std::string& word : words) {
      pointers.push_back(word.c_str());
    }
    app_->parse(static_cast<int>(pointers.size()), pointers.data());
  } catch (const PrintConfigRequest&) {
    std::cout << TomlConfig().to_config(app_.get(), true, false, {});
    return kExitOk;
  } catch (const ExampleCheckRequest&) {
    return ReportExamples();
  } catch (const CLI::Success& request) {
    return app_->exit(request);
  } catch (const CLI::ConfigError& error) {
    throw fdi::ConfigError(in_config() + ": " + Explain(*app_, error));
  } catch (const CLI::ParseError& error) {
    throw fdi::ConfigError(Explain(*app_, error) + " (see " + app_->get_name() +
                           " --help)");
  } catch (const fdi::ConfigError& error) {
    throw fdi::ConfigError(in_config() + ": " + error.what());
  }
  return RunVerb(argc, argv);
}

int Program::ReportExamples() {
  const std::vector<std::string> findings = CheckExamples(*app_, examples_);
  for (const std::string& finding : findings) {
    Report(finding);
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
  const Context context{options_, MakeStderrSink(options_.log_level),
                        SoftwareVersion(), CommandLine(argc, argv)};
  return verb->action(context);
}

int Program::ExitCodeOf(const std::exception& error) const {
  for (const auto& mapper : mappers_) {
    if (const auto code = mapper(error)) {
      return *code;
    }
  }
  const auto is = [&error]<typename E>(const E*) {
    return dynamic_cast<const E*>(&error) != nullptr;
  };
  if (is(static_cast<const fdi::ConfigError*>(nullptr)) ||
      is(static_cast<const std::invalid_argument*>(nullptr))) {
    return kExitUsage;
  }
  if (is(static_cast<const NotFoundError*>(nullptr))) {
    return kExitNotFound;
  }
  if (is(static_cast<const DataError*>(nullptr)) ||
      is(static_cast<const storage::SqliteError*>(nullptr)) ||
      is(static_cast<const std::system_error*>(nullptr))) {
    return kExitData;
  }
  return kExitFailure;
}

void Program::Report(const std::string& message) const {
  std::cerr << app_->get_name() << ": error: " << message << '\n';
}

}  // namespace fdi::cli
