#pragma once

#include <filesystem>
#include <functional>
#include <iosfwd>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "diagnosis/sample.h"
#include "storage/cli/json_output.h"
#include "storage/cli/program.h"
#include "storage/data_directory.h"
#include "storage/history_coverage.h"
#include "storage/history_types.h"

namespace CLI {
class App;
}

namespace fdi::storage {

// What the verbs of fdi-store have in common.

/// --data.
DataDirectory DataOf(const cli::Context& context);
/// --data, made if it is not there; for verbs that write.
DataDirectory WritableDataOf(const cli::Context& context);

/// {"CV", "P1"}
cli::Json SignalsJson(SignalMask signals);
/// "CV,X,F" in any case. @throws ConfigError naming the signals there are.
SignalMask ParseSignals(std::string_view list);

/// RFC 3339 in UTC, or null.
cli::Json TimeJson(const std::optional<std::int64_t>& stamp_ns);
/// As the user wants times, "-" if there is none.
std::string TimeText(const std::optional<std::int64_t>& stamp_ns,
                     const cli::Context& context);
std::string Hex(std::uint64_t value);  ///< 16 digits

/// "name:  value" lines, aligned.
void PrintFields(
    std::ostream& out,
    const std::vector<std::pair<std::string, std::string>>& fields);

/// Calls `write` with stdout for "-", else with the file `path`, which is
/// there only if all could be written. @throws DataError
void WriteOutput(const std::string& path,
                 const std::function<void(std::ostream&)>& write);

/// The options --since and --until.
struct TimeWindow {
  std::string since;
  std::string until;
  void AddTo(CLI::App& verb);
  /// @throws ConfigError
  std::int64_t since_ns(const cli::Context& context) const;
  std::int64_t until_ns(const cli::Context& context) const;
};

/// {"V1": {"LIVE": 12.5, ...}, ...}: hours by valve and quality.
cli::Json HoursJson(const std::vector<CoverageTime>& coverage);
/// The same as a table; nothing if there are none.
void PrintHours(std::ostream& out, const std::vector<CoverageTime>& coverage);

/// --by, the user's name by default.
std::string UserName();
/// "fdi-store anna@host": where what is typed comes from.
std::string Origin();

}  // namespace fdi::storage
