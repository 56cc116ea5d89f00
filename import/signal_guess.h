#pragma once

#include <optional>
#include <string>
#include <vector>

#include "diagnosis/model/sample.h"
#include "import/csv.h"

namespace fdi::importer {

/// A column, or a tag of a long table, and what it seems to be.
struct SniffedColumn {
  std::string name;
  std::string about;  ///< Units and descriptions below the name.
  std::vector<double> times_s{};
  std::vector<double> values{};
  std::size_t cells{0};
  std::size_t missing{0};
  std::vector<std::string> words{};      ///< Neither numbers nor known words.
  std::optional<ColumnMapping> given{};  ///< By the caller's map.
  std::optional<Signal> signal{};
  std::string unit{};
  std::vector<double> raw{};   ///< Cells that are `span`; empty: as they are.
  std::vector<double> span{};  ///< In `unit`.
  bool opening{false};
  std::string guessed{};  ///< Reasons, and what is uncertain.

  /// Quantile of the values, which are not empty; `share` in [0, 1].
  double Quantile(double share) const;
  /// True if most of its cells are numbers or no readings.
  bool HasReadings() const {
    return !values.empty() && 2 * (values.size() + missing) >= cells;
  }
};

/// Gives the columns of a valve their signals, units and senses, by names,
/// units, values and the columns beside them. Adds to `findings` what is
/// missing and what the user has to state.
void GuessSignals(std::vector<SniffedColumn>& columns,
                  std::vector<std::string>& findings);

/// The columns of a loop that its user names; empty: to be found.
struct LoopNames {
  std::string op;
  std::string pv;
  std::string sp;
  std::string x;
  std::string mode;
  bool ignore_x{false};
};

/// Adds the columns of a loop to a map without any: OP as CV, PV as F, SP, X
/// and the mode. PV and SP keep their unit, and OP and X the sense of the file.
/// @throws DataError if OP is not found, or neither PV nor X is, or if several
///   columns look like one of them.
void GuessLoop(const std::vector<SniffedColumn>& columns,
               const LoopNames& asked, const std::string& source,
               ColumnMap& map);

}  // namespace fdi::importer
