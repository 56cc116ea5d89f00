#include "monitor/console/failure_limit.h"

#include <algorithm>
#include <cstddef>

namespace fdi::console {
namespace {

constexpr double kAttempts = 5.0;
constexpr std::size_t kMaxOrigins = 256;

}  // namespace

bool FailureLimit::Allows(const std::string& origin, Clock::time_point now) {
  return !failing_.contains(origin) || AllowanceOf(origin, now).attempts >= 1.0;
}

void FailureLimit::Add(const std::string& origin, Clock::time_point now) {
  AllowanceOf(origin, now).attempts -= 1.0;
}

double FailureLimit::Refilled(const Allowance& allowance,
                              Clock::time_point now) {
  const std::chrono::duration<double> passed = now - allowance.stamp;
  return std::min(allowance.attempts + passed.count(), kAttempts);
}

void FailureLimit::MakeRoom(Clock::time_point now) {
  std::erase_if(failing_, [now](const auto& entry) {
    return Refilled(entry.second, now) >= kAttempts;
  });
  if (failing_.size() >= kMaxOrigins) {
    failing_.erase(std::min_element(failing_.begin(), failing_.end(),
                                    [](const auto& a, const auto& b) {
                                      return a.second.stamp < b.second.stamp;
                                    }));
  }
}

FailureLimit::Allowance& FailureLimit::AllowanceOf(const std::string& origin,
                                                   Clock::time_point now) {
  if (failing_.size() >= kMaxOrigins && !failing_.contains(origin)) {
    MakeRoom(now);
  }
  Allowance& allowance =
      failing_.try_emplace(origin, Allowance{kAttempts, now}).first->second;
  allowance = {Refilled(allowance, now), now};
  return allowance;
}

}  // namespace fdi::console
