#include "diagnosis/decision/alarm_budget.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <numeric>

#include "base/error.h"

namespace fdi {
namespace {

constexpr double kTailShare = 0.2;  // of the hours
constexpr int kLeastDays = 3;
constexpr double kLeastHours = 72.0;
constexpr std::size_t kLeastOthers = 2;
constexpr double kLeastOfOthers = 500.0;  // [h]
constexpr double kReach = 10.0;           // times the pooled hours
constexpr double kUnlikely = 0.05;

double HoursOf(const HealthyHours& valve) {
  return static_cast<double>(valve.shares.size());
}

bool IsKnown(const HealthyHours& valve) {
  return HoursOf(valve) >= kLeastHours && valve.days >= kLeastDays;
}

// Hours of operation of all valves until a return period is supported.
std::optional<double> WaitFor(double needed_hours, const ShareTails& tails,
                              const std::vector<HealthyHours>& valves) {
  if (tails.longest_hours() >= needed_hours) {
    return 0.0;
  }
  if (valves.size() <= kLeastOthers) {
    return std::nullopt;
  }
  std::vector<double> hours;
  std::ranges::transform(valves, std::back_inserter(hours), HoursOf);
  std::ranges::sort(hours, std::greater{});
  const double all = std::accumulate(hours.begin(), hours.end(), 0.0);
  const auto n = static_cast<double>(hours.size());
  const double others = kLeastOfOthers * n / (n - 1.0);
  // As many hours for all valves as for each: an hour of operation is n.
  return std::max({kLeastHours - hours[kLeastOthers],
                   (std::max(needed_hours / kReach, others) - all) / n, 1.0});
}

}  // namespace

ShareTails::ShareTails(const std::vector<HealthyHours>& valves) {
  std::map<std::string, Place, std::less<>> known;
  std::map<std::string, double> hours;
  std::vector<double> excesses;
  int others = 0;
  for (const HealthyHours& valve : valves) {
    if (!IsKnown(valve)) {
      continue;
    }
    std::vector<double> shares = valve.shares;
    std::ranges::sort(shares);
    const auto above = static_cast<std::size_t>(
        std::ceil((1.0 - kTailShare) * static_cast<double>(shares.size())));
    const double level = shares[above - 1];
    double mean = 0.0;
    for (std::size_t i = above; i < shares.size(); ++i) {
      mean += (shares[i] - level) / static_cast<double>(shares.size() - above);
    }
    if (!(mean > 0.0)) {
      continue;  // All its highest hours are the same.
    }
    for (std::size_t i = above; i < shares.size(); ++i) {
      excesses.push_back((shares[i] - level) / mean);
    }
    known[valve.valve_id] = {level, mean};
    hours[valve.valve_id] = HoursOf(valve);
    pooled_hours_ += HoursOf(valve);
    others += valve.others;
  }
  if (excesses.empty()) {
    return;
  }
  std::ranges::sort(excesses);
  tail_ = FitPareto(excesses, 0.0);
  other_hours_ = pooled_hours_ / PoissonBound(others);
  for (const auto& [valve_id, place] : known) {
    if (known.size() > kLeastOthers &&
        pooled_hours_ - hours[valve_id] >= kLeastOfOthers) {
      places_[valve_id] = place;
    }
  }
}

double ShareTails::longest_hours() const {
  return places_.empty() ? 0.0 : kReach * pooled_hours_;
}

std::optional<double> ShareTails::ReturnHours(std::string_view valve_id,
                                              double share) const {
  const auto found = places_.find(valve_id);
  if (found == places_.end()) {
    return std::nullopt;
  }
  if (share <= 1.0) {
    return other_hours_;
  }
  const double y =
      std::max(share - found->second.level, 0.0) / found->second.scale;
  const double rate = kTailShare * tail_.Beyond(y);
  return rate * longest_hours() > 1.0 ? 1.0 / rate : longest_hours();
}

double ParseAlarmBudget(const std::string& text) {
  constexpr std::pair<std::string_view, double> kPeriods[] = {
      {"day", 24.0}, {"week", 168.0}, {"month", 730.5}, {"year", 8766.0}};
  const std::size_t slash = text.find('/');
  double alarms = 0.0;
  const char* const end = text.data() + std::min(slash, text.size());
  const auto [rest, error] = std::from_chars(text.data(), end, alarms);
  if (slash != std::string::npos && error == std::errc{} && rest == end &&
      alarms > 0.0 && std::isfinite(alarms)) {
    for (const auto& [name, hours] : kPeriods) {
      if (text.substr(slash + 1) == name) {
        return hours / alarms;
      }
    }
  }
  throw ConfigError("'" + text +
                    "' is no budget of alarms: expected NUMBER/day, "
                    "NUMBER/week, NUMBER/month or NUMBER/year");
}

AlarmBudget::AlarmBudget(double between_hours,
                         const std::vector<HealthyHours>& valves)
    : tails_(valves) {
  const auto count = static_cast<double>(valves.size());
  promise_.needed_hours = between_hours * std::max(count, 1.0);
  promise_.longest_hours = tails_.longest_hours();
  promise_.wait_hours = WaitFor(promise_.needed_hours, tails_, valves);
  promise_.ready = tails_.valves();
  promise_.valves = valves.size();
  for (const HealthyHours& valve : valves) {
    const double share = HoursOf(valve) / promise_.needed_hours;
    if (valve.alarms > 0 && share > 0.0 &&
        PoissonAtLeast(valve.alarms, share) < kUnlikely) {
      spenders_.push_back({valve.valve_id, valve.alarms, share});
    }
  }
}

AlarmBudget::Weight AlarmBudget::Weigh(std::string_view valve_id,
                                       double share) const {
  Weight weight;
  weight.return_hours = tails_.ReturnHours(valve_id, share);
  weight.notice = weight.return_hours &&
                  *weight.return_hours <
                      std::min(promise_.needed_hours, promise_.longest_hours);
  return weight;
}

std::string PromiseText(const AlarmBudget::Promise& promise) {
  const auto whole = [](double hours) {
    return std::to_string(std::llround(std::ceil(hours)));
  };
  if (!promise.wait_hours) {
    return "no: tails take three valves or more";
  }
  return *promise.wait_hours == 0.0
             ? "yes"
             : "not yet: about " + whole(*promise.wait_hours) +
                   " h of operation more";
}

}  // namespace fdi
