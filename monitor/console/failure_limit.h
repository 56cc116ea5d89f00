#pragma once

#include <chrono>
#include <map>
#include <string>

namespace fdi::console {

/// Slows down guessing: after five failures in a row an origin gets one attempt
/// per second. Once 256 origins are failing, a new one takes the place of the
/// one that failed longest ago: this is for origins that cost whoever invents
/// them more than a second for each 5 attempts that it wins. Bounded memory;
/// not thread safe.
class FailureLimit {
 public:
  using Clock = std::chrono::steady_clock;

  /// Whether an attempt from `origin` is to be checked.
  bool Allows(const std::string& origin, Clock::time_point now);
  /// Records that a checked attempt failed.
  void Add(const std::string& origin, Clock::time_point now);

 private:
  // Remaining attempts, refilled at one per second.
  struct Allowance {
    double attempts;
    Clock::time_point stamp;
  };
  Allowance& AllowanceOf(const std::string& origin, Clock::time_point now);
  static double Refilled(const Allowance& allowance, Clock::time_point now);
  void MakeRoom(Clock::time_point now);

  std::map<std::string, Allowance> failing_;  // By origin; bounded.
};

}  // namespace fdi::console
