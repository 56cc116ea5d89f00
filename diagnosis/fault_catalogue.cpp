#include "diagnosis/fault_catalogue.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>

#include "diagnosis/error.h"
#include "diagnosis/suggestion.h"

namespace fdi {
namespace {

constexpr std::array<FaultFacts, kLastFault> kFaults{{
    {"f1", "valve clogging", "F1", false},
    {"f2", "plug or seat sedimentation", "", false},
    {"f3", "plug or seat erosion", "F2", false},
    {"f4", "increased friction of valve or bushing", "", true},
    {"f5", "external leakage", "", false},
    {"f6", "internal leakage", "F3", false},
    {"f7", "medium evaporation or critical flow", "F4", false},
    {"f8", "twisted piston rod", "", false},
    {"f9", "housing or terminals leak air", "", false},
    {"f10", "diaphragm perforation", "", false},
    {"f11", "spring fault", "", false},
    {"f12", "electro-pneumatic transducer fault", "", true},
    {"f13", "rod displacement sensor fault", "", true},
    {"f14", "positioner pressure sensor fault", "", true},
    {"f15", "positioner feedback fault", "", false},
    {"f16", "supply pressure drop", "", false},
    {"f17", "unexpected pressure change across the valve", "", true},
    {"f18", "bypass valve open", "", false},
    {"f19", "flow sensor fault", "F5", true},
    {"t1", "temperature transmitter fault", "", true},
    {"p1", "inlet pressure transmitter fault", "", true},
    {"p2", "outlet pressure transmitter fault", "", true},
}};

constexpr std::array<int, 5> kPaperFaults{1, 3, 6, 7, 19};

std::optional<int> NumberAfter(std::string_view text, std::string_view prefix) {
  if (!text.starts_with(prefix)) {
    return std::nullopt;
  }
  text.remove_prefix(prefix.size());
  int number = 0;
  const auto [end, error] =
      std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc{} || end != text.data() + text.size()) {
    return std::nullopt;
  }
  return number;
}

std::string Lower(std::string_view text) {
  std::string lower(text);
  std::transform(lower.begin(), lower.end(), lower.begin(), [](char c) {
    return static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  });
  return lower;
}

}  // namespace

const FaultFacts& FaultFactsOf(int fault) {
  Require(fault >= 1 && fault <= kLastFault, "fault must be in 1..22");
  return kFaults[static_cast<std::size_t>(fault - 1)];
}

std::string FaultName(int fault) {
  if (fault == 0) {
    return "normal";
  }
  if (fault < 0 || fault > kLastFault) {
    return "unknown";
  }
  return std::string(FaultFactsOf(fault).name);
}

std::optional<int> ParseFault(std::string_view name) {
  const std::string lower = Lower(name);
  if (const auto paper = NumberAfter(lower, "paper")) {
    if (*paper >= 1 && *paper <= 5) {
      return kPaperFaults[static_cast<std::size_t>(*paper - 1)];
    }
    return std::nullopt;
  }
  const auto number = NumberAfter(lower, "f");
  if (number && *number >= 1 && *number <= kFaultCount) {
    return number;
  }
  for (int fault = kFaultCount + 1; fault <= kLastFault; ++fault) {
    if (lower == FaultFactsOf(fault).name) {
      return fault;
    }
  }
  return std::nullopt;
}

std::string DidYouMeanFault(std::string_view name,
                            std::vector<std::string> others) {
  const std::string lower = Lower(name);
  if (NumberAfter(lower, "f") || NumberAfter(lower, "paper")) {
    return "";  // Well written, but there is no such number.
  }
  for (int fault = 1; fault <= kLastFault; ++fault) {
    others.push_back(FaultName(fault));
  }
  const auto meant = Suggest(lower, others);
  return meant ? " (did you mean '" + *meant + "'?)" : "";
}

std::optional<Signal> TransmitterOf(int fault) {
  switch (fault) {
    case kTemperatureTransmitterFault:
      return Signal::kT1;
    case kInletPressureTransmitterFault:
      return Signal::kP1;
    case kOutletPressureTransmitterFault:
      return Signal::kP2;
    default:
      return std::nullopt;
  }
}

int RequireFault(std::string_view name) {
  if (const auto fault = ParseFault(name)) {
    return *fault;
  }
  throw ConfigError("unknown fault '" + std::string(name) + "'" +
                    DidYouMeanFault(name) + ": expected " +
                    std::string(kFaultNames) + " or paper1..paper5");
}

}  // namespace fdi
