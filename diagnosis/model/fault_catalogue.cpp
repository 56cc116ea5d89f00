#include "diagnosis/model/fault_catalogue.h"

#include <algorithm>
#include <array>

#include "base/error.h"
#include "base/suggestion.h"
#include "base/text.h"

namespace fdi {
namespace {

// "f1..f19, t1, p1, p2, x1".
std::string JoinedNames() {
  std::string names = "f1..f" + std::to_string(kFaultCount);
  for (int fault = kFaultCount + 1; fault <= kLastFault; ++fault) {
    names += ", " + std::string(FaultFactsOf(fault).name);
  }
  return names;
}

constexpr std::array<int, 5> kPaperFaults{1, 3, 6, 7, 19};

std::optional<int> NumberAfter(std::string_view text, std::string_view prefix) {
  if (!text.starts_with(prefix)) {
    return std::nullopt;
  }
  text.remove_prefix(prefix.size());
  return ParseWhole<int>(text);
}

}  // namespace

bool Contains(const std::vector<int>& faults, int fault) {
  return std::ranges::find(faults, fault) != faults.end();
}

const std::string kFaultNames = JoinedNames();

const FaultFacts& FaultFactsOf(int fault) {
  Require(IsFault(fault) || IsFinding(fault), "fault is not of the catalogue");
  return IsFault(fault) ? kFaultCatalogue[fault - 1]
                        : kFindingCatalogue[fault - kFirstFinding];
}

std::string FaultName(int fault) {
  if (fault == 0) {
    return "normal";
  }
  return IsFault(fault) || IsFinding(fault)
             ? std::string(FaultFactsOf(fault).name)
             : "unknown";
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

std::optional<int> ParseFinding(std::string_view name) {
  const std::string lower = Lower(name);
  for (int finding = kFirstFinding; finding <= kLastFinding; ++finding) {
    if (lower == FaultFactsOf(finding).name) {
      return finding;
    }
  }
  return ParseFault(name);
}

std::string DidYouMeanFault(std::string_view name,
                            std::vector<std::string> others) {
  const std::string lower = Lower(name);
  if (NumberAfter(lower, "f") || NumberAfter(lower, "paper")) {
    return "";  // Well-formed, but there is no such number.
  }
  if (ParseFinding(lower)) {
    return " (a finding: it says what is seen, not what is wrong)";
  }
  for (const int fault : kFaultsAndFindings) {
    others.push_back(FaultName(fault));
  }
  const auto meant = Suggest(lower, others);
  return meant ? " (did you mean '" + *meant + "'?)" : "";
}

std::optional<Signal> TransmitterOf(int fault) {
  return IsFault(fault) ? FaultFactsOf(fault).transmitter : std::nullopt;
}

bool HasNegative(int fault) {
  const FaultFacts& facts = FaultFactsOf(fault);
  return facts.is_signed && !facts.negative_hidden;
}

bool IsVisibleIn(int fault, SignalMask signals) {
  const FaultFacts& facts = FaultFactsOf(fault);
  return (facts.visible_in & signals) != 0 && (facts.told_by & ~signals) == 0;
}

int RequireFault(std::string_view name) {
  if (const auto fault = ParseFault(name)) {
    return *fault;
  }
  throw ConfigError("unknown fault '" + std::string(name) + "'" +
                    DidYouMeanFault(name) + ": expected " +
                    std::string(kFaultNames) + " or paper1..paper5");
}

int RequireFinding(std::string_view name) {
  const auto finding = ParseFinding(name);
  return finding ? *finding : RequireFault(name);
}

}  // namespace fdi
