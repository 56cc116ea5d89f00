#include "report/examples.h"

#include <algorithm>
#include <sstream>
#include <stdexcept>

#include <CLI/CLI.hpp>

#include "report/help.h"

namespace fdi::report {
namespace {

CLI::App& VerbOf(CLI::App& root, const std::string& verb) {
  CLI::App* app = &root;
  std::istringstream words(verb);
  for (std::string word; words >> word;) {
    try {
      app = app->get_subcommand(word);
    } catch (const CLI::OptionNotFound&) {
      throw std::logic_error("examples of '" + verb +
                             "', which is no verb of " + root.get_name());
    }
  }
  return *app;
}

// Splits a command like a shell does; stops at a pipe or redirection.
std::vector<std::string> Words(const std::string& command) {
  std::vector<std::string> words;
  std::string word;
  bool quoted = false;
  bool begun = false;
  for (const char c : command + " ") {
    if (c == '\'') {
      quoted = !quoted;
      begun = true;
    } else if (c != ' ' || quoted) {
      word += c;
      begun = true;
    } else if (begun) {
      if (word == "|" || word == ">" || word == "<" || word == "&") {
        break;
      }
      words.push_back(word);
      word.clear();
      begun = false;
    }
  }
  return words;
}

// Why the parser of `root` rejects `command`; empty if it accepts it.
std::string Refusal(CLI::App& root, const std::string& command) {
  std::vector<std::string> words = Words(command);
  const auto program = std::find(words.begin(), words.end(), root.get_name());
  if (program == words.end()) {
    return "does not call " + root.get_name();
  }
  // Words before the program set environment variables.
  words.erase(words.begin(), program + 1);
  std::reverse(words.begin(), words.end());  // The order that CLI11 expects.
  try {
    root.parse(words);
  } catch (const CLI::FileError&) {
    return "";  // --config with a file that does not exist.
  } catch (const CLI::Error& error) {
    return error.what();
  }
  return "";
}

}  // namespace

void SetExamples(CLI::App& root, const std::vector<VerbExamples>& examples) {
  for (const VerbExamples& verb : examples) {
    std::string text = "Examples:";
    for (const Example& example : verb.examples) {
      text += "\n  # " + example.what + "\n  " + example.command;
    }
    VerbOf(root, verb.verb).footer(text);
  }
}

std::vector<std::string> CheckExamples(
    CLI::App& root, const std::vector<VerbExamples>& examples) {
  AllowMissingFiles(root);
  std::vector<std::string> findings;
  const auto enough = [&findings](const CLI::App& app) {
    const std::string footer = app.get_footer();
    if (std::count(footer.begin(), footer.end(), '#') < 2) {
      findings.push_back(app.get_name() + " has fewer than two examples");
    }
  };
  enough(root);
  for (const CLI::App* verb : root.get_subcommands({})) {
    enough(*verb);
  }
  for (const VerbExamples& verb : examples) {
    for (const Example& example : verb.examples) {
      const std::string refusal = Refusal(root, example.command);
      if (!refusal.empty()) {
        findings.push_back(example.command + ": " + refusal);
      }
    }
  }
  return findings;
}

}  // namespace fdi::report
