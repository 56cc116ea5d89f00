#pragma once

#include <cstddef>

namespace fdi::cli {

/// How text is to look where it goes.
struct TextStyle {
  bool colour{false};
  std::size_t width{0};  ///< Columns that fit; 0: any number.
};

/// Of standard output: coloured if it is a terminal that is not `dumb` and
/// NO_COLOR is not set (no-color.org), as wide as the terminal or, if set,
/// COLUMNS; plain and of any width if it is none.
TextStyle StdoutStyle();

}  // namespace fdi::cli
