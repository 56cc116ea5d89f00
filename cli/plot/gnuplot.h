#pragma once

#include <chrono>
#include <filesystem>
#include <functional>
#include <stop_token>
#include <string>
#include <string_view>

namespace fdi::plot {

/// How long a picture may take.
struct GnuplotLimits {
  std::chrono::milliseconds time{10'000};
  std::stop_token stop;  ///< Ends it at once.
};

/// True if `gnuplot` is in PATH.
bool HaveGnuplot();

/// Runs gnuplot, as a program, on the script that `script_for` makes for an
/// output file, and returns what gnuplot wrote to that file. Both files are in
/// a scratch folder, so that no name of a user's file reaches gnuplot.
/// @throws std::runtime_error if gnuplot is missing, fails, or was killed
///   because it took longer than `limits` allow.
std::string RunGnuplot(
    const std::function<std::string(const std::filesystem::path& output)>&
        script_for,
    const GnuplotLimits& limits = {});

/// `text` as a string constant of gnuplot, on one line.
std::string GnuplotText(std::string_view text);
/// Nine digits; "NaN" for what is not finite.
std::string GnuplotNumber(double value);

}  // namespace fdi::plot
