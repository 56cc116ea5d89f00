#include "planner/work_costs.h"

#include <algorithm>
#include <cmath>

#include "base/time_units.h"
#include "diagnosis/model/leakage.h"
#include "diagnosis/records/growth.h"
#include "report/text_table.h"

namespace fdi::planner {
namespace {

using report::FormatNumber;

constexpr double kHoursOfWeek = 168.0;
constexpr double kDaysOfWeek = 7.0;
// Means of two hours are the fewest that have an interval.
constexpr std::size_t kFewestHours = 2;

std::vector<int> FaultsOf(const std::vector<std::string>& names) {
  std::vector<int> faults;
  for (const std::string& name : names) {
    if (const auto fault = ParseFinding(name)) {
      faults.push_back(*fault);
    }
  }
  return faults;
}

std::vector<int> FaultsOf(const findings::Finding& finding) {
  return FaultsOf(storage::SplitNames(finding.fault.value_or("")));
}

// All that it may be is a leak of one kind.
bool IsLeak(const findings::Finding& finding, Leak leak) {
  std::vector<int> faults = FaultsOf(finding);
  const std::vector<int> others = FaultsOf(finding.look_alikes);
  faults.insert(faults.end(), others.begin(), others.end());
  const bool likely = finding.confirmed ||
                      finding.certainty == Certainty::kSure ||
                      finding.certainty == Certainty::kLikely;
  return (likely || faults.size() > 1) &&
         std::ranges::all_of(
             faults, [leak](int fault) { return LeakOf(fault) == leak; });
}

// The ends of the interval of |strength|, which may hold both signs.
Range SizeOf(const StrengthPoint& point) {
  const double low = std::abs(point.lowest);
  const double high = std::abs(point.highest);
  const bool both_signs = point.lowest < 0.0 && point.highest > 0.0;
  return {std::abs(point.strength), both_signs ? 0.0 : std::min(low, high),
          std::max(low, high)};
}

// Sums of F over bins of CV, in its unit.
struct FlowSums {
  double samples{0.0};
  double residual{0.0};
  double expected{0.0};
};

FlowSums FlowOf(const HealthHour& hour, std::size_t first_bin) {
  FlowSums sums;
  for (std::size_t b = first_bin; b < hour.bins.size(); ++b) {
    for (std::size_t c = 0; c < hour.bins[b].size(); ++c) {
      if (hour.channels[c].output == Signal::kF) {
        const ResidualSums& bin = hour.bins[b][c];
        const double quantum = hour.channels[c].quantum();
        sums.samples += static_cast<double>(bin.samples);
        sums.residual += quantum * static_cast<double>(bin.residual);
        sums.expected +=
            quantum * static_cast<double>(bin.output - bin.residual);
      }
    }
  }
  return sums;
}

std::optional<Range> LossOutside(const Range& strength,
                                 const std::vector<HealthHour>& hours) {
  FlowSums all;
  for (const HealthHour& hour : hours) {
    const FlowSums sums = FlowOf(hour, 0);
    all.samples += sums.samples;
    all.expected += sums.expected;
  }
  if (all.samples == 0.0 || all.expected <= 0.0) {
    return std::nullopt;
  }
  const double full = kExternalLeakShare * all.expected / all.samples;
  return Range{full * strength.value, full * strength.lowest,
               full * strength.highest};
}

std::optional<Range> LossThrough(const std::vector<HealthHour>& hours) {
  std::vector<double> means;
  FlowSums all;
  double seen_ms = 0.0;
  double shut_ms = 0.0;
  for (const HealthHour& hour : hours) {
    seen_ms += static_cast<double>(hour.seen_ms);
    shut_ms += static_cast<double>(hour.shut_ms);
    const FlowSums sums = FlowOf(hour, kCommandBins - 1);
    if (sums.samples > 0.0 && hour.shut_ms > 0) {
      means.push_back(sums.residual / sums.samples);
      all.samples += sums.samples;
      all.residual += sums.residual;
    }
  }
  if (means.size() < kFewestHours || all.residual <= 0.0) {
    return std::nullopt;
  }
  std::ranges::sort(means);
  const double share = shut_ms / seen_ms;
  const double mean = all.residual / all.samples;
  const std::size_t outside = means.size() / 20;  // 5 % at either end.
  // Hours differ in samples, so the mean may be beyond the percentiles.
  const double lowest = std::clamp(means[outside], 0.0, mean);
  const double highest = std::max(means[means.size() - 1 - outside], mean);
  return Range{share * mean, share * lowest, share * highest};
}

// Three digits or more, as "0.0310" and "1240"; an interval says no more.
std::string Digits(double value) {
  const double size = std::abs(value);
  const int whole =
      size > 0.0 ? static_cast<int>(std::floor(std::log10(size))) : 0;
  return FormatNumber(value, std::clamp(2 - whole, 0, 6));
}

std::string RangeText(const Range& range, const std::string& unit) {
  return Digits(range.value) + " " + unit + " (" + Digits(range.lowest) + ".." +
         Digits(range.highest) + ")";
}

std::string WaitingText(const Waiting& waiting, Leak leak, bool sure) {
  const ValveCosts& costs = waiting.costs;
  const std::string unit(FlowUnitName(waiting.unit));
  const Range week = waiting.week();
  std::string text =
      std::string(sure                     ? ""
                  : leak == Leak::kOutside ? "if it leaks outside, "
                                           : "if it leaks through, ") +
      "waiting a week costs " + RangeText(week, costs.currency) + ": " +
      RangeText(waiting.loss, unit) +
      (leak == Leak::kOutside ? " leak out"
                              : " pass the shut valve, on average") +
      " at " + Digits(*costs.medium) + " " + costs.currency + "/" +
      unit.substr(0, unit.find('/'));
  if (costs.visit && week.value > 0.0) {
    text += "; a visit (" + Digits(*costs.visit) + " " + costs.currency +
            ") is paid for in " +
            Digits(kDaysOfWeek * *costs.visit / week.value) + " days";
  }
  return text;
}

std::string PercentText(double share) {
  return FormatNumber(100.0 * share, 0);
}

}  // namespace

Range Waiting::week() const {
  const double price = kHoursOfWeek * costs.medium.value_or(0.0);
  return {price * loss.value, price * loss.lowest, price * loss.highest};
}

std::optional<Waiting> WaitingOf(const findings::Finding& finding,
                                 const std::vector<StrengthPoint>& strengths,
                                 const std::vector<HealthHour>& all) {
  const std::vector<int> faults = FaultsOf(finding);
  const auto leaking = std::ranges::find_if(
      faults, [](int fault) { return LeakOf(fault) != Leak::kNone; });
  Waiting waiting;
  waiting.costs = ParseCosts(finding.about.costs);
  if (leaking == faults.end() || !waiting.costs.medium || all.empty()) {
    return std::nullopt;
  }
  std::vector<HealthHour> hours = all;
  std::erase_if(hours, [&last = all.back()](const HealthHour& hour) {
    return static_cast<double>(last.hour - hour.hour) >= kHoursOfWeek ||
           hour.flow_unit != last.flow_unit;
  });
  const Leak leak = LeakOf(*leaking);
  std::optional<Range> loss;
  if (leak == Leak::kThrough) {
    loss = LossThrough(hours);
  } else if (const auto growth = GrowthOf(strengths, *leaking)) {
    loss = LossOutside(SizeOf(growth->last), hours);
  }
  if (!loss) {
    return std::nullopt;
  }
  waiting.unit = hours.back().flow_unit;
  if (waiting.unit != waiting.costs.flow) {
    waiting.text = "what waiting costs is not known: F is in " +
                   std::string(FlowUnitName(waiting.unit)) +
                   ", the price of the medium is not";
    return waiting;
  }
  waiting.loss = *loss;
  waiting.text = WaitingText(waiting, leak, IsLeak(finding, leak));
  return waiting;
}

StopAnswer SafeUntil(const findings::Finding& finding,
                     const std::vector<StrengthPoint>& strengths,
                     const report::FaultTexts& texts, std::int64_t stop_ns) {
  const Severity now = finding.words.severity;
  if (now == Severity::kCritical) {
    return {"no", "it is critical now"};
  }
  const std::vector<int> faults = FaultsOf(finding);
  if (faults.empty()) {
    return {"not known", "it has no name"};
  }
  StopAnswer answer;
  bool graver = false;  // Somewhere in the interval.
  bool no_graver = false;
  for (const int fault : faults) {
    const auto growth = GrowthOf(strengths, fault);
    if (!growth || !growth->rate) {
      return {"not known", "too few strengths of it are stored"};
    }
    const double days =
        static_cast<double>(stop_ns - growth->last.stamp_ns) / kNsPerDay;
    const Range size = SizeOf(growth->last);
    const double low =
        std::clamp(size.lowest + days * growth->rate->lowest, 0.0, 1.0);
    const double high =
        std::clamp(size.highest + days * growth->rate->highest, 0.0, 1.0);
    const SeverityBands& bands = texts.Of(fault).bands;
    graver = graver || SeverityAt(bands, high) > now;
    no_graver = no_graver || SeverityAt(bands, low) <= now;
    answer.text += (answer.text.empty() ? "" : "; ") +
                   (faults.size() > 1 ? FaultName(fault) + ": " : "") +
                   "strength " + PercentText(low) + ".." + PercentText(high) +
                   " % by then";
    for (const SeverityBand& band : bands) {
      if (band.level > now) {
        answer.text += ", " + std::string(SeverityName(band.level)) + " from " +
                       PercentText(band.from) + " %";
        break;
      }
    }
    answer.safe = !graver ? "yes" : no_graver ? "perhaps" : "no";
  }
  return answer;
}

StopAnswer SafeUntil(const HealthForecast& forecast, std::int64_t stop_ns) {
  using Answer = HealthForecast::Answer;
  const std::string why = ForecastText(forecast);
  if (forecast.answer == Answer::kReached) {
    return {"no", why};
  }
  if (!forecast.time) {
    return {"not known", why};
  }
  const double days =
      static_cast<double>(stop_ns) / kNsPerDay - forecast.last_day;
  return {forecast.time->lower > days   ? "yes"
          : forecast.time->upper < days ? "no"
                                        : "perhaps",
          why};
}

}  // namespace fdi::planner
