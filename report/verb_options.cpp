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
  verb.add_option("--since", since, "From this time on: 2026-11-20, 2h, ...");
  verb.add_option("--until", until, "Before this time");
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
