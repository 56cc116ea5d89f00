#include "simulator/app/speed.h"

#include <charconv>
#include <string>

#include "diagnosis/error.h"

namespace fdi::simulator {

Speed ParseSpeed(std::string_view text) {
  if (text == "max") {
    return {std::numeric_limits<double>::infinity()};
  }
  constexpr double kSlowest = 1e-3;
  constexpr double kFastest = 1e6;
  Speed speed;
  const auto [end, error] =
      std::from_chars(text.data(), text.data() + text.size(), speed.factor);
  if (error != std::errc{} || end != text.data() + text.size() ||
      !(speed.factor >= kSlowest && speed.factor <= kFastest)) {
    throw ConfigError("speed '" + std::string(text) +
                      "': expected a number in 0.001..1000000 (1 is real "
                      "time) or max");
  }
  return speed;
}

bool Pacer::WaitUntilDue(std::int64_t stamp_ns) {
  using std::chrono::duration_cast;
  using std::chrono::milliseconds;
  using std::chrono::steady_clock;
  if (!first_stamp_ns_) {
    first_stamp_ns_ = stamp_ns;
    start_ = steady_clock::now();
  }
  while (!signals_.stop_requested()) {
    if (speed_.IsMax()) {
      return true;
    }
    const std::chrono::duration<double, std::nano> offset(
        static_cast<double>(stamp_ns - *first_stamp_ns_) / speed_.factor);
    const auto left = offset - (steady_clock::now() - start_);
    if (left.count() <= 0.0) {
      return true;
    }
    constexpr milliseconds kLongestWait(60'000);
    signals_.WaitFor(std::min(
        kLongestWait, duration_cast<milliseconds>(left) + milliseconds(1)));
  }
  return false;
}

}  // namespace fdi::simulator
