#include "report/help.h"

#include <algorithm>
#include <array>
#include <memory>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>

#include "base/text.h"
#include "report/text_table.h"

namespace fdi::report {
namespace {

constexpr std::size_t kColumn = 30;     // Where the texts begin.
constexpr std::size_t kTextWidth = 50;  // 80 columns in total.
constexpr std::size_t kMaxHeadingLength = 26;
/// The name that PrepareHelp() gives to CLI11's checks for files and folders.
constexpr const char* kMustExist = "must exist";
/// The group of options that only --help-all shows.
constexpr const char* kRare = "Rare";

// A heading in the left column with its text in the right one.
std::string Entry(const std::string& heading, const std::string& text) {
  std::string entry = "  " + heading;
  std::size_t width = TextWidth(entry);
  bool first = true;
  const auto begin_line = [&] {
    if (!first || width + 2 > kColumn) {
      entry += '\n';
      width = 0;
    }
    entry.append(kColumn - width, ' ');
    width = 0;
    first = false;
  };
  std::istringstream words(text);
  for (std::string word; words >> word;) {
    if (first || width + 1 + TextWidth(word) > kTextWidth) {
      begin_line();
    } else {
      entry += ' ';
      ++width;
    }
    entry += word;
    width += TextWidth(word);
  }
  return entry + '\n';
}

class HelpFormatter : public CLI::Formatter {
 public:
  HelpFormatter() {
    label("SUBCOMMAND", "VERB");
    label("SUBCOMMANDS", "VERBS");
    label("Positionals", "Arguments");
  }

  std::string make_option(const CLI::Option* option,
                          bool positional) const override {
    std::vector<std::string> names;
    for (const std::string& name : option->get_snames()) {
      names.push_back("-" + name);
    }
    for (const std::string& name : option->get_lnames()) {
      names.push_back("--" + name);
    }
    std::string heading = positional ? option->get_name(true) : JoinText(names);
    const std::string value = option->get_type_name();
    if (!value.empty() && !(positional && value == "TEXT")) {
      heading += value.front() == '[' ? value : ' ' + value;
    }
    if (option->get_items_expected_max() > 1) {
      heading += " ...";
    }
    return Entry(heading, option->get_description());
  }

  std::string make_help(const CLI::App* app, std::string name,
                        CLI::AppFormatMode mode) const override {
    const bool all = mode == CLI::AppFormatMode::All;
    // In one section, in the order in which they were added.
    auto options = app->get_options([](const CLI::Option* option) {
      return option->nonpositional() && !option->get_group().empty();
    });
    const std::size_t rare =
        all ? 0 : std::erase_if(options, [](const CLI::Option* option) {
          return option->get_group() == kRare;
        });
    return make_description(app) + make_usage(app, std::move(name)) +
           make_positionals(app) + make_group("Options", false, options) +
           make_subcommands(app, CLI::AppFormatMode::Normal) + '\n' +
           make_footer(app) + (rare > 0 ? "\nmore: --help-all\n" : "");
  }

