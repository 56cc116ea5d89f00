#include <cstdint>
#include <cstdlib>
#include <stdexcept>
#include <string_view>

#include "diagnosis/decision/rules.h"

// Leaves out the rule that FDI_RULE_OFF names, before any test runs.
namespace fdi {
namespace {

std::uint64_t BitOf(std::string_view name) {
  for (const RuleRow& row : kRules) {
    if (row.name == name) {
      return std::uint64_t{1} << static_cast<unsigned>(row.rule);
    }
  }
  throw std::invalid_argument("no such rule");
}

[[maybe_unused]] const bool kIsSwitched = [] {
  const char* name = std::getenv("FDI_RULE_OFF");
  rules_off = name == nullptr ? 0 : BitOf(name);
  return true;
}();

}  // namespace
}  // namespace fdi
