#include <iostream>
#include <memory>
#include <optional>
#include <string>

#include <CLI/CLI.hpp>
#include <unistd.h>

#include "base/error.h"
#include "monitor/console/users.h"
#include "programs/monitor/verbs.h"
#include "report/program.h"

namespace fdi::monitor {
namespace {

struct Arguments {
  std::string name;
  std::string role;
  std::string users;
  bool no_password{false};
  bool remove{false};
};

// Reads from a terminal without echo, or else one line of standard input.
std::string AskPassword(const char* prompt) {
  if (isatty(STDIN_FILENO) != 0) {
    const char* const text = getpass(prompt);
    if (text == nullptr) {
      throw DataError("the password: the terminal cannot be read");
    }
    return text;
  }
  std::string line;
  std::getline(std::cin, line);
  return line;
}

std::string NewHash() {
  const std::string password = AskPassword("Password: ");
  std::string hash = console::HashPassword(password);
  if (isatty(STDIN_FILENO) != 0 && AskPassword("Once more: ") != password) {
    throw ConfigError("the passwords differ");
  }
  return hash;
}

report::Report ChangeUser(const Arguments& arguments) {
  report::Report report;
  report.document = {{"user", arguments.name}, {"file", arguments.users}};
  if (arguments.remove) {
    console::StoreUser(arguments.users, arguments.name, std::nullopt);
    report.document["role"] = nullptr;
    report.Line("removed " + arguments.name);
  } else {
    console::User user;
    user.role = console::ParseRole(arguments.role).value();
    if (!arguments.no_password) {
      user.hash = NewHash();
    }
    console::StoreUser(arguments.users, arguments.name, user);
    report.document["role"] = arguments.role;
    report.Line(arguments.name + " has the role " + arguments.role);
  }
  report.Line("A monitor that runs takes it at SIGHUP (systemctl reload).");
  return report;
}

}  // namespace

void AddConsoleUserVerb(report::Program& program) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App& verb = program.AddVerb(
      "console-user", "Add, change or remove a user of the console",
      [arguments](const report::Context&) { return ChangeUser(*arguments); });
  verb.add_option("name", arguments->name, "1..64 letters, digits, . _ - @")
      ->required()
      ->type_name("NAME");
  CLI::Option* role =
      verb.add_option("--role", arguments->role,
                      "view: read everything; acknowledge: also acknowledge "
                      "and shelve; engineer: also label")
          ->check(CLI::IsMember({"view", "acknowledge", "engineer"}))
          ->type_name("ROLE");
  verb.add_option("--users", arguments->users,
                  "The file for --console-users, made if it is not there")
      ->required()
      ->type_name("FILE");
  CLI::Option* no_password =
      verb.add_flag("--no-password", arguments->no_password,
                    "Only --console-proxy-user can name this user");
  verb.add_flag("--remove", arguments->remove, "Remove the user")
      ->excludes(role)
      ->excludes(no_password);
  verb.callback([arguments, role] {
    if (!arguments->remove && role->empty()) {
      throw CLI::RequiredError("--role or --remove");
    }
  });
}

}  // namespace fdi::monitor