  std::string make_subcommand(const CLI::App* verb) const override {
    return Entry(verb->get_name(), verb->get_description());
  }
};

// The validators of an option; CLI11 only gives access by index.
std::vector<CLI::Validator*> ValidatorsOf(CLI::Option& option) {
  std::vector<CLI::Validator*> validators;
  try {
    while (true) {
      validators.push_back(
          option.get_validator(static_cast<int>(validators.size())));
    }
  } catch (const CLI::OptionNotFound&) {
    return validators;
  }
}

std::string NamesOf(const std::set<CLI::Option*>& options) {
  std::vector<std::string> names;
  for (const CLI::Option* option : options) {
    names.push_back(option->get_name());
  }
  std::sort(names.begin(), names.end());
  return JoinText(names);
}

bool NamesAFile(const std::string& description) {
  const std::array checks = {CLI::ExistingFile.get_description(),
                             CLI::ExistingDirectory.get_description(),
                             CLI::ExistingPath.get_description()};
  return std::ranges::find(checks, description) != checks.end();
}

// "0..232" of "INT in [0 - 232]", "udp|shm" of "{udp,shm}"; else empty.
std::string AcceptedBy(const std::string& description) {
  static const std::regex range(R"((?:INT|UINT|FLOAT) in \[(.*) - (.*)\])");
  static const std::regex words(R"((?:value in )?\{(.*)\})");
  if (description == CLI::PositiveNumber.get_description()) {
    return "above 0";
  }
  if (description == CLI::NonNegativeNumber.get_description()) {
    return "0 or more";
  }
  std::smatch found;
  if (std::regex_match(description, found, range)) {
    return found.str(1) + ".." + found.str(2);
  }
  if (std::regex_match(description, found, words)) {
    // A list made from a map has "word->value".
    const std::regex value("->[^,]*");
    return std::regex_replace(std::regex_replace(found.str(1), value, ""),
                              std::regex(","), "|");
  }
  return "";
}

// CLI11 words the bounds of a refused number as "0.000000 to 3600.000000", and
// of NonNegativeNumber with 309 digits.
void SayWhatIsAccepted(CLI::Validator& check, const std::string& accepted) {
  check.operation([original = check, accepted](std::string& text) {
    const std::string given = text;
    return original(text).empty()
               ? ""
               : "'" + given + "' is not accepted; expected " + accepted;
  });
}

// CLI11 shows validators within the value's name, "N:INT in [0 - 232]". They
// are removed from it, so that a name may contain a colon, and what they accept
// becomes the name itself or a remark. @returns the remark.
std::string TakeChecks(CLI::Option& option) {
  std::string accepted;
  for (CLI::Validator* check : ValidatorsOf(option)) {
    const std::string description = check->get_description();
    if (NamesAFile(description)) {
      check->name(kMustExist);
    } else if (const auto text = AcceptedBy(description); !text.empty()) {
      accepted = text;
      SayWhatIsAccepted(*check, text);
    }
    check->description("");
  }
  const std::string name = option.get_type_name();
  const bool plain = name == "INT" || name == "UINT" || name == "FLOAT" ||
                     name == "TEXT" || name == "NAME" || name == "LEVEL";
  const bool short_enough = accepted.size() <= kMaxHeadingLength &&
                            accepted.find(' ') == std::string::npos;
  if (plain && !accepted.empty() && short_enough) {
    option.type_name(std::exchange(accepted, ""));
  } else if (name == "INT" || name == "UINT") {
    option.type_name("N");
  } else if (name == "FLOAT") {
    option.type_name("X");
  }
  return accepted == option.get_type_name() ? "" : accepted;
}

void Describe(CLI::Option& option) {
  std::vector<std::string> remarks;
  const auto add = [&remarks](const std::string& what,
                              const std::string& value) {
    if (!value.empty()) {
      remarks.push_back(what + value);
    }
  };
  const bool flag = option.get_items_expected_max() == 0;
  if (!flag) {
    add("", TakeChecks(option));
    std::string usual = option.get_default_str();
    std::erase(usual, '"');
    const bool optional = option.get_expected_min() == 0 && !usual.empty();
    add(optional ? "without a value: " : "default ",
        usual == "[]" ? "" : usual);
  }
  add("environment ", option.get_envname());
  add("needs ", NamesOf(option.get_needs()));
  add("not with ", NamesOf(option.get_excludes()));
  if (option.get_required() && !option.get_positional()) {
    remarks.emplace_back("required");
  }
  const std::string description = option.get_description();
  if (option.get_items_expected_max() > 1 && !option.get_positional() &&
      description.find("repeat") == std::string::npos) {
    remarks.emplace_back("may be repeated");
  }
  if (remarks.empty()) {
    return;
  }
  // A remark is added inside existing brackets: "Seed (default 1; ...)".
  const bool open = description.ends_with(')');
  option.description((open
                          ? description.substr(0, description.size() - 1) + "; "
                          : description + " (") +
                     JoinText(remarks, "; ") + ")");
}

// Calls `act` for the program, its groups and its verbs.
template <typename F>
void ForEachApp(CLI::App& app, const F& act) {
  act(app);
  for (CLI::App* verb : app.get_subcommands([](CLI::App*) { return true; })) {
    ForEachApp(*verb, act);
  }
}

}  // namespace

void PrepareHelp(CLI::App& root) {
  const auto formatter = std::make_shared<HelpFormatter>();
  ForEachApp(root, [&formatter](CLI::App& app) {
    app.formatter(formatter);
    app.group("Verbs");
    // The last line of --help names it, where it shows more.
    app.get_option("--help-all")->group("");
    for (CLI::Option* option : app.get_options()) {
      Describe(*option);
    }
  });
}

void ShowInHelpAll(CLI::App& verb, std::initializer_list<const char*> names) {
  for (const char* name : names) {
    if (CLI::Option* option = verb.get_option_no_throw(name)) {
      option->group(kRare);
    }
  }
}

void AllowMissingFiles(CLI::App& root) {
  ForEachApp(root, [](CLI::App& app) {
    for (CLI::Option* option : app.get_options()) {
      for (CLI::Validator* check : ValidatorsOf(*option)) {
        if (check->get_name() == kMustExist) {
          check->active(false);
        }
      }
    }
  });
}

}  // namespace fdi::report
