#pragma once

#include <cstddef>

namespace fdi::report {

/// Style of text for its destination.
struct TextStyle {
  bool colour{false};
  std::size_t width{0};  ///< Available columns; 0: unlimited.
};

/// Style for standard output: coloured if it is a terminal that is not `dumb`
/// and NO_COLOR is not set (no-color.org), as wide as COLUMNS, if set, or the
/// terminal; plain and unlimited if it is not a terminal.
TextStyle StdoutStyle();

}  // namespace fdi::report
