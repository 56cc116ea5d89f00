#include "storage/cli/manual.h"

#include <algorithm>
#include <cctype>
#include <regex>
#include <sstream>
#include <vector>

#include <CLI/CLI.hpp>

#include "storage/cli/output_folder.h"
#include "storage/cli/version.h"

namespace fdi::cli {
namespace {

// Names of program, group and verb in a row, joined by `separator`.
std::string PathOf(const CLI::App& app, const char* separator) {
  const CLI::App* parent = app.get_parent();
  return parent == nullptr
             ? app.get_name()
             : PathOf(*parent, separator) + separator + app.get_name();
}

// `text` such that man(7) shows it as it is.
std::string Roff(const std::string& text) {
  std::string escaped;
  bool line_start = true;
  for (const char c : text) {
    if (line_start && (c == '.' || c == '\'')) {
      escaped += "\\&";
    }
    if (c == '\\') {
      escaped += "\\e";
    } else if (c == '-') {
      escaped += "\\-";
    } else {
      escaped += c;
    }
    line_start = c == '\n';
  }
  return escaped;
}

std::string Bold(const std::string& text) {
  return "\\fB" + Roff(text) + "\\fR";
}

std::string Italic(const std::string& text) {
  return "\\fI" + Roff(text) + "\\fR";
}

// "DIR" of the type "DIR:PATH(existing)"; empty for a flag.
std::string TypeOf(const CLI::Option& option) {
  if (option.get_items_expected_max() == 0) {
    return "";
  }
  const std::string type = option.get_type_name();
  return type.substr(0, type.find(':'));
}

// What validators accept and neither type nor description says: "0..1024" of
// "N:INT in [0 - 1024]", "a,b" of "NAME:{a,b}".
std::string AcceptedBy(const CLI::Option& option) {
  static const std::regex range(R"(:(INT|UINT|FLOAT) in \[(.*) - (.*)\]$)");
  static const std::regex words(R"(:\{(.*)\}$)");
  const std::string type = option.get_type_name();
  std::smatch found;
  if (std::regex_search(type, found, range)) {
    return found.str(2) + ".." + found.str(3);
  }
  if (std::regex_search(type, found, words)) {
    const std::string first = found.str(1).substr(0, found.str(1).find(','));
    const bool known =
        option.get_description().find(first) != std::string::npos;
    return known ? "" : found.str(1);
  }
  return "";
}

// "-h, --help", "--record[=on|off]".
std::string OptionHeading(const CLI::Option& option) {
  if (option.get_positional()) {
    return Italic(option.get_name());
  }
  std::string heading;
  const auto add = [&heading](const std::string& name) {
    heading += (heading.empty() ? "" : ", ") + Bold(name);
  };
  for (const std::string& name : option.get_snames()) {
    add("-" + name);
  }
  for (const std::string& name : option.get_lnames()) {
    add("--" + name);
  }
  const std::string type = option.get_type_name();
  if (type.rfind("[=", 0) == 0) {
    return heading + Italic(type);
  }
  const std::string value = TypeOf(option);
  return value.empty() ? heading : heading + ' ' + Italic(value);
}

std::string NamesOf(const std::set<CLI::Option*>& options) {
  std::vector<std::string> names;
  for (const CLI::Option* option : options) {
    names.push_back(option->get_name());
  }
  std::sort(names.begin(), names.end());
  return CLI::detail::join(names, ", ");
}

// Range, default and relations to other options, one sentence each.
std::string OptionFacts(const CLI::Option& option) {
  std::string facts;
  const auto add = [&facts](const std::string& what, const std::string& value) {
    if (!value.empty()) {
      facts += " " + what + value + '.';
    }
  };
  if (const auto accepted = AcceptedBy(option); accepted != TypeOf(option)) {
    add("Accepted: ", accepted);
  }
  const std::string standard = option.get_default_str();
  add("Default: ", standard == "[]" || standard == "\"\"" ? "" : standard);
  add("Environment: ", option.get_envname());
  add("Not with ", NamesOf(option.get_excludes()));
  add("Needs ", NamesOf(option.get_needs()));
  if (option.get_required()) {
    facts += " Required.";
  }
  const bool said =
      option.get_description().find("repeat") != std::string::npos;
  if (option.get_items_expected_max() > 1 && !option.get_positional() &&
      !said) {
    facts += " May be repeated.";
  }
  return facts;
}

std::string Sentence(std::string text) {
  if (!text.empty() && text.back() != '.') {
    text += '.';
  }
  return text;
}

// The options that --help lists, positional ones or the others.
std::vector<const CLI::Option*> Listed(const CLI::App& app, bool positional) {
  return app.get_options([positional](const CLI::Option* option) {
    return option->get_positional() == positional &&
           !option->get_group().empty();
  });
}

void WriteOptions(std::ostream& out, const CLI::App& app) {
  const auto section = [&out](const char* title, const auto& options) {
    if (options.empty()) {
      return;
    }
    out << ".SH " << title << '\n';
    for (const CLI::Option* option : options) {
      out << ".TP\n"
          << OptionHeading(*option) << '\n'
          << Roff(Sentence(option->get_description()) + OptionFacts(*option))
          << '\n';
    }
  };
  section("ARGUMENTS", Listed(app, true));
  section("OPTIONS", Listed(app, false));
}

void WriteVerbs(std::ostream& out, const CLI::App& app) {
  const auto verbs = app.get_subcommands({});
  if (verbs.empty()) {
    return;
  }
  out << ".SH VERBS\n";
  for (const CLI::App* verb : verbs) {
    out << ".TP\n"
        << Bold(verb->get_name()) << '\n'
        << Roff(Sentence(verb->get_description())) << " See "
        << Bold(ManualPageName(*verb)) << "(1).\n";
  }
}

void WriteSynopsis(std::ostream& out, const CLI::App& app) {
  out << ".SH SYNOPSIS\n" << Bold(PathOf(app, " "));
  if (!app.get_subcommands({}).empty()) {
    out << ' ' << Italic("VERB");
  }
  out << " [" << Italic("OPTIONS") << ']';
  for (const CLI::Option* option : Listed(app, true)) {
    const bool many = option->get_items_expected_max() > 1;
    const std::string name = Italic(option->get_name()) + (many ? "..." : "");
    out << ' ' << (option->get_required() ? name : '[' + name + ']');
  }
  out << '\n';
}

// What holds for all programs.
void WriteCommon(std::ostream& out, const CLI::App& app) {
  const CLI::App* parent = app.get_parent();
  if (parent != nullptr) {
    const std::string path = PathOf(app, " ");
    out << ".PP\nOptions of every verb, such as \\fB\\-\\-data\\fR and "
           "\\fB\\-\\-json\\fR, are in "
        << Bold(path.substr(0, path.find(' '))) << "(1).\n";
  }
  out << ".SH EXIT STATUS\n"
         "0 ok, 1 failure, 2 usage or configuration, 3 data, database or "
         "permission, 4 DDS, 5 not found.\n";
  if (parent == nullptr) {
    out << ".SH FILES\n"
           "The data directory holds \\fIruns.db\\fR (recorded and imported "
           "samples), \\fImodels.db\\fR (model sets, valves) and "
           "\\fIhistory.db\\fR (fault episodes with their evidence), all of "
           "them SQLite.\n";
  }
}

void WriteExamples(std::ostream& out, const CLI::App& app) {
  const std::string footer = app.get_footer();
  if (footer.find_first_not_of(" \n") == std::string::npos) {
    return;
  }
  out << ".SH EXAMPLES\n.nf\n";
  std::istringstream lines(footer);
  for (std::string line; std::getline(lines, line);) {
    const bool heading =
        line == "Examples:" || line == "Example:" || line.empty();
    if (!heading) {
      out << Roff(line) << '\n';
    }
  }
  out << ".fi\n";
}

void WriteSeeAlso(std::ostream& out, const CLI::App& app) {
  std::vector<std::string> pages;
  if (const CLI::App* parent = app.get_parent()) {
    pages.push_back(ManualPageName(*parent));
    for (const CLI::App* sibling : parent->get_subcommands({})) {
      if (sibling != &app) {
        pages.push_back(ManualPageName(*sibling));
      }
    }
  } else {
    pages = {"fdi-monitor", "fdi-simulator", "fdi-store", "fdi-trainer"};
    std::erase(pages, app.get_name());
  }
  out << ".SH SEE ALSO\n";
  for (std::size_t i = 0; i < pages.size(); ++i) {
    out << Bold(pages[i]) << (i + 1 < pages.size() ? "(1),\n" : "(1)\n");
  }
}

void WritePages(const CLI::App& app, const std::filesystem::path& folder) {
  WriteFile(folder / (ManualPageName(app) + ".1"), ManualPage(app));
  for (const CLI::App* verb : app.get_subcommands({})) {
    WritePages(*verb, folder);
  }
}

}  // namespace

std::string ManualPageName(const CLI::App& app) {
  return PathOf(app, "-");
}

std::string ManualPage(const CLI::App& app) {
  std::string title = ManualPageName(app);
  std::transform(title.begin(), title.end(), title.begin(), [](char c) {
    return static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  });
  const std::string software = SoftwareVersion();
  std::ostringstream out;
  out << ".TH " << title << " 1 \"\" \"fdi "
      << software.substr(0, software.find('+')) << "\" \"fdi manual\"\n"
      << ".SH NAME\n"
      << Roff(ManualPageName(app)) << " \\- " << Roff(app.get_description())
      << '\n';
  WriteSynopsis(out, app);
  out << ".SH DESCRIPTION\n" << Roff(Sentence(app.get_description())) << '\n';
  WriteVerbs(out, app);
  WriteOptions(out, app);
  WriteCommon(out, app);
  WriteExamples(out, app);
  WriteSeeAlso(out, app);
  return out.str();
}

void WriteManualPages(const CLI::App& root,
                      const std::filesystem::path& folder) {
  EnsureFolder(folder);
  WritePages(root, folder);
}

}  // namespace fdi::cli
