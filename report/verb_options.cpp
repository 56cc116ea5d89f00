#include "report/verb_options.h"

#include <climits>
#include <limits>

#include <CLI/CLI.hpp>
#include <pwd.h>
#include <unistd.h>

#include "base/time_text.h"
#include "report/program.h"

namespace fdi::report {

void TimeWindow::AddTo(CLI::App& verb) {
  // Before it was a time, --from was the plant's history.
  const auto no_url = [](const std::string& text) -> std::string {
    return text.starts_with("postgresql:")
               ? "a time is expected; --db URL reads the plant's history"
               : "";
  };
  verb.add_option("--from", since, "From this time on: 2026-11-20, 2h, ...")
      ->check(no_url)
      ->type_name("TIME");
  verb.add_option("--to", until, "Before this time")->type_name("TIME");
}

std::int64_t TimeWindow::since_ns(const Context& context) const {
  return since.empty() ? std::numeric_limits<std::int64_t>::min()
                       : ParseTimeOrAgo(since, context.options.utc, NowNs());
}

std::int64_t TimeWindow::until_ns(const Context& context) const {
  return until.empty() ? std::numeric_limits<std::int64_t>::max()
                       : ParseTimeOrAgo(until, context.options.utc, NowNs());
}

// From the account, not from $USER, which anybody can set.
std::string UserName() {
  const passwd* entry = getpwuid(geteuid());
  return entry != nullptr && entry->pw_name != nullptr ? entry->pw_name
                                                       : "unknown";
}

std::string Origin(const std::string& program) {
  char host[HOST_NAME_MAX + 1] = {};
  const bool known = gethostname(host, sizeof host - 1) == 0;
  return program + " " + UserName() + "@" + (known ? host : "localhost");
}

}  // namespace fdi::report
