#pragma once

#include <chrono>
#include <filesystem>
#include <functional>
#include <stop_token>
#include <string>
#include <string_view>

namespace fdi::plot {

/// Limits on drawing a picture.
struct GnuplotLimits {
  std::chrono::milliseconds time{10'000};
  std::stop_token stop;  ///< Aborts at once.
};

/// True if `gnuplot` is in PATH.
bool HaveGnuplot();

/// Runs gnuplot on the script that `script_for` makes for an output file, and
/// returns what gnuplot wrote to that file. Both files are in a temporary
/// folder, so that no user-supplied file name reaches gnuplot.
/// @throws std::runtime_error if gnuplot is missing, fails, or is killed
///   because it exceeded `limits`.
std::string RunGnuplot(
    const std::function<std::string(const std::filesystem::path& output)>&
        script_for,
    const GnuplotLimits& limits = {});

/// `text` as a gnuplot string constant, on one line.
std::string GnuplotText(std::string_view text);
/// Nine digits; "NaN" for non-finite values.
std::string GnuplotNumber(double value);

}  // namespace fdi::plot
