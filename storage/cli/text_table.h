#pragma once

#include <ostream>
#include <string>
#include <vector>

namespace fdi::cli {

enum class Align { kLeft, kRight };

/// Columns aligned for a terminal: a heading with units, then the rows.
class TextTable {
 public:
  struct Column {
    std::string heading;  ///< With its unit: "MSE [%^2]".
    Align align{Align::kLeft};
  };

  explicit TextTable(std::vector<Column> columns);
  /// @throws std::invalid_argument unless there is one cell per column.
  void AddRow(std::vector<std::string> cells);
  void Print(std::ostream& out) const;
  bool empty() const { return rows_.empty(); }

 private:
  std::vector<Column> columns_;
  std::vector<std::vector<std::string>> rows_;
};

/// `value` with `decimals`, "-" where it is not finite.
std::string FormatNumber(double value, int decimals);

}  // namespace fdi::cli
