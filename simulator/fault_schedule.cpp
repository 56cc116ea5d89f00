#include "simulator/fault_schedule.h"

#include <cmath>

#include "base/csv_cells.h"
#include "base/error.h"
#include "base/text.h"
#include "diagnosis/model/fault_catalogue.h"
#include "simulator/require_range.h"

// The text of a schedule, which ToText() writes and ParseFaultSchedule() reads:
//
//     schedule  = fault ":" profile *(":" option)
//     profile   = "abrupt@" start / "flatline@" start
//               / "incipient@" start "+" duration
//     option    = "strength=" number / "from=" number / "until=" time
//
// Times are in s from the start of the run. `from` is for incipient faults
// only, and a flatline, which holds a reading, has no strength.
namespace fdi::simulator {
namespace {

[[noreturn]] void Refuse(std::string_view text, const std::string& reason) {
  throw ConfigError("fault '" + std::string(text) + "': " + reason +
                    "; expected " + std::string(kFaultForms));
}

double ReadNumber(std::string_view text, std::string_view part,
                  const char* name) {
  const auto value = ParseWhole<double>(part);
  if (!value || !std::isfinite(*value)) {
    Refuse(text,
           std::string(name) + " '" + std::string(part) + "' is not a number");
  }
  return *value;
}

// Splits `rest` at the next `separator`; returns the part before it.
std::string_view CutAt(std::string_view& rest, char separator) {
  const std::size_t at = rest.find(separator);
  const std::string_view part = rest.substr(0, at);
  rest =
      at == std::string_view::npos ? std::string_view{} : rest.substr(at + 1);
  return part;
}

void ReadTimes(std::string_view text, std::string_view profile,
               FaultSchedule& schedule) {
  std::string_view times = profile;
  const std::string_view kind = CutAt(times, '@');
  if (kind != "abrupt" && kind != "incipient" && kind != "flatline") {
    Refuse(text, "profile '" + std::string(kind) +
                     "' is neither abrupt, incipient nor flatline");
  }
  schedule.flatline = kind == "flatline";
  if (times.empty()) {
    Refuse(text, "the start time after '@' is missing");
  }
  const bool has_duration = times.find('+') != std::string_view::npos;
  if (has_duration != (kind == "incipient")) {
    Refuse(text, kind == "incipient"
                     ? "the duration after '+' is missing"
                     : "only an incipient fault takes a duration");
  }
  schedule.start_s = ReadNumber(text, CutAt(times, '+'), "start");
  if (has_duration) {
    schedule.development_s = ReadNumber(text, times, "duration");
    if (!(schedule.development_s > 0.0)) {
      Refuse(text, "the duration must be above 0");
    }
  }
}

void ReadOption(std::string_view text, std::string_view option,
                FaultSchedule& schedule) {
  std::string_view value = option;
  const std::string_view key = CutAt(value, '=');
  if (key == "strength" && !schedule.flatline) {
    schedule.final_strength = ReadNumber(text, value, "strength");
  } else if (key == "from" && schedule.development_s > 0.0) {
    schedule.initial_strength = ReadNumber(text, value, "from");
  } else if (key == "until") {
    schedule.end_s = ReadNumber(text, value, "until");
  } else if (key == "from") {
    Refuse(text, "'from' belongs to incipient faults");
  } else if (key == "strength") {
    Refuse(text, "a flatline has no strength");
  } else {
    Refuse(text, "unknown option '" + std::string(key) + "'");
  }
}

}  // namespace

FaultSchedule ParseFaultSchedule(std::string_view text) {
  FaultSchedule schedule;
  std::string_view rest = text;
  const std::string_view name = CutAt(rest, ':');
  if (name.find('@') != std::string_view::npos) {
    Refuse(text, "the profile is missing before '@'");
  }
  schedule.fault = RequireFault(name);
  if (rest.empty()) {
    Refuse(text, "the profile is missing");
  }
  ReadTimes(text, CutAt(rest, ':'), schedule);
  while (!rest.empty()) {
    ReadOption(text, CutAt(rest, ':'), schedule);
  }
  if (schedule.development_s == 0.0) {
    schedule.initial_strength = schedule.final_strength;
  }
  try {
    Validate(schedule);
  } catch (const ConfigError& error) {
    Refuse(text, error.what());
  }
  return schedule;
}

std::string ToText(const FaultSchedule& schedule) {
  std::string text = FaultName(schedule.fault);
  if (schedule.flatline) {
    text += ":flatline@" + NumberText(schedule.start_s);
  } else if (schedule.development_s > 0.0) {
    text += ":incipient@" + NumberText(schedule.start_s) + '+' +
            NumberText(schedule.development_s) +
            ":from=" + NumberText(schedule.initial_strength);
  } else {
    text += ":abrupt@" + NumberText(schedule.start_s);
  }
  if (!schedule.flatline) {
    text += ":strength=" + NumberText(schedule.final_strength);
  }
  if (std::isfinite(schedule.end_s)) {
    text += ":until=" + NumberText(schedule.end_s);
  }
  return text;
}

void Validate(const FaultSchedule& schedule) {
  constexpr double kForever = 1e10;
  RequireRange("fault number", schedule.fault, 1, kLastFault);
  const double least = FaultFactsOf(schedule.fault).is_signed ? -1.0 : 0.0;
  const std::string name = FaultName(schedule.fault);
  RequireRange("start of " + name + " [s]", schedule.start_s, 0.0, kForever);
  RequireRange("development of " + name + " [s]", schedule.development_s, 0.0,
               kForever);
  RequireRange("strength of " + name, schedule.final_strength, least, 1.0);
  RequireRange("initial strength of " + name, schedule.initial_strength, least,
               1.0);
  if (!(schedule.end_s > schedule.start_s)) {
    throw ConfigError("end of " + name + " is not after its start");
  }
  if (schedule.flatline && !TransmitterOf(schedule.fault)) {
    throw ConfigError(name + " has no reading that could stay: a flatline is " +
                      "of t1, p1 or p2");
  }
}

double StrengthAt(const FaultSchedule& schedule, double time_s) {
  if (time_s < schedule.start_s || time_s >= schedule.end_s) {
    return 0.0;
  }
  const double elapsed = time_s - schedule.start_s;
  if (elapsed >= schedule.development_s) {
    return schedule.final_strength;
  }
  return schedule.initial_strength +
         (schedule.final_strength - schedule.initial_strength) * elapsed /
             schedule.development_s;
}

// A sample has room for one fault as its truth. Where several act at once, that
// is the first of the list, while EffectsAt() combines them all.
FaultTruth TruthAt(const std::vector<FaultSchedule>& schedules, double time_s) {
  for (const FaultSchedule& schedule : schedules) {
    const double strength = StrengthAt(schedule, time_s);
    if (strength != 0.0) {
      return {schedule.fault, strength};
    }
  }
  return {};
}

FaultEffects EffectsAt(const std::vector<FaultSchedule>& schedules,
                       double time_s) {
  FaultEffects effects;
  for (const FaultSchedule& schedule : schedules) {
    if (!schedule.flatline) {
      ApplyFault(schedule.fault, StrengthAt(schedule, time_s), effects);
    }
  }
  return effects;
}

}  // namespace fdi::simulator
