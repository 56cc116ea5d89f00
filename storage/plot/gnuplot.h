#pragma once

#include <filesystem>
#include <string>

namespace fdi::storage {

/// True if `gnuplot` is in PATH.
bool HaveGnuplot();

/// Runs gnuplot, as a program, on `script`.
/// @throws std::runtime_error if gnuplot is missing or fails.
void RunGnuplot(const std::string& script);

/// `text` in single quotes, on one line.
std::string GnuplotText(const std::string& text);
/// Nine digits; "NaN" for what is not finite.
std::string GnuplotNumber(double value);

}  // namespace fdi::storage
