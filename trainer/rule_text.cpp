#include "trainer/rule_text.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

namespace fdi::trainer {
namespace {

constexpr double kWholeRange = 0.9;  // of the data: says nothing

// Decimals that show a hundredth of `span`.
std::string InSteps(double value, double span) {
  const double decimals = span > 0.0 ? std::ceil(2.0 - std::log10(span)) : 2.0;
  std::array<char, 40> text{};
  std::snprintf(text.data(), text.size(), "%.*f",
                static_cast<int>(std::clamp(decimals, 0.0, 9.0)), value);
  return text.data();
}

// Where the membership is at least one half, within [minimum, maximum].
SignalRange HalfRange(const FuzzySet& set, double minimum, double maximum) {
  const double reach = std::sqrt(2.0 * std::log(2.0));
  return {
      std::clamp(set.left_center - reach * set.left_width, minimum, maximum),
      std::clamp(set.right_center + reach * set.right_width, minimum, maximum)};
}

std::string ConsequentText(const TsModel& model, const TsRule& rule,
                           FlowUnit flow_unit) {
  std::string text = RegressorText({model.output, 0}) + " =";
  for (std::size_t j = 0; j < rule.slopes.size(); ++j) {
    const double slope = rule.slopes[j];
    if (slope == 0.0) {
      continue;
    }
    text += text.back() == '=' ? (slope < 0.0 ? " -" : " ")
                               : (slope < 0.0 ? " - " : " + ");
    text +=
        Digits(std::abs(slope), 4) + ' ' + RegressorText(model.regressors[j]);
  }
  const double intercept = rule.intercept;
  text += text.back() == '=' ? (intercept < 0.0 ? " -" : " ")
                             : (intercept < 0.0 ? " - " : " + ");
  return text + Digits(std::abs(intercept), 4) + ' ' +
         UnitOf(model.output, flow_unit);
}

// "near (CV(k) 50 %, P1(k) 3500 kPa)": the center of a rule, without the
// regressors that its metric does not read; empty for a rule without one.
std::string NearnessText(const TsModel& model, const TsRule& rule,
                         FlowUnit flow_unit) {
  std::string text;
  for (std::size_t j = 0; j < rule.center.size(); ++j) {
    const std::size_t diagonal = j * (j + 1) / 2 + j;
    if (rule.metric[diagonal] == 0.0) {
      continue;
    }
    text += (text.empty() ? "" : ", ") + RegressorText(model.regressors[j]) +
            ' ' + Digits(rule.center[j], 4) + ' ' +
            UnitOf(model.regressors[j].signal, flow_unit);
  }
  return text.empty() ? text : "near (" + text + ')';
}

}  // namespace

std::string Digits(double value, int digits) {
  std::array<char, 40> text{};
  std::snprintf(text.data(), text.size(), "%.*g", digits, value);
  return text.data();
}

std::string UnitOf(Signal signal, FlowUnit flow_unit) {
  return std::string(signal == Signal::kF ? FlowUnitName(flow_unit)
                                          : SignalUnit(signal));
}

std::string RegressorText(const Regressor& regressor) {
  return std::string(SignalName(regressor.signal)) + "(k" +
         (regressor.lag > 0 ? '-' + std::to_string(regressor.lag) : "") + ')';
}

std::string AntecedentWords(const TsModel& model, const TsRule& rule,
                            std::size_t j, FlowUnit flow_unit) {
  const double minimum = model.regressor_min[j];
  const double span = model.regressor_max[j] - minimum;
  const SignalRange range =
      HalfRange(rule.antecedents[j], minimum, model.regressor_max[j]);
  if (!(range.maximum - range.minimum < kWholeRange * span)) {
    return {};
  }
  const double middle =
      (0.5 * (range.minimum + range.maximum) - minimum) / span;
  const char* label = middle < 1.0 / 3.0   ? "low"
                      : middle > 2.0 / 3.0 ? "high"
                                           : "medium";
  return std::string(label) + " [" + InSteps(range.minimum, span) + ".." +
         InSteps(range.maximum, span) + ' ' +
         UnitOf(model.regressors[j].signal, flow_unit) + ']';
}

std::string RulesText(const TsModel& model, FlowUnit flow_unit) {
  std::string text;
  for (const TsRule& rule : model.rules) {
    std::string conditions;
    for (std::size_t j = 0; j < rule.antecedents.size(); ++j) {
      const std::string words = AntecedentWords(model, rule, j, flow_unit);
      if (!words.empty()) {
        conditions += (conditions.empty() ? "if " : " and ") +
                      RegressorText(model.regressors[j]) + " is " + words;
      }
    }
    const std::string nearness = NearnessText(model, rule, flow_unit);
    if (!nearness.empty()) {
      conditions += (conditions.empty() ? "if " : " and ") + nearness;
    }
    text += "  " + (conditions.empty() ? "always" : conditions) +
            "\n    then " + ConsequentText(model, rule, flow_unit) + "   (" +
            Digits(100.0 * rule.data_share, 3) + " % of the data)\n";
  }
  return text;
}

}  // namespace fdi::trainer
