#include "diagnosis/decision/alarm_budget.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <numeric>
#include <span>

#include "base/error.h"

namespace fdi {
namespace {

// Chosen in a trial on 1008 healthy hours of three simulated valves, and scored
// on others (docs/results/budget.md).
constexpr double kTailShare = 0.2;  // of the hours
constexpr int kLeastDays = 3;
constexpr double kLeastHours = 72.0;
constexpr std::size_t kLeastOthers = 2;
constexpr double kLeastOfOthers = 500.0;  // [h]
constexpr double kReach = 10.0;           // times the pooled hours
constexpr double kUnlikely = 0.05;

double HoursOf(const HealthyHours& valve) {
  return static_cast<double>(valve.hours.size());
}

bool IsKnown(const HealthyHours& valve) {
  return HoursOf(valve) >= kLeastHours && valve.days >= kLeastDays;
}

// Hours above a level whose next hour is known, and among these the ones
// that it followed likewise. An episode that nobody calls a fault was above it
// in each of its hours.
struct Runs {
  double hours{0.0};
  double followed{0.0};

  void Add(const HealthyHours& valve, double level) {
    std::map<std::int64_t, bool> above;
    for (const HealthyHours::Hour& each : valve.hours) {
      above[each.hour] |= each.share > level;
      for (int i = 1; i <= each.lasted; ++i) {
        above[each.hour + i] = true;
      }
    }
    for (const auto& [hour, is_above] : above) {
      const auto next = above.find(hour + 1);
      if (is_above && next != above.end()) {
        hours += 1.0;
        followed += next->second ? 1.0 : 0.0;
      }
    }
  }
};

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
  Runs runs;
  int others = 0;
  double others_lasted = 0.0;
  for (const HealthyHours& valve : valves) {
    if (!IsKnown(valve)) {
      continue;
    }
    std::vector<HealthyHours::Hour> each = valve.hours;
    std::ranges::sort(each, {}, &HealthyHours::Hour::share);
    const auto above = static_cast<std::size_t>(
        std::ceil((1.0 - kTailShare) * static_cast<double>(each.size())));
    const double level = each[above - 1].share;
    const std::span highest = std::span(each).subspan(above);
    double sum = 0.0;
    double known_shares = 0.0;
    for (const HealthyHours::Hour& hour : highest) {
      sum += hour.share - level;
      known_shares += hour.at_least ? 0.0 : 1.0;
    }
    const double mean = sum / known_shares;
    if (!(mean > 0.0) || !std::isfinite(mean)) {
      continue;  // All its highest hours are the same, or unjudged.
    }
    for (const HealthyHours::Hour& hour : highest) {
      excesses.push_back((hour.share - level) / mean +
                         (hour.at_least ? 1.0 : 0.0));
    }
    known[valve.valve_id] = {level, mean, valve.model_hash, valve.epoch};
    hours[valve.valve_id] = HoursOf(valve);
    pooled_hours_ += HoursOf(valve);
    runs.Add(valve, level);
    others += valve.others;
    others_lasted += valve.others_lasted;
  }
  if (excesses.empty()) {
    return;
  }
  std::ranges::sort(excesses);
  tail_ = FitPareto(excesses, 0.0);
  goes_on_ = ProbabilityBound(runs.followed, runs.hours);
  other_hours_ = pooled_hours_ / PoissonBound(others);
  longest_other_hours_ = pooled_hours_ / PoissonBound(0);
  other_goes_on_ = ProbabilityBound(others_lasted, others + others_lasted);
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

double ShareTails::LongestHours(double share) const {
  return share > 1.0 ? longest_hours() : longest_other_hours_;
}

bool ShareTails::Covers(std::string_view valve_id, std::uint64_t model_hash,
                        std::uint32_t epoch) const {
  const auto found = places_.find(valve_id);
  return found != places_.end() && found->second.model_hash == model_hash &&
         found->second.epoch == epoch;
}

std::optional<double> ShareTails::ReturnHours(std::string_view valve_id,
                                              double share, int lasted) const {
  const auto found = places_.find(valve_id);
  if (found == places_.end()) {
    return std::nullopt;
  }
  double rate = 0.0;
  if (share <= 1.0) {
    rate = std::pow(other_goes_on_, lasted) / other_hours_;
  } else {
    const double y =
        std::max(share - found->second.level, 0.0) / found->second.scale;
    rate = kTailShare * tail_.Beyond(y) * std::pow(goes_on_, lasted);
  }
  const double longest = LongestHours(share);
  return rate * longest > 1.0 ? 1.0 / rate : longest;
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

AlarmBudget::Weight AlarmBudget::Weigh(std::string_view valve_id, double share,
                                       int lasted) const {
  Weight weight;
  weight.return_hours = tails_.ReturnHours(valve_id, share, lasted);
  weight.notice = weight.return_hours &&
                  *weight.return_hours < std::min(promise_.needed_hours,
                                                  tails_.LongestHours(share));
  return weight;
}

std::string PromiseText(const AlarmBudget::Promise& promise) {
  const auto whole = [](double hours) {
    return std::to_string(std::llround(std::ceil(hours)));
  };
  if (!promise.wait_hours) {
    return "no: it takes three valves or more";
  }
  return *promise.wait_hours == 0.0
             ? "yes"
             : "not yet: about " + whole(*promise.wait_hours) +
                   " more hours of operation";
}

}  // namespace fdi
