#include "report/progress.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

#include <unistd.h>

#include "base/time_text.h"

namespace fdi::report {
namespace {

constexpr int kBarWidth = 30;
// Before that an estimate of the time left jumps about.
constexpr auto kFirstEstimate = std::chrono::seconds(5);
// Frequent enough to look alive, and cheap compared to the work.
constexpr auto kRedraw = std::chrono::milliseconds(100);

// "about 3 min left, ", from the time that the work so far has taken.
std::string TimeLeft(std::chrono::steady_clock::duration elapsed,
                     double fraction) {
  if (elapsed < kFirstEstimate || fraction < 0.01 || fraction >= 1.0) {
    return {};
  }
  const double left_s = std::chrono::duration<double>(elapsed).count() *
                        (1.0 - fraction) / fraction;
  return "about " +
         FormatDuration(static_cast<std::int64_t>(std::ceil(left_s)) *
                        1'000'000'000) +
         " left, ";
}

}  // namespace

Progress::Progress(std::string title)
    : title_(std::move(title)),
      terminal_(isatty(STDERR_FILENO) == 1),
      start_(std::chrono::steady_clock::now()),
      last_draw_(start_ - kRedraw) {}

Progress::~Progress() {
  if (line_open_) {
    std::fputc('\n', stderr);
  }
}

void Progress::Update(double fraction, const std::string& note) {
  if (finished_) {
    return;
  }
  const double share =
      std::isfinite(fraction) ? std::clamp(fraction, 0.0, 1.0) : 0.0;
  if (terminal_) {
    const auto now = std::chrono::steady_clock::now();
    if (now - last_draw_ >= kRedraw) {
      last_draw_ = now;
      Draw(share, TimeLeft(now - start_, share) + note);
    }
    return;
  }
  // In a log file: ten lines instead of a redrawn bar.
  const int step = static_cast<int>(share * 10.0);
  if (step > last_step_) {
    last_step_ = step;
    std::fprintf(stderr, "%s: %3.0f %% %s\n", title_.c_str(), share * 100.0,
                 note.c_str());
  }
}

void Progress::Finish(const std::string& note) {
  if (finished_) {
    return;
  }
  finished_ = true;
  const auto elapsed = std::chrono::duration_cast<std::chrono::milliseconds>(
      std::chrono::steady_clock::now() - start_);
  const std::string took =
      FormatDuration(static_cast<std::int64_t>(elapsed.count()) * 1'000'000);
  if (terminal_) {
    Draw(1.0, note);
  }
  std::fprintf(stderr, "%s%s: done in %s\n", line_open_ ? "\n" : "",
               title_.c_str(), took.c_str());
  line_open_ = false;
}

void Progress::Draw(double fraction, const std::string& note) {
  const int filled = static_cast<int>(fraction * kBarWidth);
  std::string bar(static_cast<std::size_t>(filled), '#');
  bar.resize(kBarWidth, '.');
  // \r returns to the start of the line, \033[K erases the rest of a longer
  // note.
  std::fprintf(stderr, "\r%s [%s] %3.0f %% %s\033[K", title_.c_str(),
               bar.c_str(), fraction * 100.0, note.c_str());
  std::fflush(stderr);
  line_open_ = true;
}

}  // namespace fdi::report
