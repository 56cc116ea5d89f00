#include "storage/cli/completion.h"

#include <array>
#include <ostream>
#include <regex>
#include <string>
#include <string_view>

#include <CLI/CLI.hpp>

#include "storage/cli/completion_script.h"

namespace fdi::cli {
namespace {

// What stands for a value, by the name of its option or argument.
struct NamedKind {
  std::string_view name;
  std::string_view kind;
};

constexpr std::array<NamedKind, 21> kNamedKinds = {
    {{"valve", "valve"},       {"valves", "valve"},
     {"fault", "fault"},       {"without", "fault"},
     {"model-set", "model"},   {"parent", "model"},
     {"candidate", "model"},   {"shadow", "model"},
     {"run", "run"},           {"runs", "run"},
     {"train-runs", "run"},    {"episode", "episode"},
     {"episodes", "episode"},  {"type", "type"},
     {"report", "folder"},     {"folder", "folder"},
     {"output", "file"},       {"file", "file"},
     {"csv", "file"},          {"map", "file"},
     {"console-write", "file"}}};

// "a b c" of "a, b or c", of "a, b, c" and of "{a,b,c}"; else empty.
std::string WordsOf(const std::string& text) {
  static const std::regex list(
      R"(\{?[\w/-]+(, ?[\w/-]+)*( or [\w/-]+|,[\w/-]+\}|, [\w/-]+))");
  if (!std::regex_match(text, list)) {
    return "";
  }
  static const std::regex separators(R"(, ?| or |[{}])");
  std::string words = std::regex_replace(text, separators, " ");
  words.erase(0, words.find_first_not_of(' '));
  return words.substr(0, words.find_last_not_of(' ') + 1);
}

bool StartsWith(const std::string& text, const char* beginning) {
  return text.rfind(beginning, 0) == 0;
}

// How the value of an option is completed: "words a b", "file", "valve", ...;
// "any" where nothing is known; empty for a flag.
std::string ValueKind(const CLI::Option& option) {
  const std::string type = option.get_type_name();
  if (option.get_items_expected_max() == 0 || StartsWith(type, "[=")) {
    return "";
  }
  if (const std::size_t brace = type.find('{'); brace != std::string::npos) {
    if (const std::string words = WordsOf(type.substr(brace)); !words.empty()) {
      return "words " + words;
    }
  }
  if (const auto words = WordsOf(option.get_description()); !words.empty()) {
    return "words " + words;
  }
  if (StartsWith(type, "SPEC")) {
    return "spec";
  }
  const bool number = StartsWith(type, "N") && !StartsWith(type, "NAME");
  const std::string name = option.get_single_name();
  for (const NamedKind& named : kNamedKinds) {
    if (name == named.name && !number) {
      return std::string(named.kind);
    }
  }
  return StartsWith(type, "DIR")              ? "folder"
         : StartsWith(type, "FILE")           ? "file"
         : StartsWith(type, "NAME[@VERSION]") ? "model"
         : StartsWith(type, "ID[@")           ? "run"
                                              : "any";
}

// Single-quoted for bash.
std::string Quoted(const std::string& text) {
  return "'" + std::regex_replace(text, std::regex("'"), R"('\'')") + "'";
}

// Entries of the tables for `app`, which `path` leads to, and its verbs.
void WriteTables(const CLI::App& app, const std::string& path,
                 std::ostream& out) {
  std::string verbs;
  for (const CLI::App* verb : app.get_subcommands({})) {
    verbs += (verbs.empty() ? "" : " ") + verb->get_name();
  }
  std::string options;
  std::string arguments;
  for (const CLI::Option* option : app.get_options()) {
    if (option->get_group().empty()) {
      continue;
    }
    const std::string kind = ValueKind(*option);
    if (option->get_positional()) {
      arguments += (arguments.empty() ? "" : "\n") + kind;
    }
    for (const std::string& name : option->get_lnames()) {
      options += (options.empty() ? "--" : " --") + name;
      if (!kind.empty()) {
        out << "_fdi_values[" << Quoted(path + " --" + name)
            << "]=" << Quoted(kind) << '\n';
      }
    }
  }
  out << "_fdi_verbs[" << Quoted(path) << "]=" << Quoted(verbs) << '\n'
      << "_fdi_options[" << Quoted(path) << "]=" << Quoted(options) << '\n'
      << "_fdi_arguments[" << Quoted(path) << "]=" << Quoted(arguments) << '\n';
  for (const CLI::App* verb : app.get_subcommands({})) {
    WriteTables(*verb, path + ' ' + verb->get_name(), out);
  }
}

}  // namespace

void PrintCompletion(const CLI::App& root, std::ostream& out) {
  out << "# bash completion of " << root.get_name()
      << ", made by its option --completion.\n"
      << "declare -gA _fdi_verbs _fdi_options _fdi_arguments _fdi_values\n";
  WriteTables(root, root.get_name(), out);
  out << kCompletionScript << "complete -F _fdi_complete " << root.get_name()
      << '\n';
}

}  // namespace fdi::cli
