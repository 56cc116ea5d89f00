#include "diagnosis/model/sample.h"

#include <limits>

#include "base/csv_cells.h"

namespace fdi {
namespace {

struct SignalFacts {
  std::string_view name;
  std::string_view unit;
  SignalRange range;
};

// Ranges are twice the usual transmitter span of a feedwater valve, so that a
// saturated reading passes but a broken one does not.
constexpr std::array<SignalFacts, kSignalCount> kFacts{{
    {"CV", "%", {-10.0, 110.0}},
    {"P1", "kPa", {-100.0, 20000.0}},
    {"P2", "kPa", {-100.0, 20000.0}},
    {"T1", "degC", {-100.0, 650.0}},
    {"X", "%", {-10.0, 110.0}},
    {"F", "", {-500.0, 12000.0}},
    {"SP", "%", {-10.0, 110.0}},
    {"CVI", "-", {-2.0, 2.0}},
    {"Ps", "kPa", {-100.0, 2000.0}},
    {"Pz", "kPa", {-100.0, 2000.0}},
    {"PV", "", {-1e12, 1e12}},
}};

constexpr std::array<std::string_view, 5> kModeNames = {
    "AUTO", "MANUAL", "INHIBITED", "OUT_OF_SERVICE", "CALIBRATING"};

}  // namespace

std::string_view SignalName(Signal signal) {
  return kFacts[Index(signal)].name;
}

std::string_view SignalUnit(Signal signal) {
  return kFacts[Index(signal)].unit;
}

std::optional<Signal> ParseSignal(std::string_view name) {
  for (std::size_t i = 0; i < kSignalCount; ++i) {
    if (SameName(name, kFacts[i].name)) {
      return static_cast<Signal>(i);
    }
  }
  return std::nullopt;
}

SignalRange PlausibleRange(Signal signal) {
  return kFacts[Index(signal)].range;
}

bool IsPlausible(const Sample& sample, Signal signal) {
  const bool as_pv = signal == Signal::kSp && sample.Has(Signal::kPv);
  return PlausibleRange(as_pv ? Signal::kPv : signal).Contains(sample[signal]);
}

double GoodReading(const Sample& sample, Signal signal) {
  const bool good = sample.Has(signal) &&
                    sample.quality[Index(signal)] != SignalQuality::kBad &&
                    IsPlausible(sample, signal);
  return good ? sample[signal] : std::numeric_limits<double>::quiet_NaN();
}

std::string_view ValveModeName(ValveMode mode) {
  return kModeNames[static_cast<std::size_t>(mode)];
}

std::optional<ValveMode> ParseValveMode(std::string_view name) {
  for (std::size_t i = 0; i < kModeNames.size(); ++i) {
    if (SameName(name, kModeNames[i])) {
      return static_cast<ValveMode>(i);
    }
  }
  return std::nullopt;
}

std::string_view FlowUnitName(FlowUnit unit) {
  return unit == FlowUnit::kM3PerHour ? "m3/h" : "t/h";
}

std::optional<FlowUnit> ParseFlowUnit(std::string_view name) {
  if (name == "m3/h") {
    return FlowUnit::kM3PerHour;
  }
  if (name == "t/h") {
    return FlowUnit::kTPerHour;
  }
  return std::nullopt;
}

}  // namespace fdi
