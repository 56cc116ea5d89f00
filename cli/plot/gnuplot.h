#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <string_view>

namespace fdi::plot {

/// True if `gnuplot` is in PATH.
bool HaveGnuplot();

/// Runs gnuplot, as a program, on the script that `script_for` makes for an
/// output file, and returns what gnuplot wrote to that file. Both files are in
/// a scratch folder, so that no name of a user's file reaches gnuplot.
/// @throws std::runtime_error if gnuplot is missing or fails.
std::string RunGnuplot(
    const std::function<std::string(const std::filesystem::path& output)>&
        script_for);

/// `text` as a string constant of gnuplot, on one line.
std::string GnuplotText(std::string_view text);
/// Nine digits; "NaN" for what is not finite.
std::string GnuplotNumber(double value);

}  // namespace fdi::plot
