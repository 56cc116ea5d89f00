#include "storage/app/common.h"

#include <algorithm>
#include <climits>
#include <fstream>
#include <iostream>
#include <limits>

#include <CLI/CLI.hpp>
#include <pwd.h>
#include <unistd.h>

#include "diagnosis/error.h"
#include "storage/cli/signal_list.h"
#include "storage/cli/text_table.h"
#include "storage/cli/time_text.h"

namespace fdi::storage {

DataDirectory DataOf(const cli::Context& context) {
  return {context.options.data_dir};
}

DataDirectory WritableDataOf(const cli::Context& context) {
  const DataDirectory data = DataOf(context);
  EnsureExists(data);
  return data;
}

cli::Json SignalsJson(SignalMask signals) {
  cli::Json names = cli::Json::array();
  for (std::size_t i = 0; i < kSignalCount; ++i) {
    const auto signal = static_cast<Signal>(i);
    if ((signals & MaskOf(signal)) != 0) {
      names.push_back(std::string(SignalName(signal)));
    }
  }
  return names;
}

SignalMask ParseSignals(std::string_view list) {
  constexpr SignalMask kAll = (1U << kSignalCount) - 1U;
  return cli::ParseSignals(CLI::detail::split(std::string(list), ','), kAll);
}

cli::Json TimeJson(const std::optional<std::int64_t>& stamp_ns) {
  return stamp_ns ? cli::Json(cli::FormatTime(*stamp_ns, true)) : cli::Json();
}

std::string TimeText(const std::optional<std::int64_t>& stamp_ns,
                     const cli::Context& context) {
  return stamp_ns ? cli::FormatTime(*stamp_ns, context.options.utc) : "-";
}

std::string Hex(std::uint64_t value) {
  return EpisodeIdText(value);
}

void PrintFields(
    std::ostream& out,
    const std::vector<std::pair<std::string, std::string>>& fields) {
  std::size_t width = 0;
  for (const auto& [name, value] : fields) {
    width = std::max(width, name.size());
  }
  for (const auto& [name, value] : fields) {
    out << name << ':' << std::string(width - name.size() + 2, ' ') << value
        << '\n';
  }
}

void WriteOutput(const std::string& path,
                 const std::function<void(std::ostream&)>& write) {
  if (path == "-") {
    write(std::cout);
    return;
  }
  const std::string partial = path + ".part";
  std::ofstream file(partial, std::ios::binary | std::ios::trunc);
  if (file) {
    write(file);
    file.close();
  }
  if (!file) {
    std::error_code ignored;
    std::filesystem::remove(partial, ignored);
    throw DataError("cannot write " + path);
  }
  std::filesystem::rename(partial, path);
}

void TimeWindow::AddTo(CLI::App& verb) {
  verb.add_option("--since", since, "From this time on: 2026-11-20, 2h, ...");
  verb.add_option("--until", until, "Before this time");
}

std::int64_t TimeWindow::since_ns(const cli::Context& context) const {
  return since.empty()
             ? std::numeric_limits<std::int64_t>::min()
             : cli::ParseTimeOrAgo(since, context.options.utc, cli::NowNs());
}

std::int64_t TimeWindow::until_ns(const cli::Context& context) const {
  return until.empty()
             ? std::numeric_limits<std::int64_t>::max()
             : cli::ParseTimeOrAgo(until, context.options.utc, cli::NowNs());
}

cli::Json HoursJson(const std::vector<CoverageTime>& coverage) {
  cli::Json valves = cli::Json::object();
  for (const CoverageTime& time : coverage) {
    valves[time.valve_id][time.quality] = time.hours;
  }
  return valves;
}

void PrintHours(std::ostream& out, const std::vector<CoverageTime>& coverage) {
  if (coverage.empty()) {
    return;
  }
  cli::TextTable table({{"valve"},
                        {"quality"},
                        {"hours", cli::Align::kRight},
                        {"samples", cli::Align::kRight}});
  for (const CoverageTime& time : coverage) {
    table.AddRow({time.valve_id, time.quality, cli::FormatNumber(time.hours, 2),
                  std::to_string(time.samples)});
  }
  table.Print(out);
}

std::string UserName() {
  const passwd* entry = getpwuid(geteuid());
  return entry != nullptr && entry->pw_name != nullptr ? entry->pw_name
                                                       : "unknown";
}

std::string Origin() {
  char host[HOST_NAME_MAX + 1] = {};
  const bool known = gethostname(host, sizeof host - 1) == 0;
  return "fdi-store " + UserName() + "@" + (known ? host : "localhost");
}

}  // namespace fdi::storage
